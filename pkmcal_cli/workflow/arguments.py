"""Checks of a command's arguments that hold for every command."""

from __future__ import annotations

import os
from collections.abc import Iterable

from pkmcal_cli.calibration.selection import select
from pkmcal_cli.errors import OutputError, UsageError
from pkmcal_cli.files import is_stream
from pkmcal_cli.model import Model


def one_stdin(*inputs: str | None) -> None:
    """At most one input may be stdin. Raises UsageError."""
    if sum(i is not None and is_stream(i) for i in inputs) > 1:
        raise UsageError("only one input can be `-`, stdin", hint="give the others as files")


def no_input(target: str, inputs: Iterable[str]) -> None:
    """A result never replaces what it was made from, not even with --force. Raises OutputError."""
    if is_stream(target):
        return
    files = {os.path.realpath(i) for i in inputs if not is_stream(i)}
    if os.path.realpath(target) in files:
        raise OutputError("this file is an input of the command", target, "give the result another name", "output")


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
