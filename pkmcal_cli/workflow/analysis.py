"""Sensitivity and observability from files to tables and JSON."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pkmcal_cli.base.errors import BadInput, Location, UsageError, did_you_mean
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.observability import observability
from pkmcal_cli.calibration.problem import design_problem
from pkmcal_cli.calibration.residual import evaluate
from pkmcal_cli.calibration.selection import named
from pkmcal_cli.calibration.sensitivity import sensitivity
from pkmcal_cli.loading.covariates import at_rest, resting
from pkmcal_cli.loading.machine import LoadedMachine, load_machine, load_parameters
from pkmcal_cli.loading.poses import Place, Poses, PoseSource, failed_rows
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import Prediction, Rows
from pkmcal_cli.report.analysis import (
    UNSTRAINED,
    observability_json,
    sensitivity_json,
    show_observability,
    show_sensitivity,
)
from pkmcal_cli.report.console import Reporter, emit_json
from pkmcal_cli.units.unit_text import parse_unit
from pkmcal_cli.workflow.amounts import amount
from pkmcal_cli.workflow.arguments import one_stdin, selection


@dataclass(frozen=True, kw_only=True)
class AnalysisRequest:
    """The arguments of `sensitivity` and `observability`."""

    machine: str
    poses: str | None
    grid: str | None
    parameters: str | None
    select: str | None  # None: every parameter
    offset: tuple[str, ...] | None
    as_json: bool
    quiet: bool


@dataclass(frozen=True)
class _Setting:
    """What both analyses start from."""

    loaded: LoadedMachine
    values: Array
    selected: tuple[str, ...]
    poses: Poses
    to: Reporter

    def check(self, prediction: Prediction) -> None:
        """Every row must have been predicted. Raises BadInput with those that were not."""
        lost = {int(k): prediction.reason(int(k)) for k in np.nonzero(~prediction.solved)[0]}
        if lost:
            raise failed_rows(self.poses.place, lost)


def _prepare(request: AnalysisRequest) -> _Setting:
    one_stdin(request.machine, request.poses, request.parameters)
    to = Reporter(request.quiet)
    loaded = load_machine(request.machine)
    for fault in loaded.warnings:
        to.warn(fault.text())
    model = loaded.model
    every = request.select is None and bool(model.names)
    selected = model.names if every else selection(model, "all" if request.select is None else request.select)
    start = load_parameters(model, request.parameters)
    for text in start.warnings:
        to.warn(text)
    if request.poses is None and request.grid is None:
        to.say("note: no poses given: at the drawing only")
        to.notes([note] if (note := resting(model)) else [])
        rows = at_rest(model, Rows.at(model.drawn_readings[None]))
        poses = Poses(rows, np.ones(1, dtype=bool), lambda _: Place(None, 0, ""))
    else:
        source = PoseSource(loaded=loaded, path=request.poses, grid=request.grid)
        poses = source.together()
        to.notes(source.notes)
        for text in source.travels.warnings():
            to.warn(text)
    rows = _offset_rows(model, poses.rows, request.offset or ())
    return _Setting(loaded, start.values, selected, Poses(rows, poses.reachable, poses.place, poses.measured), to)


def _offset_rows(model: Model, rows: Rows, offsets: tuple[str, ...]) -> Rows:
    """Rows with actuators moved off their set values, `NAME=VALUE unit`. Raises UsageError."""
    readings = rows.readings.copy()
    names = [a.name for a in model.actuators]
    for text in offsets:
        name, equals, value = (t.strip() for t in text.partition("="))
        if not equals:
            raise UsageError(f"--offset: `{text}` is no offset", hint='NAME=VALUE, for example --offset q1="50 um"')
        if name not in names:
            raise UsageError(f"--offset: the machine has no actuator `{name}`", hint=did_you_mean(name, names))
        column = names.index(name)
        if model.layout.drives[column].force_controlled:
            what = f"--offset: `{name}` is force-controlled: it has no set value"
            raise UsageError(what, hint="offset a position-controlled actuator")
        own = parse_unit(model.actuators[column].unit)
        moved, unit = amount("--offset", value, own)
        if unit.dimension != own.dimension:
            raise UsageError(f"--offset: `{value}` does not fit `{name}`", hint=f"it reads {own.text}")
        readings[:, column] += moved
    return replace(rows, readings=readings)


def run_sensitivity(request: AnalysisRequest) -> int:
    """Show and emit sensitivities; returns the exit code. Raises PkmcalError."""
    s = _prepare(request)
    model, units = s.loaded.model, s.loaded.machine.file_units
    found = sensitivity(model, s.values, s.poses.rows, s.selected)
    s.check(found.prediction)
    show_sensitivity(s.to, model, units, found, len(s.poses))
    if request.as_json:
        emit_json(sensitivity_json(model, units, found, len(s.poses)))
    return 0


def run_observability(request: AnalysisRequest) -> int:
    """Show and emit what a plan determines; returns the exit code. Raises PkmcalError."""
    s = _prepare(request)
    model = s.loaded.model
    problem = design_problem(model, s.poses.rows, s.poses.measured)
    if not problem.count:
        what = "no channel has a sigma: nothing would be measured"
        hint = "declare a sensor with `reads:` and `sigma:`"
        raise BadInput.single(what, Location(model.name), hint, "sensors")
    s.check(evaluate(problem, s.values).prediction)
    found = observability(problem, s.values, s.selected)
    show_observability(s.to, model, found, len(s.poses))
    if request.parameters is None and s.loaded.compiled.mobility.redundancy > 0 and found.undetermined:
        s.to.say(UNSTRAINED)
    if request.as_json:
        emit_json(observability_json(model, found, len(s.poses)))
    lost = {n for n, gone in zip(found.selected, found.found.undetermined(), strict=True) if gone}
    missed = [n for n in s.selected if n in lost & named(model, request.select or "")]
    if missed:
        s.to.fail(f"named in --select but not determined: {', '.join(missed)}")
    elif not found.found.rank:
        s.to.fail("these positions determine none of the selected parameters")
    return 1 if missed or not found.found.rank else 0
