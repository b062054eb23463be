"""Checks of a command's arguments that hold for every command."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, get_args

from pkmcal_cli.base.errors import BadInput, Location, UsageError, did_you_mean
from pkmcal_cli.base.files import is_stream
from pkmcal_cli.calibration.selection import select
from pkmcal_cli.loading.load_machine import NO_SENSORS, SENSOR, LoadedMachine
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import Method

if TYPE_CHECKING:
    from pkmcal_cli.calibration.problem import Problem


def one_stdin(*inputs: str | None) -> None:
    """At most one input may be stdin. Raises UsageError."""
    if sum(i is not None and is_stream(i) for i in inputs) > 1:
        raise UsageError("only one input can be `-` (stdin)", hint="give the others as files")


def present(*texts: str | None) -> list[str]:
    """Those arguments that were given."""
    return [text for text in texts if text is not None]


def require_forces(asked: bool, loaded: LoadedMachine) -> None:
    """Forces are determined, where they are asked for. Raises UsageError."""
    if asked and loaded.compiled.shared_by:
        message = "--forces: nothing yields in this machine, so the forces of its drives are not determined"
        raise UsageError(message, hint="give a member, joint or actuator a stiffness")


def require_measured(problem: Problem) -> None:
    """Something would be measured. Raises BadInput where nothing is."""
    if problem.count:
        return
    message = NO_SENSORS if not problem.model.channels else "nothing would be measured: no channel has a `sigma`"
    raise BadInput.single(message, Location(problem.model.name), SENSOR, "sensors")


def checked_method(text: str) -> Method:
    """A method of prediction. Raises UsageError."""
    known: tuple[Method, ...] = get_args(Method)
    for method in known:
        if text == method:
            return method
    raise UsageError(f"--method: `{text}` is not a method", hint=did_you_mean(text, known))


def by_method(problem: Problem, method: Method) -> Problem:
    """The same table, predicted by a method. Raises UsageError where it cannot be fitted by this one."""
    partner = problem.rows.partner
    if method != "exact" and partner is not None and (partner >= 0).any():
        raise UsageError(f"--method {method}: measurements join rows of the table", hint="leave out `--method`")
    return replace(problem, method=method)


def selection(model: Model, text: str, option: str = "--select") -> tuple[str, ...]:
    """Names of the parameters that an option chooses; at least one. Raises UsageError."""
    if not model.parameters:
        raise UsageError("the machine has no parameters", hint="declare them in `parameters:` of the machine file")
    if text == "auto" and not any(p.identify for p in model.parameters):
        message = "--select auto: every parameter is declared `identify: false`"
        raise UsageError(message, hint="name the parameters to identify, or use `--select all`")
    chosen = select(model, text, option)
    if not chosen:
        raise UsageError(
            f"--select: `{text}` selects no parameter", hint="name parameters to identify, e.g. `--select auto,-gamma`"
        )
    return chosen
