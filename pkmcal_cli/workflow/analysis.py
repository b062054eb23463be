"""Sensitivity and observability from files to tables and JSON."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from pkmcal_cli.base.errors import UsageError, did_you_mean
from pkmcal_cli.base.files import is_stream
from pkmcal_cli.base.listener import Listener
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.mean_sensitivity import sensitivity
from pkmcal_cli.calibration.observability_indices import Observability, observability
from pkmcal_cli.calibration.problem import Problem, design_problem
from pkmcal_cli.calibration.residual import evaluate
from pkmcal_cli.calibration.selection import named
from pkmcal_cli.csv_files.writer import check_table
from pkmcal_cli.language.tool_point import ToolPoint
from pkmcal_cli.loading.load_machine import LoadedMachine, load_machine, load_parameters
from pkmcal_cli.loading.pose_channels import planned_channels
from pkmcal_cli.loading.tool_coordinates import required_tool_point
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.tool_channels import tcp_model
from pkmcal_cli.pictures.analysis_pictures import observability_picture, sensitivity_picture
from pkmcal_cli.pictures.picture import Picture
from pkmcal_cli.pictures.titles import Titles, titles
from pkmcal_cli.prediction import Prediction, Rows
from pkmcal_cli.report.analysis_report import (
    UNSTRAINED,
    observability_json,
    sensitivity_json,
    show_along,
    show_observability,
    show_sensitivity,
)
from pkmcal_cli.report.console import Reporter, emit_json, enveloped
from pkmcal_cli.report.failed_rows import FailedRows
from pkmcal_cli.report.loads import Loads
from pkmcal_cli.report.provenance import provenance
from pkmcal_cli.units.unit_text import parse_unit
from pkmcal_cli.workflow.amounts import amount
from pkmcal_cli.workflow.arguments import checked_method, one_stdin, present, require_measured, selection
from pkmcal_cli.workflow.plots import check_plot, write_plot
from pkmcal_cli.workflow.pose_set import PoseSet, default_poses, pose_set
from pkmcal_cli.workflow.shift_table import write_shifts
from pkmcal_cli.workflow.stated_sizes import stated_sizes
from pkmcal_cli.workflow.tensioned_poses import tensioned_poses
from pkmcal_cli.workflow.touched_poses import touching_poses
from pkmcal_cli.workflow.unstrained import is_unstrained


@dataclass(frozen=True, kw_only=True)
class AnalysisRequest:
    """The arguments of `sensitivity` and `observability`."""

    machine: str
    poses: str | None = None
    grid: str | None = None
    parameters: str | None = None
    select: str | None = None  # every parameter
    offset: tuple[str, ...] | None = None
    plot: str | None = None
    as_json: bool = False
    quiet: bool = False
    force: bool = False


@dataclass(frozen=True, kw_only=True)
class SensitivityRequest(AnalysisRequest):
    """The arguments of `sensitivity`; channel: a coordinate of the tool point."""

    size: tuple[str, ...] | None = None
    channel: str | None = None
    method: str = "exact"
    output: str | None = None


@dataclass(frozen=True)
class _Setting:
    """What both analyses start from."""

    loaded: LoadedMachine
    values: Array
    selected: tuple[str, ...]
    set: PoseSet
    to: Listener
    inputs: Mapping[str, str]

    def predicted(self, prediction: Prediction, poses: PoseSet) -> PoseSet:
        """The poses that were predicted, the others told. Raises BadInput with rows of a table, or with none left."""
        lost = {int(k): prediction.reason(int(k)) for k in np.nonzero(~prediction.solved)[0]}
        solved = poses.without_points(lost)
        solved.failed.show(self.to)
        return solved

    def show_loads(self, poses: PoseSet) -> None:
        """Warnings of forces above limits and of slack ropes."""
        Loads.of(self.loaded.model, self.values, poses.poses.rows, poses.poses.row_origin).show(self.to)


def _prepare(request: AnalysisRequest, to: Listener, machine: LoadedMachine | None = None) -> _Setting:
    one_stdin(request.machine, request.poses, request.parameters)
    loaded = load_machine(request.machine) if machine is None else machine
    for fault in loaded.warnings:
        to.warn(fault)
    if not any(p.per_session for p in loaded.model.parameters):  # else the sessions must be known first
        _selected(request, loaded.model)
    stated = request.poses is not None or request.grid is not None
    poses = pose_set(to, loaded, request.poses, request.grid) if stated else default_poses(to, loaded)
    loaded = loaded.for_sessions(poses.every.rows.named_sessions)
    model, selected = loaded.model, _selected(request, loaded.model)
    start = load_parameters(model, request.parameters)
    for text in start.remarks(bool(poses.every.rows.named_sessions)):
        to.warn(text)
    poses = tensioned_poses(to, loaded, start.values, poses)
    readings = _offset_readings(model, poses.poses.rows, request.offset or ())
    inputs = loaded.inputs | start.inputs | poses.inputs
    return _Setting(loaded, start.values, selected, poses.with_readings(readings), to, inputs)


def _selected(request: AnalysisRequest, model: Model) -> tuple[str, ...]:
    """Names of the selected parameters, all of them by default. Raises UsageError."""
    if request.select is None and model.names:
        return model.names
    return selection(model, "all" if request.select is None else request.select)


def _offset_readings(model: Model, rows: Rows, offsets: tuple[str, ...]) -> Array:
    """Readings (N, A) of rows with actuators moved off their set values, `NAME=VALUE unit`. Raises UsageError."""
    readings = rows.readings.copy()
    names = model.drive_names
    for text in offsets:
        name, equals, value = (t.strip() for t in text.partition("="))
        if not equals:
            raise UsageError(f"--offset: `{text}` is not an offset", hint='write NAME=VALUE, e.g. --offset q1="50 um"')
        if name not in names:
            raise UsageError(f"--offset: the machine has no actuator `{name}`", hint=did_you_mean(name, names))
        column = names.index(name)
        if model.topology.drives[column].force_controlled:
            message = f"--offset: `{name}` is force-controlled and has no set value"
            raise UsageError(message, hint="offset a position-controlled actuator")
        drive_unit = parse_unit(model.actuators[column].unit)
        moved, unit = amount("--offset", value, drive_unit)
        if unit.dimension != drive_unit.dimension:
            raise UsageError(
                f"--offset: the unit of `{value}` does not fit `{name}`", hint=f"give it in {drive_unit.text}"
            )
        readings[:, column] += moved
    return readings


def run_sensitivity(request: SensitivityRequest) -> int:
    """Show and emit sensitivities, write shifts by position; returns the exit code. Raises PkmcalError."""
    _check_sensitivity(request)
    to = Reporter(request.quiet)
    _check_plot(request, request.output)
    s = _prepare(request, to)
    tool = required_tool_point(s.loaded)
    model, units = s.loaded.model, s.loaded.machine.file_units
    channel = None if request.channel is None else _coordinate(model, request.channel)
    sizes = stated_sizes(model, s.selected, request.size or ())
    method = checked_method(request.method)
    with to.step("what each parameter moves"):
        result = sensitivity(model, s.values, s.set.poses.rows, sizes, method)
    used = s.predicted(result.prediction, s.set)
    s.to.notes([tool.text] if s.set.tool is None else [])
    word = "size" if request.size else "range"
    if channel is None:
        show_sensitivity(to, model, units, result, word)
    else:
        show_along(to, model, units, result, word, channel)
    s.show_loads(s.set)
    if request.output is not None and channel is not None:
        write_shifts(request.output, s.loaded, s.inputs, result, s.set, channel, force=request.force)
    if request.plot is not None:
        named = _titles(request, "sensitivity")
        write_plot(sensitivity_picture(result, model, named, channel), request.plot, s.inputs, to, force=request.force)
    if request.as_json:
        head = {"tool_point": tool.name, **used.failed.json()}
        shown = head | sensitivity_json(model, units, result, channel)
        emit_json(enveloped("sensitivity", "complete", shown, provenance(s.inputs)))
    return 0


def _check_plot(request: AnalysisRequest, output: str | None) -> None:
    """Whether the picture can be written. Raises UsageError and OutputError."""
    inputs = present(request.machine, request.poses, request.parameters)
    check_plot(request.plot, inputs, output, force=request.force)


def _titles(request: AnalysisRequest, command: str) -> Titles:
    return titles(request.machine, command, present(request.parameters, request.poses))


def _check_sensitivity(request: SensitivityRequest) -> None:
    """Whether the options go together. Raises UsageError and OutputError."""
    if request.output is None:
        return
    if request.channel is None:
        raise UsageError("-o writes shifts of one coordinate", hint="name it: `--channel x`")
    if request.as_json and is_stream(request.output):
        raise UsageError("--json and `-o -` both write to stdout", hint="give `-o` a file")
    check_table(request.output, present(request.machine, request.poses, request.parameters), force=request.force)


def _coordinate(model: Model, name: str) -> str:
    """A coordinate of the tool point. Raises UsageError."""
    known = [c.name for c in tcp_model(model).channels]
    if name not in known:
        raise UsageError(f"--channel: the tool point has no coordinate `{name}`", hint=did_you_mean(name, known))
    return name


@dataclass(frozen=True, kw_only=True)
class Observed:
    """What a plan determines, at the rows of `problem`; missed: parameters that were named, but are undetermined."""

    result: Observability
    problem: Problem
    loads: Loads
    failed: FailedRows
    tool: ToolPoint | None
    missed: tuple[str, ...]
    inputs: Mapping[str, str]  # sha256 by name
    unstrained: bool  # a redundant machine at nominal parameters that nothing loads

    def json(self) -> dict[str, Any]:
        """The result for programs."""
        head = {"tool_point": self.tool and self.tool.name, **self.failed.json()}
        return head | observability_json(self.problem.model, self.result, len(self.problem))


def observed(request: AnalysisRequest, to: Listener, machine: LoadedMachine | None = None) -> Observed:
    """What a plan determines. Raises PkmcalError."""
    s = _prepare(request, to, machine)
    model = s.loaded.model
    poses = touching_poses(s.to, s.loaded, s.values, s.set)
    used = poses.poses
    problem = design_problem(model, used.rows, planned_channels(model, used.measured, used.touched))
    require_measured(problem)
    with to.step("poses"):
        prediction = evaluate(problem, s.values).prediction
    predicted = s.predicted(prediction, poses)
    if not prediction.solved.all():
        problem = problem.take(np.nonzero(prediction.solved)[0])
    with to.step("what the poses determine"):
        result = observability(problem, s.values, s.selected)
    lost = {n for n, gone in zip(result.selected, result.directions.undetermined(), strict=True) if gone}
    return Observed(
        result=result,
        problem=problem,
        loads=Loads.of(model, s.values, poses.poses.rows, poses.poses.row_origin),
        failed=predicted.failed,
        tool=predicted.tool,
        missed=tuple(n for n in s.selected if n in lost & named(model, request.select or "")),
        inputs=s.inputs,
        unstrained=is_unstrained(s.loaded, request.parameters, used.rows),
    )


def observability_drawn(request: AnalysisRequest, observation: Observed) -> Picture:
    """Expected uncertainties as shares of the ranges."""
    named = _titles(request, "observability")
    return observability_picture(observation.result, observation.problem.model, named)


def _verdict(result: Observability) -> str:
    """What of the selected parameters the positions determine."""
    if not result.directions.rank:
        return "nothing_determined"
    return "partly_determined" if result.directions.undetermined().any() else "determined"


def run_observability(request: AnalysisRequest) -> int:
    """Show and emit what a plan determines; returns the exit code. Raises PkmcalError."""
    _check_plot(request, None)
    to = Reporter(request.quiet)
    observation = observed(request, to)
    result = observation.result
    show_observability(to, observation.problem.model, result, len(observation.problem))
    if observation.unstrained and result.undetermined:
        to.say(UNSTRAINED)
    observation.loads.show(to)
    if request.plot is not None:
        write_plot(observability_drawn(request, observation), request.plot, observation.inputs, to, force=request.force)
    if request.as_json:
        emit_json(enveloped("observability", _verdict(result), observation.json(), provenance(observation.inputs)))
    if observation.missed:
        to.fail(f"named in --select but undetermined: {', '.join(observation.missed)}")
    elif not result.directions.rank:
        to.fail("these positions determine none of the selected parameters")
    return 1 if observation.missed or not result.directions.rank else 0
