"""Checks of a command's arguments that hold for every command."""

from __future__ import annotations

from pkmcal_cli.base.errors import UsageError
from pkmcal_cli.base.files import is_stream
from pkmcal_cli.calibration.selection import select
from pkmcal_cli.model.model import Model


def one_stdin(*inputs: str | None) -> None:
    """At most one input may be stdin. Raises UsageError."""
    if sum(i is not None and is_stream(i) for i in inputs) > 1:
        raise UsageError("only one input can be `-`, stdin", hint="give the others as files")


def given(*texts: str | None) -> list[str]:
    """Those arguments that were given."""
    return [text for text in texts if text is not None]


def selection(model: Model, text: str, option: str = "--select") -> tuple[str, ...]:
    """Names of the parameters that an option chooses; at least one. Raises UsageError."""
    if not model.parameters:
        raise UsageError("the machine has no parameters", hint="declare them in `parameters:` of the machine file")
    if text == "auto" and not any(p.identify for p in model.parameters):
        what = "--select auto: every parameter is declared `identify: false`"
        raise UsageError(what, hint="name those to be identified, or `--select all`")
    chosen = select(model, text, option)
    if not chosen:
        raise UsageError(f"--select: `{text}` leaves no parameter", hint="for example auto,-gamma")
    return chosen
