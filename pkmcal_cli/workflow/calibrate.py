"""Calibration from files to files."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pkmcal_cli.base.errors import BadInput, Fault, Location, UsageError, did_you_mean
from pkmcal_cli.base.files import is_stream
from pkmcal_cli.base.outputs import check_target, write_text
from pkmcal_cli.calibration.complete_fit import Calibration, FitOptions, calibrated
from pkmcal_cli.calibration.datum import Datum
from pkmcal_cli.calibration.determinacy import determinacy
from pkmcal_cli.calibration.frame_start import at_frames
from pkmcal_cli.calibration.identify import RowsFailed
from pkmcal_cli.calibration.measured_problem import problem_of
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.selection import named
from pkmcal_cli.gross_errors.hints import absurd_rows, copied_rows, measurement_hints, nothing_measured
from pkmcal_cli.loading.load_machine import LoadedMachine, Start, load_machine, load_measurements, load_parameters
from pkmcal_cli.loading.poses import Place, place_of
from pkmcal_cli.pictures.residual_picture import calibration_picture
from pkmcal_cli.pictures.titles import titles
from pkmcal_cli.prediction.unknown_shapes import outside_knots
from pkmcal_cli.report.calibration import CalibrationReport
from pkmcal_cli.report.console import Reporter, emit_json
from pkmcal_cli.report.limitations import outside_text
from pkmcal_cli.report.provenance import provenance
from pkmcal_cli.tables.measurement_set import Measurements
from pkmcal_cli.units.unit_text import parse_unit
from pkmcal_cli.workflow.arguments import by_method, checked_method, given, one_stdin, selection
from pkmcal_cli.workflow.calibration_run import calibration_run
from pkmcal_cli.workflow.gates import Gate, Judged, check_gates, gates, measured_kinds, missed_limits
from pkmcal_cli.workflow.gross_row_reasons import gross_row_reasons
from pkmcal_cli.workflow.held_out import held_out, validated
from pkmcal_cli.workflow.plots import check_plot, write_plot
from pkmcal_cli.workflow.prior_file import earlier_calibration
from pkmcal_cli.workflow.result_figures import Result
from pkmcal_cli.workflow.run_folder import check_run, keep_run
from pkmcal_cli.workflow.unsolved_rows import unsolved

_FOLDS = "5"
_SCHEMES = ("session", "cells", "none")
_NUMBER = re.compile(r"[-+]?[0-9]+(\.[0-9]*)?|")
_DIGITS = 9


@dataclass(frozen=True, kw_only=True)
class CalibrationRequest:
    """The arguments of `calibrate`."""

    machine: str
    measurements: tuple[str, ...]
    output: str | None = None
    select: str = "auto"
    holdout: str | None = None
    parameters: str | None = None
    method: str = "exact"
    fit_options: FitOptions = field(default_factory=FitOptions)
    loosen: str | None = None
    max_rms: str | None = None
    accept: bool = False
    fail_above: tuple[str, ...] | None = None
    run: str | None = None
    plot: str | None = None
    as_json: bool = False
    quiet: bool = False
    style: str = "text"
    force: bool = False


@dataclass(frozen=True, kw_only=True)
class _Setting:
    """What the fit starts from."""

    request: CalibrationRequest
    loaded: LoadedMachine
    measured: Measurements
    problem: Problem
    selected: tuple[str, ...]
    start: Start
    limits: tuple[Gate, ...]
    apart: Measurements | None  # the rows of a file that is held out
    datum: Datum | None = None

    @property
    def inputs(self) -> dict[str, str]:
        """sha256 by name of all that was read."""
        apart = {} if self.apart is None else self.apart.inputs
        return self.loaded.inputs | self.start.inputs | self.measured.inputs | apart


def run_calibration(request: CalibrationRequest) -> int:
    """Calibrate, show and write; returns the exit code. Raises PkmcalError."""
    to = Reporter(request.quiet, request.style)
    s = _prepare(request)
    to.notes(s.measured.notes)
    for finding in (*s.loaded.warnings, *s.measured.warnings):
        to.warn(finding)
    for text in s.start.warnings:
        to.warn(text)
    hints = measurement_hints(s.loaded, s.problem, s.start.values, s.measured)
    for hint in (*hints, *copied_rows(s.problem, s.measured)):
        to.warn(f"warning: {hint}")
    for text in outside_text(outside_knots(s.problem.model, s.problem.rows)):
        to.warn(text)
    s = _determined(s, to)
    options = s.request.fit_options
    if hints:  # no start mends a wrong column
        options = replace(options, starts=options.starts or 1)
    calibration = _fit(s, options, to)
    fit = calibration.robust.fit
    s = replace(s, problem=s.problem.without(fit.failed))
    if s.apart is None:
        held = held_out(s.problem, s.measured, fit, request.holdout, request.fit_options)
    else:
        held = validated(s.loaded, s.problem, fit, s.apart)
    gross = gross_row_reasons(s.problem, calibration, _places(s))
    report = CalibrationReport(s.loaded.machine, s.problem, calibration, held, _places(s), (*hints, *gross))
    report.show(to)
    if report.implausible and request.accept:
        to.say("accepted (`--accept`)")
    return _written(s, report, to)


def _written(s: _Setting, report: CalibrationReport, to: Reporter) -> int:
    """Write what is asked for; the exit code. Raises OutputError."""
    request = s.request
    accepted = {"accepted": list(report.implausible)} if report.implausible and request.accept else {}
    how = {} if request.method == "exact" else {"method": request.method}
    text = report.parameter_file(provenance(s.inputs, seed=None, status=report.status, **how, **accepted))
    if request.output is not None:
        with write_text(request.output, s.inputs, force=request.force) as file:
            file.write(text)
    if request.plot is not None:
        named = titles(s.loaded.model.name, "calibration", s.measured.files)
        picture = calibration_picture(report, named, s.loaded.machine.file_units.length)
        write_plot(picture, request.plot, s.inputs, to, force=request.force)
    judged = _judged(s, report)
    result = report.json() | {"method": request.method, "gates": [each.json() for each in judged]}
    if request.as_json:
        emit_json(result)
    code = _exit_code(s, report, judged, to)
    if request.run is not None:
        keep_run(request.run, s.inputs, calibration_run(request.machine, report, result, text, code), to)
    return code


def _checked(request: CalibrationRequest) -> str | None:
    """The file that is held out, if the arguments go together. Raises UsageError, OutputError."""
    if request.as_json and request.output is not None and is_stream(request.output):
        raise UsageError("--json and `-o -` both write to stdout", hint="give `-o` a file")
    prior = request.fit_options.prior_file
    one_stdin(request.machine, *request.measurements, request.parameters, request.holdout, prior)
    check_run(request.run, request.machine, *request.measurements, request.parameters, request.holdout, prior)
    request.fit_options.check(files=True)
    if request.loosen is not None and prior is None:
        raise UsageError("--loosen needs a prior", hint="add `--prior OLD.params.yaml`, written by `calibrate -o`")
    file = _file_of(request.holdout)
    inputs = given(request.machine, *request.measurements, request.parameters, file, prior)
    check_target(request.output, inputs, force=request.force)
    check_plot(request.plot, inputs, request.output, force=request.force)
    return file


def _prepare(request: CalibrationRequest) -> _Setting:
    """Check the arguments, read the files. Raises PkmcalError."""
    file, method = _checked(request), checked_method(request.method)
    limits = gates(request.fail_above or (), request.max_rms)
    loaded = load_machine(request.machine)
    if not any(p.per_session for p in loaded.model.parameters):  # else the sessions must be known first
        selection(loaded.model, request.select)
    measured = load_measurements(loaded, request.measurements)
    problem = by_method(problem_of(loaded.model, measured), method)
    selected = selection(problem.model, request.select)
    start = load_parameters(problem.model, request.parameters)
    declared = loaded.model.for_sessions(measured.sessions)
    start = replace(start, values=at_frames(start.values, declared, problem.model))
    if request.fit_options.prior_file is not None:
        problem, selected, start = _after(request, request.fit_options.prior_file, problem, selected, start)
    if not problem.count:
        raise BadInput([nothing_measured(loaded, problem)])
    absurd = absurd_rows(problem, lambda row: place_of(measured, row))
    if absurd:
        raise BadInput(absurd)
    check_gates(limits, problem.model, measured_kinds(problem))
    apart = None if file is None else _apart(loaded, measured, file)
    s = _Setting(
        request=request,
        loaded=loaded,
        measured=measured,
        problem=problem,
        selected=selected,
        start=start,
        limits=limits,
        apart=apart,
    )
    check_target(request.output, s.inputs, force=request.force)
    return s


def _after(
    request: CalibrationRequest, file: str, problem: Problem, selected: tuple[str, ...], start: Start
) -> tuple[Problem, tuple[str, ...], Start]:
    """Problem, parameters and start with what an earlier calibration knows. Raises BadInput and UsageError."""
    earlier = earlier_calibration(
        problem.model, file, selected, request.select == "auto", request.loosen, start.values
    )
    notes = tuple(f"note: {text}" for text in earlier.notes)
    values = earlier.values if request.parameters is None else start.values
    start = replace(start, values=values, inputs=start.inputs | earlier.inputs, warnings=start.warnings + notes)
    return replace(problem, prior=earlier.prior), earlier.selected, start


def _determined(s: _Setting, to: Reporter) -> _Setting:
    """The setting without the parameters that are held as datum. Raises BadInput for data that determine too little."""
    asked = determinacy(s.problem, s.start.values, s.selected)
    if asked.refusal:
        raise BadInput([Fault("under-determined", asked.refusal, Location(s.loaded.model.name), asked.remedy)])
    for line in asked.notes:
        to.say(line)
    return replace(s, selected=asked.selected, datum=asked.datum)


def _file_of(scheme: str | None) -> str | None:
    """The file that --holdout names, None where it names none. Raises UsageError for a word that is nothing."""
    if scheme is None or scheme in _SCHEMES or _NUMBER.fullmatch(scheme):
        return None
    if not is_stream(scheme) and not os.path.splitext(scheme)[1] and not os.path.exists(scheme):
        hint = did_you_mean(scheme, _SCHEMES, "give a number of folds, session, cells, FILE.csv or none")
        raise UsageError(f"--holdout: `{scheme}` is not a scheme", hint=hint)
    return scheme


def _apart(loaded: LoadedMachine, measured: Measurements, file: str) -> Measurements:
    """The rows of a file that is held out. Raises BadInput, and UsageError for rows that are fitted."""
    other = load_measurements(loaded, [file])
    if set(other.sha256) & set(measured.sha256):
        raise UsageError(f"--holdout: the rows of `{file}` are fitted", hint="give another file, or a number of folds")
    return other


def _fit(s: _Setting, options: FitOptions, to: Reporter) -> Calibration:
    try:
        calibration = calibrated(
            s.problem,
            s.selected,
            start=s.start.values,
            options=options,
            session=np.asarray(s.measured.session),
            datum=s.datum,
            tell=to.say,
        )
    except RowsFailed as failure:
        raise unsolved(s.measured, failure.evaluation.prediction) from None
    if calibration.agreement is not None:
        to.say(calibration.agreement.text)
    return calibration


def _places(s: _Setting) -> Callable[[int], Place]:
    """Where a row stands in its file."""
    return lambda row: place_of(s.measured, row)


def _exit_code(s: _Setting, report: CalibrationReport, judged: Sequence[Judged], to: Reporter) -> int:
    """1 when the verdict is negative: not converged, a named parameter undetermined, a limit missed; all is told."""
    failed = report.status != "converged" and not (report.implausible and s.request.accept)
    if failed and s.request.quiet:
        to.fail(report.verdict())
    wanted = named(report.model, s.request.select) & set(s.selected)
    lost = [r.name for r in report.rows if r.name in wanted and r.std is None]
    if lost:
        to.fail(f"named in --select but undetermined: {', '.join(lost)}")
    missed = missed_limits(judged, s.loaded, s.measured.files[0])
    for fault in missed:
        to.fail(fault)
    return int(failed or bool(lost) or bool(missed))


def _judged(s: _Setting, report: CalibrationReport) -> tuple[Judged, ...]:
    """Limits of the command line and what they are held against."""
    held = report.held_out
    std = {r.name: None if r.std is None else r.std * parse_unit(r.unit).scale for r in report.rows}
    result = Result(
        machine=s.loaded.machine,
        held_out=held if isinstance(held, str) else held.after,
        fitted=report.after,
        chi2_per_dof=report.fit.chi2_per_dof,
        std=std,
        before=(report.model, s.start.values),
        after=(report.model, report.fit.values),
        rows=report.problem.rows,
    )
    return result.judged(s.limits)
