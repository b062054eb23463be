"""Checks of a command's arguments that hold for every command."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pkmcal_cli.base.errors import BadInput, Location, UsageError
from pkmcal_cli.base.files import is_stream
from pkmcal_cli.calibration.selection import select
from pkmcal_cli.loading.load_machine import NO_SENSORS, SENSOR
from pkmcal_cli.model.model import Model

if TYPE_CHECKING:
    from pkmcal_cli.calibration.problem import Problem


def one_stdin(*inputs: str | None) -> None:
    """At most one input may be stdin. Raises UsageError."""
    if sum(i is not None and is_stream(i) for i in inputs) > 1:
        raise UsageError("only one input can be `-` (stdin)", hint="give the others as files")


def given(*texts: str | None) -> list[str]:
    """Those arguments that were given."""
    return [text for text in texts if text is not None]


def require_measured(problem: Problem) -> None:
    """Something would be measured. Raises BadInput where nothing is."""
    if problem.count:
        return
    what = NO_SENSORS if not problem.model.channels else "nothing would be measured: no channel has a `sigma`"
    raise BadInput.single(what, Location(problem.model.name), SENSOR, "sensors")


def selection(model: Model, text: str, option: str = "--select") -> tuple[str, ...]:
    """Names of the parameters that an option chooses; at least one. Raises UsageError."""
    if not model.parameters:
        raise UsageError("the machine has no parameters", hint="declare them in `parameters:` of the machine file")
    if text == "auto" and not any(p.identify for p in model.parameters):
        what = "--select auto: every parameter is declared `identify: false`"
        raise UsageError(what, hint="name the parameters to identify, or use `--select all`")
    chosen = select(model, text, option)
    if not chosen:
        raise UsageError(
            f"--select: `{text}` selects no parameter", hint="name parameters to identify, e.g. `--select auto,-gamma`"
        )
    return chosen
