"""Diagnosis from files to tables and JSON."""

from __future__ import annotations

from dataclasses import dataclass

from pkmcal_cli.calibration.identify import RowsFailed
from pkmcal_cli.calibration.residual import Problem, problem_of
from pkmcal_cli.calibration.selection import select
from pkmcal_cli.covariates import derived_directions
from pkmcal_cli.diagnosis.diagnose import Diagnosis, diagnose
from pkmcal_cli.diagnosis.hypotheses import Candidates, candidates
from pkmcal_cli.errors import BadInput, UsageError
from pkmcal_cli.loading import LoadedMachine, load_machine, load_measurements
from pkmcal_cli.poses import place_of
from pkmcal_cli.report.console import Reporter, emit_json
from pkmcal_cli.report.diagnosis import DiagnosisReport
from pkmcal_cli.tables.measurement_set import Measurements
from pkmcal_cli.workflow.arguments import one_stdin, selection
from pkmcal_cli.workflow.calibrate import unsolved
from pkmcal_cli.workflow.hints import absurd_rows, measurement_hints, nothing_measured

MOST_ALPHA = 0.2


@dataclass(frozen=True)
class DiagnosisRequest:
    """The arguments of `diagnose`."""

    machine: str
    measurements: tuple[str, ...]
    select: str
    alpha: float
    seed: int
    as_json: bool
    quiet: bool


@dataclass(frozen=True)
class Case:
    """A machine that takes effects, what was measured on it, and all that may be missing."""

    loaded: LoadedMachine
    measured: Measurements
    candidates: Candidates
    problem: Problem  # of the candidates' model
    selected: tuple[str, ...]


def prepare(machine: str, measurements: tuple[str, ...], text: str, to: Reporter) -> Case:
    """Read the files and gather the hypotheses. Raises PkmcalError."""
    one_stdin(machine, *measurements)
    loaded = load_machine(machine, receptive=True)
    selected = selection(loaded.model, text)
    measured = load_measurements(loaded, measurements)
    found = candidates(loaded.model, select(loaded.model, text), measured)
    problem = problem_of(found.model, measured)
    if not problem.count:
        raise BadInput([nothing_measured(loaded, problem)])
    if absurd := absurd_rows(problem, lambda row: place_of(measured, row)):
        raise BadInput(absurd)
    to.notes(measured.notes)
    for fault in loaded.warnings:
        to.warn(fault.text())
    for hint in measurement_hints(loaded, problem, found.model.nominal):
        to.warn(f"warning: {hint}")
    if derived := derived_directions(measured, [a.name for a in loaded.model.actuators]):
        to.notes([f"direction of {', '.join(derived)}: from the order of the rows"])
    return Case(loaded, measured, found, problem, selected)


def run_diagnosis(request: DiagnosisRequest) -> int:
    """Diagnose and show; returns the exit code. Raises PkmcalError."""
    if not 0 < request.alpha <= MOST_ALPHA:
        raise UsageError(f"--alpha: {request.alpha:g} is no false-alarm rate", hint=f"above 0, at most {MOST_ALPHA}")
    to = Reporter(request.quiet)
    case = prepare(request.machine, request.measurements, request.select, to)
    found = diagnosed(case, request.alpha, request.seed)
    report = DiagnosisReport(case.loaded.machine, case.measured, found)
    report.show(to)
    if request.as_json:
        emit_json(report.json())
    if request.quiet and exit_code(found):
        to.fail(report.verdict_line())
    return exit_code(found)


def diagnosed(case: Case, alpha: float, seed: int) -> Diagnosis:
    """The diagnosis of a case. Raises BadInput for rows that cannot be predicted."""
    try:
        return diagnose(case.candidates, case.problem, case.selected, alpha, seed)
    except RowsFailed as failure:
        raise unsolved(case.measured, failure.evaluation.prediction) from None


def exit_code(found: Diagnosis) -> int:
    """0 for clean, or found and confirmed; 1 for ambiguous, unknown or a fault of the measurement."""
    good = found.verdict == "clean" or (found.verdict == "found" and not any(f.provisional for f in found.findings))
    return 0 if good else 1
