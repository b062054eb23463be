"""Studies from machine files to figures: errors after calibration against the number of points."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from pkmcal_cli.base.errors import BadInput, Location, UsageError
from pkmcal_cli.base.files import input_name, is_stream
from pkmcal_cli.base.plural import count
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.base.workers import Workers
from pkmcal_cli.calibration.error_budget import held_parameters
from pkmcal_cli.calibration.study import StudiedMachine, Study
from pkmcal_cli.calibration.study_figures import differences, figures
from pkmcal_cli.csv_files.writer import check_table
from pkmcal_cli.loading.load_machine import NO_SENSORS, SENSOR, LoadedMachine, load_machine
from pkmcal_cli.loading.pose_channels import known_channels
from pkmcal_cli.loading.tool_coordinates import tool_motion
from pkmcal_cli.model.model import Model
from pkmcal_cli.pictures.study_picture import study_picture
from pkmcal_cli.pictures.titles import titles
from pkmcal_cli.prediction import Rows
from pkmcal_cli.report.console import Reporter, emit_json, enveloped
from pkmcal_cli.report.provenance import provenance
from pkmcal_cli.report.study import StudyReport
from pkmcal_cli.units.unit_text import parse_unit
from pkmcal_cli.workflow.amounts import amount
from pkmcal_cli.workflow.arguments import one_stdin, selection
from pkmcal_cli.workflow.drawn_region import region_of
from pkmcal_cli.workflow.plots import check_plot, write_plot
from pkmcal_cli.workflow.state import State, all_done, check_state
from pkmcal_cli.workflow.study_table import write_study

DECLARED = "declared"
_MOST = 100_000  # points


@dataclass(frozen=True, kw_only=True)
class StudyRequest:
    """The arguments of `study`."""

    machines: tuple[str, ...]
    points: str
    noise: str
    repeat: int
    within: str | None
    select: str
    held: Literal["drawn", "nominal"]
    validation: int
    seed: int
    jobs: int
    cluster: str | None
    state: str | None
    output: str | None
    plot: str | None
    as_json: bool
    quiet: bool
    force: bool


def run_study(request: StudyRequest) -> int:
    """Calibrate again and again, show and write what is left; returns the exit code. Raises PkmcalError."""
    counts, workers = _counts(request.points), Workers.of(request.jobs, request.cluster)
    _check(request)
    to = Reporter(request.quiet)
    study, inputs = _study(request, counts, to)
    names = ("points", "noise", "within", "select", "held", "validation", "seed")  # with more repetitions it goes on
    state = State.read(request.state, "study", {n: getattr(request, n) for n in names}, inputs)
    total = request.repeat * len(counts)
    done = all_done(study, total, "calibration", workers, state, to)
    done = {number: done[number] for number in range(total)}
    report = StudyReport(study, request.noise, request.repeat, figures(study, done), differences(study, done))
    report.show(to)
    head = provenance(inputs, seed=request.seed)
    if request.output is not None:
        write_study(report, request.output, inputs, head, force=request.force)
        to.say(f"written: {request.output}")
    if request.plot is not None:
        named = titles(", ".join(m.name for m in study.machines), "errors after calibration", ())
        write_plot(study_picture(report, named), request.plot, inputs, to, force=request.force)
    if request.as_json:
        emit_json(enveloped("study", report.verdict, report.json(), head))
    if report.verdict == "none_calibrated":
        to.fail("no calibration has converged to what noise explains")
    return int(report.verdict == "none_calibrated")


def _check(request: StudyRequest) -> None:
    """Whether the arguments go together, and results could be written. Raises UsageError and OutputError."""
    one_stdin(*request.machines)
    if request.as_json and request.output is not None and is_stream(request.output):
        raise UsageError("--json and `-o -` both write to stdout", hint="give `-o` a file")
    check_table(request.output, request.machines, force=request.force)
    check_plot(request.plot, request.machines, request.output, force=request.force)
    check_state(request.state, request.machines, request.output, request.plot)


def _counts(text: str) -> tuple[int, ...]:
    """Numbers of points. Raises UsageError."""
    parts = [part.strip() for part in text.split(",")]
    good = all(p.isascii() and p.isdigit() and len(p) < 7 and 0 < int(p) <= _MOST for p in parts)
    counts = tuple(sorted({int(p) for p in parts})) if good else ()
    if len(counts) < len(parts):
        message = f"--points: `{text}` is not a list of distinct numbers of points, up to {_MOST}"
        raise UsageError(message, hint="write e.g. --points 10,20,40,80")
    return counts


def _study(request: StudyRequest, counts: tuple[int, ...], to: Reporter) -> tuple[Study, dict[str, str]]:
    """What is repeated; sha256 by name of all that was read. Raises PkmcalError."""
    loaded = [_loaded(file, to) for file in request.machines]
    first, inputs = loaded[0], dict[str, str]()
    region = region_of(first, request.within, to)
    machines = []
    names = _names(request.machines)
    for name, each in zip(names, loaded, strict=True):
        machine = _studied(name, each, request, region.names)
        _check_counts(machine, counts)
        machines.append(machine)
        inputs |= each.inputs
    study = Study(
        machines=tuple(machines), region=region, counts=counts, validation=request.validation, seed=request.seed
    )
    with to.step("points"):
        region.drawn(study.machines, 1, np.random.default_rng(request.seed))
    return study, inputs


def _names(files: tuple[str, ...]) -> list[str]:
    """What machines are called: their files without folder and ending, whole where these are the same."""
    short = [os.path.splitext(os.path.basename(input_name(file)))[0] for file in files]
    if len(set(short)) < len(short):
        short = [input_name(file) for file in files]
    if len(set(short)) < len(short):
        raise UsageError("a machine is given twice", hint="give each machine once")
    return short


def _loaded(file: str, to: Reporter) -> LoadedMachine:
    """A machine that measures by itself. Raises BadInput."""
    loaded = load_machine(file)
    for fault in loaded.warnings:
        to.warn(fault)
    model = loaded.model
    if not model.channels:
        raise BadInput.single(NO_SENSORS, Location(model.name), SENSOR, "sensors")
    if known_channels(model).any():
        message = "`study` does not support machines with touch probes"
        raise BadInput.single(message, Location(model.name), "use `plan` and `simulate` instead", "sensors")
    tool_motion(loaded)
    return loaded.for_sessions(Rows.at(model.reference_readings[None]).named_sessions)


def _studied(name: str, loaded: LoadedMachine, request: StudyRequest, spread: tuple[str, ...]) -> StudiedMachine:
    """A machine with what is identified and how it is measured. Raises UsageError and BadInput."""
    model, motion = loaded.model, tool_motion(loaded)
    held = motion.with_all(spread)
    if held is None:
        message = f"{' and '.join(spread)} cannot be held together by the tool point of {model.name}"
        if request.within is not None:
            raise UsageError(f"--within: {message}", hint="give coordinates that all tool points move in")
        hint = 'give a box of coordinates that all tool points move in: `--within "x=0:950,y=160:390"`'
        raise UsageError(message, hint=hint)
    machine = StudiedMachine(
        name=name,
        model=model,
        selected=selection(model, request.select),
        held=held,
        sigma=_sigma(model, request.noise),
    )
    if request.held == "nominal":
        return machine
    unknown = held_parameters(machine.problem(model.reference_readings[None]), machine.selected, ())
    return replace(machine, unidentified=unknown)


def _sigma(model: Model, text: str) -> Array:
    """Standard uncertainties (C,) by `--noise`, nan where those of the machine file hold. Raises UsageError."""
    sigma = np.full(len(model.channels), np.nan)
    if text == DECLARED:
        return sigma
    dimensions = [parse_unit(c.unit).dimension for c in model.channels]
    value, unit = amount("--noise", text, fitting=tuple(dict.fromkeys(dimensions)))
    fits = [dimension == unit.dimension for dimension in dimensions]
    if not any(fits) or value <= 0:
        message = f"--noise: `{text}` is not a noise of a channel of {model.name}"
        raise UsageError(message, hint='give declared, or a value above zero such as "10 um"')
    sigma[fits] = value
    return sigma


def _check_counts(machine: StudiedMachine, counts: tuple[int, ...]) -> None:
    """Points give as many values as there are parameters. Raises UsageError and BadInput."""
    problem = machine.problem(np.tile(machine.model.reference_readings, (counts[0], 1)))
    if not problem.count:
        message, hint = "nothing would be measured: no channel has a `sigma`", "state it, or give `--noise`"
        raise BadInput.single(message, Location(machine.model.name), hint, "sensors")
    if problem.count < len(machine.selected):
        values, unknown = count(problem.count, "value"), count(len(machine.selected), "parameter")
        message = f"--points: {counts[0]} points give {values}, but {machine.name} has {unknown} to identify"
        raise UsageError(message, hint="give more points, or fewer parameters: `--select`")
