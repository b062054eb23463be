"""Calibration from files to files."""

from __future__ import annotations

from collections.abc import Sequence

from pkmcal_cli.base.errors import UsageError
from pkmcal_cli.base.files import is_stream
from pkmcal_cli.base.outputs import check_target, write_text
from pkmcal_cli.calibration.selection import named
from pkmcal_cli.report.calibration import CalibrationReport
from pkmcal_cli.report.console import Reporter, emit_json, enveloped
from pkmcal_cli.units.unit_text import parse_unit
from pkmcal_cli.workflow.arguments import checked_method, one_stdin, present
from pkmcal_cli.workflow.calibration import (
    Calibrated,
    CalibrationRequest,
    CalibrationSetting,
    calibration,
    checked,
    parameter_head,
    setting,
)
from pkmcal_cli.workflow.calibration_run import calibration_run
from pkmcal_cli.workflow.gates import Gate, Judged, check_gates, gates, measured_kinds, missed_limits
from pkmcal_cli.workflow.plots import check_plot, write_plot
from pkmcal_cli.workflow.result_figures import Result
from pkmcal_cli.workflow.run_folder import check_run, keep_run


def run_calibration(request: CalibrationRequest) -> int:
    """Calibrate, show and write; returns the exit code. Raises PkmcalError."""
    to = Reporter(request.quiet, request.style)
    _check_outputs(request)
    checked_method(request.method)
    limits = gates(request.fail_above or (), request.max_rms)
    s = setting(request)
    check_gates(limits, s.problem.model, measured_kinds(s.problem))
    check_target(request.output, s.inputs, force=request.force)
    calibrated = calibration(s, to)
    calibrated.report.show(to)
    return _written(calibrated, limits, to)


def _written(calibrated: Calibrated, limits: Sequence[Gate], to: Reporter) -> int:
    """Write what is asked for; the exit code. Raises OutputError."""
    s, report, request = calibrated.setting, calibrated.report, calibrated.setting.request
    head = parameter_head(calibrated)
    text = report.parameter_file(head)
    if request.output is not None:
        with write_text(request.output, s.inputs, force=request.force) as file:
            file.write(text)
    if request.plot is not None:
        write_plot(calibrated.picture, request.plot, s.inputs, to, force=request.force)
    judged = _judged(s, report, limits)
    verdict, code = _verdict(s, report, judged, to)
    result = enveloped("calibrate", verdict, calibrated.json | {"gates": [each.json() for each in judged]}, head)
    if request.as_json:
        emit_json(result)
    if request.run is not None:
        kept = calibration_run(request.machine, request.asked, report, result, text, code)
        keep_run(request.run, s.inputs, kept, to)
    return code


def _check_outputs(request: CalibrationRequest) -> None:
    """Whether the arguments go together, and results could be written. Raises UsageError, OutputError."""
    if request.as_json and request.output is not None and is_stream(request.output):
        raise UsageError("--json and `-o -` both write to stdout", hint="give `-o` a file")
    prior = request.fit_options.prior_file
    one_stdin(request.machine, *request.measurements, request.parameters, request.holdout, prior)
    inputs = present(request.machine, *request.measurements, request.parameters, checked(request), prior)
    check_target(request.output, inputs, force=request.force)
    check_plot(request.plot, inputs, request.output, force=request.force)
    check_run(request.run, inputs, (request.output, request.plot))


def _verdict(
    s: CalibrationSetting, report: CalibrationReport, judged: Sequence[Judged], to: Reporter
) -> tuple[str, int]:
    """In a word, and the exit code; 1: not converged, a named parameter undetermined, a limit missed; all is told."""
    failed = not report.usable and report.word != "accepted"
    if failed:
        to.refuse(report.verdict(), s.measured.location)
    selected_by_name = named(report.model, s.request.select) & set(s.determined)
    lost = [r.name for r in report.rows if r.name in selected_by_name and r.std is None]
    if lost:
        to.fail(f"named in --select but undetermined: {', '.join(lost)}")
    missed = missed_limits(judged, s.loaded, s.measured.files[0])
    for fault in missed:
        to.fail(fault)
    word = "undetermined" if lost else "limit_missed" if missed else report.word
    return report.status if failed else word, int(failed or bool(lost) or bool(missed))


def _judged(s: CalibrationSetting, report: CalibrationReport, limits: Sequence[Gate]) -> tuple[Judged, ...]:
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
    return result.judged(limits)
