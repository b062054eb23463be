"""Calibration from files to files."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..calibration.holdout import HeldOut, cross_validate, enough_rows, fold_labels, validate
from ..calibration.identify import Fit, RowsFailed, identify
from ..calibration.residual import Problem, problem_of
from ..calibration.selection import named, select
from ..errors import BadInput, Location, UsageError
from ..files import check_target, is_stream, write_text
from ..loading import LoadedMachine, failed_rows, load_machine, load_measurements, parameter_values
from ..measurement_set import Measurements
from ..report.calibration import CalibrationReport
from ..report.console import Reporter, emit_json
from ..report.provenance import provenance
from ..unit_text import UnitError, parse_value
from .hints import measurement_hints

_FOLDS = "5"


@dataclass(frozen=True)
class CalibrationRequest:
    """The arguments of `calibrate`."""

    machine: str
    measurements: tuple[str, ...]
    output: str | None
    select: str
    holdout: str | None
    parameters: str | None
    max_rms: str | None
    as_json: bool
    quiet: bool
    force: bool


def run_calibration(request: CalibrationRequest) -> int:
    """Calibrate, show and write; returns the exit code. Raises PkmcalError."""
    if request.as_json and request.output is not None and is_stream(request.output):
        raise UsageError("--json and `-o -` both write to stdout", hint="give `-o` a file")
    limit = _limit(request.max_rms)
    if request.output is not None:
        check_target(request.output, force=request.force)
    to = Reporter(request.quiet)
    loaded = load_machine(request.machine)
    measured = load_measurements(loaded, request.measurements)
    selected = select(loaded.model, request.select)
    problem = problem_of(loaded.model, measured)
    start = parameter_values(loaded.model, request.parameters)
    to.notes(measured.notes)
    for fault in loaded.warnings:
        to.warn(fault.text())
    for hint in measurement_hints(loaded, problem, start):
        to.warn(f"warning: {hint}")
    fit = _fit(problem, selected, start, measured)
    report = CalibrationReport(loaded.machine, problem, fit, _held_out(request, loaded, problem, measured, fit))
    report.show(to)
    if request.as_json:
        emit_json(report.json())
    if request.output is not None:
        inputs = dict(loaded.machine.files) | dict(zip(measured.files, measured.sha256, strict=True))
        text = report.parameter_file(provenance(inputs, seed=None, status=fit.status))
        with write_text(request.output, force=request.force) as file:
            file.write(text)
    return _exit_code(request, report, fit, limit, to)


def _fit(problem: Problem, selected: tuple[str, ...], start: np.ndarray, measured: Measurements) -> Fit:  # type: ignore[type-arg]
    try:
        return identify(problem, selected, start)
    except RowsFailed as failure:
        prediction = failure.evaluation.prediction
        lost = np.nonzero(~prediction.solved)[0]
        places = [measured.place(k) for k in range(len(measured))]
        raise failed_rows(places, {int(k): prediction.reason(int(k)) for k in lost}) from None


def _held_out(
    request: CalibrationRequest, loaded: LoadedMachine, problem: Problem, measured: Measurements, fit: Fit
) -> HeldOut | str:
    """Held-out figures, or why there are none."""
    scheme = request.holdout
    if scheme == "none":
        return "not asked for"
    if fit.status != "converged":
        return f"the fit has not succeeded ({fit.status})"
    if scheme is None:
        if not enough_rows(problem, fit.selected):
            return f"{len(problem)} rows for {len(fit.selected)} parameters: fewer than 3 rows a parameter"
        scheme = _FOLDS
    if scheme not in ("session", "cells") and not scheme.isdigit():
        other = load_measurements(loaded, [scheme])
        return validate(problem_of(loaded.model, other), fit, f"rows of {scheme}")
    try:
        labels, words = fold_labels(scheme, problem, measured)
    except ValueError as error:
        raise UsageError(f"--holdout {scheme}: {error}") from None
    return cross_validate(problem, fit, labels, words)


def _limit(text: str | None) -> float | None:
    if text is None:
        return None
    try:
        number, unit = parse_value(text)
    except UnitError as error:
        raise UsageError(f"--max-rms: {error.what}", hint=error.hint) from None
    if unit.dimension.name != "length":
        raise UsageError(f"--max-rms: `{text}` is no length", hint='for example "20 um"')
    return unit.to_si(number)


def _exit_code(
    request: CalibrationRequest, report: CalibrationReport, fit: Fit, limit: float | None, to: Reporter
) -> int:
    """1 when the verdict is negative: not converged, a named parameter undetermined, the limit missed."""
    if fit.status != "converged":
        return 1
    wanted = named(report.model, request.select)
    lost = [r.name for r in report.rows if r.name in wanted and r.std is None]
    if lost:
        to.warn(f"named in --select but not determined: {', '.join(lost)}")
        return 1
    if limit is not None:
        if "position" not in report.after:
            raise UsageError("--max-rms: no positions were measured")
        if report.after["position"].rms > limit:
            to.warn(f"position rms above the limit of {request.max_rms}")
            return 1
    return 0


__all__ = ["BadInput", "CalibrationRequest", "Location", "run_calibration"]
