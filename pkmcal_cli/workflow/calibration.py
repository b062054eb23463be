"""Calibration from files to what was found: one function for the command line and for Python."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from pkmcal_cli.base.errors import BadInput, UsageError
from pkmcal_cli.base.listener import Listener
from pkmcal_cli.base.stages import Observer
from pkmcal_cli.calibration.complete_fit import Calibration, FitOptions, calibrated
from pkmcal_cli.calibration.datum import Datum, with_held
from pkmcal_cli.calibration.eliminated_frames import without_frames
from pkmcal_cli.calibration.frame_start import at_frames
from pkmcal_cli.calibration.identify import STEPS, RowsFailed
from pkmcal_cli.calibration.measured_problem import problem_of
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import evaluate
from pkmcal_cli.calibration.unknown_sides import with_unknown_sides
from pkmcal_cli.gross_errors.hints import (
    absurd_rows,
    copied_rows,
    measurement_hints,
    nothing_measured,
    rows_far_off,
    sample_at,
    unsided,
)
from pkmcal_cli.loading.ending import provenance_of_doubts
from pkmcal_cli.loading.known_parameters import fitted_tables
from pkmcal_cli.loading.load_machine import LoadedMachine, Start, load_machine, load_measurements, load_parameters
from pkmcal_cli.loading.poses import origin_of
from pkmcal_cli.prediction import WarmStart
from pkmcal_cli.prediction.unknown_shapes import outside_knots
from pkmcal_cli.report.calibration import CalibrationReport
from pkmcal_cli.report.limitations import outside_text
from pkmcal_cli.report.provenance import provenance
from pkmcal_cli.tables.measurement_set import Measurements
from pkmcal_cli.workflow.arguments import by_method, checked_method, selection
from pkmcal_cli.workflow.determined import determined
from pkmcal_cli.workflow.gross_row_reasons import BeyondNoise, beyond_noise, odd_readings, spoilt, without_readings
from pkmcal_cli.workflow.held_out import held_out, holdout_file, implausible, validated
from pkmcal_cli.workflow.moved_frames import moved_warnings
from pkmcal_cli.workflow.overstated_sigma import noise_doubts
from pkmcal_cli.workflow.prior_file import EarlierCalibration, earlier_calibration
from pkmcal_cli.workflow.unsolved_rows import unsolved

if TYPE_CHECKING:
    from pkmcal_cli.pictures.picture import Picture

_STEPS_IN_DOUBT = 15  # of a fit that a hint has made implausible already


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

    @property
    def asked(self) -> dict[str, Any]:
        """What a sheet of this calibration needs to know."""
        options = self.fit_options
        prior = options.prior if options.prior_file is None else "none"
        asked = {"measurements": list(self.measurements), "parameters": self.parameters, "select": self.select}
        return asked | {"loss": options.loss, "prior": prior, "seed": options.seed}


@dataclass(frozen=True, kw_only=True)
class CalibrationSetting:
    """What a fit starts from: the files, read; selected: names, but for eliminated frames; apart: rows held out."""

    request: CalibrationRequest
    loaded: LoadedMachine
    measured: Measurements
    problem: Problem
    selected: tuple[str, ...]
    start: Start
    apart: Measurements | None
    kept: tuple[str, ...] = ()  # the datum of an earlier calibration
    datum: Datum | None = None

    @property
    def determined(self) -> tuple[str, ...]:
        """Names of all parameters that the fit determines."""
        return (*self.selected, *self.problem.eliminated)

    @property
    def inputs(self) -> dict[str, str]:
        """sha256 by name of all that was read."""
        apart = {} if self.apart is None else self.apart.inputs
        return self.loaded.inputs | self.start.inputs | self.measured.inputs | apart


@dataclass(frozen=True)
class Calibrated:
    """A calibration: what it started from, and what it found."""

    setting: CalibrationSetting
    report: CalibrationReport

    @property
    def json(self) -> dict[str, Any]:
        """The result for programs."""
        return self.report.json() | {"method": self.setting.request.method}

    @property
    def picture(self) -> Picture:
        """Error maps, residuals over the drives, parameters."""
        from pkmcal_cli.pictures.residual_picture import calibration_picture
        from pkmcal_cli.pictures.titles import titles

        loaded = self.setting.loaded
        named = titles(loaded.model.name, "calibration", self.setting.measured.files)
        return calibration_picture(self.report, named, loaded.machine.file_units.length)


def checked(request: CalibrationRequest) -> str | None:
    """The file that is held out, if what is asked for goes together. Raises UsageError."""
    request.fit_options.check(files=True)
    if request.loosen is not None and request.fit_options.prior_file is None:
        raise UsageError("--loosen needs a prior", hint="add `--prior OLD.params.yaml`, written by `calibrate -o`")
    return holdout_file(request.holdout)


def setting(request: CalibrationRequest, machine: LoadedMachine | None = None) -> CalibrationSetting:
    """Check what is asked for and read the files; `machine`: where it is loaded already. Raises PkmcalError."""
    file, method = checked(request), checked_method(request.method)
    loaded = load_machine(request.machine, tables=request.measurements) if machine is None else machine
    if not any(p.per_session for p in loaded.model.parameters):  # else the sessions must be known first
        selection(loaded.model, request.select)
    measured = load_measurements(loaded, request.measurements)
    problem = by_method(problem_of(loaded.model, measured), method)
    selected = selection(problem.model, request.select)
    start = load_parameters(problem.model, request.parameters)
    declared = loaded.model.for_sessions(measured.named_sessions)
    start = replace(start, values=at_frames(start.values, declared, problem.model))
    kept: tuple[str, ...] = ()
    if request.fit_options.prior_file is not None:
        problem, start, earlier = _after(request, request.fit_options.prior_file, problem, selected, start)
        if fitted := fitted_tables(earlier.known, measured.inputs):
            twice = f"warning: {', '.join(fitted)}: the prior was fitted to these rows, so they count twice"
            start = replace(start, warnings=(*start.warnings, twice))
        selected, kept = earlier.selected, earlier.datum
    moved = moved_warnings(start.values, declared, problem.model, selected, request.parameters)
    start = replace(start, warnings=(*start.warnings, *moved))
    if not problem.count:
        raise BadInput([nothing_measured(loaded, problem)])
    if absurd := absurd_rows(problem, lambda row: origin_of(measured, row)):
        raise BadInput(absurd)
    problem, selected = without_frames(with_unknown_sides(problem, selected), selected, request.fit_options.plain)
    return CalibrationSetting(
        request=request,
        loaded=loaded,
        measured=measured,
        problem=problem,
        selected=selected,
        start=start,
        apart=None if file is None else _apart(loaded, measured, file),
        kept=kept,
    )


def calibration(s: CalibrationSetting, to: Listener) -> Calibrated:
    """Calibrate; `to`: who is told what there is to say of the files. Raises PkmcalError."""
    _say_of_files(s, to)
    states = evaluate(s.problem, s.start.values).start
    sample = sample_at(s.loaded, s.problem, s.start.values, states)
    hints = measurement_hints(s.loaded, s.problem, s.start.values, s.measured, states, sample)
    wrong_table = bool(hints) and not s.request.accept
    if not hints and s.request.fit_options.loss == "squares":
        hints = rows_far_off(sample, s.measured)
    for hint in (*hints, *copied_rows(s.problem, s.measured)):
        to.warn(f"warning: {hint}", s.measured.location)
    for text in outside_text(outside_knots(s.problem.model, s.problem.rows)):
        to.warn(text)
    s = _determined(s, states, to)
    options, row_origin = s.request.fit_options, partial(origin_of, s.measured)
    beyond = BeyondNoise() if hints else beyond_noise(s.problem, s.selected, s.start.values, states)
    odd = odd_readings(s.loaded, s.problem, beyond, row_origin)
    if options.loss == "squares":
        hints = (*hints, *spoilt(odd, beyond, row_origin, to))
    else:
        s = replace(s, problem=without_readings(s.problem, odd, to))
    if hints:  # no start mends a wrong column, and what does not converge soon never will
        options = replace(options, starts=options.starts or 1)
    with to.stages() as observe:
        robust_fit = _fit(s, states, options, to, observe, bool(hints), wrong_table=wrong_table, gross=beyond.rows)
        del states  # of a long table they are large
        fit = robust_fit.robust.fit
        s = replace(s, problem=s.problem.without(fit.failed))
        if s.apart is None:
            scheme, used = s.request.holdout, s.request.fit_options
            asked = s.request.accept or scheme is not None
            useful = asked or not (hints or implausible(s.problem, robust_fit))
            held = held_out(s.problem, s.measured, robust_fit, scheme, used, observe, useful=useful)
        else:
            held = validated(s.loaded, s.problem, fit, s.apart)
    doubts = noise_doubts(s.problem, fit, s.measured, to)
    mistakes = (*hints, *doubts.commanded, *s.start.doubts(s.determined))
    made = s.loaded.machine, s.problem, robust_fit, held, row_origin, replace(odd, overstated=doubts.overstated)
    return Calibrated(s, CalibrationReport(*made, mistakes=mistakes, accepted=s.request.accept))


def _say_of_files(s: CalibrationSetting, to: Listener) -> None:
    """Tell what there is to say of what was read."""
    to.notes([*s.measured.notes, *unsided(s.problem, s.measured)])
    for finding in (*s.loaded.warnings, *s.measured.warnings):
        to.warn(finding)
    for text in s.start.remarks(bool(s.measured.named_sessions), s.determined):
        to.warn(text)


def parameter_head(calibrated: Calibrated, **more: object) -> dict[str, Any]:
    """Provenance of the parameters of a calibration; more: what it says besides."""
    request = calibrated.setting.request
    how = {} if request.method == "exact" else {"method": request.method}
    doubts = provenance_of_doubts(calibrated.report.implausible, request.accept)
    status, dated = calibrated.report.status, calibrated.setting.measured.dated
    return provenance(calibrated.setting.inputs, seed=None, status=status, **dated, **how, **doubts, **more)


def parameter_text(calibrated: Calibrated, **more: object) -> str:
    """Text of the parameter file of a calibration; more: what its provenance says besides."""
    return calibrated.report.parameter_file(parameter_head(calibrated, **more))


def _after(
    request: CalibrationRequest, file: str, problem: Problem, selected: tuple[str, ...], start: Start
) -> tuple[Problem, Start, EarlierCalibration]:
    """Problem and start with what an earlier calibration knows, and that. Raises BadInput and UsageError."""
    earlier = earlier_calibration(problem.model, file, selected, request.select == "auto", request.loosen, start.values)
    notes = (*earlier.known.ending.remarks(file), *earlier.warnings, *(f"note: {text}" for text in earlier.notes))
    values = earlier.values if request.parameters is None else start.values
    start = replace(start, values=values, inputs=start.inputs | earlier.inputs, warnings=start.warnings + notes)
    return replace(problem, prior=earlier.prior), start, earlier


def _determined(s: CalibrationSetting, states: WarmStart, to: Listener) -> CalibrationSetting:
    """The setting without the parameters that are held as datum. Raises BadInput for data that determine too little."""
    asked = determined(s.loaded.model.name, s.problem, s.start.values, s.selected, states)
    for line in asked.notes:
        to.say(line)
    problem, datum = asked.of(s.problem, s.start.values), with_held(asked.datum, s.kept)
    return replace(s, problem=problem, selected=asked.selected, datum=datum)


def _apart(loaded: LoadedMachine, measured: Measurements, file: str) -> Measurements:
    """The rows of a file that is held out. Raises BadInput, and UsageError for rows that are fitted."""
    other = load_measurements(loaded, [file])
    if set(other.sha256) & set(measured.sha256):
        raise UsageError(f"--holdout: the rows of `{file}` are fitted", hint="give another file, or a number of folds")
    return other


def _fit(
    s: CalibrationSetting,
    states: WarmStart,
    options: FitOptions,
    to: Listener,
    observe: Observer,
    in_doubt: bool,
    *,
    wrong_table: bool,
    gross: tuple[int, ...],
) -> Calibration:
    try:
        calibration = calibrated(
            s.problem, s.selected, start=s.start.values, options=options, session=np.asarray(s.measured.session),
            datum=s.datum, states=states, tell=to.say, observe=observe, steps=_STEPS_IN_DOUBT if in_doubt else STEPS,
            wrong_table=wrong_table, gross=gross,
        )  # fmt: skip
    except RowsFailed as failure:
        raise unsolved(s.measured, failure.evaluation.prediction) from None
    if calibration.agreement is not None:
        to.say(calibration.agreement.text)
    return calibration
