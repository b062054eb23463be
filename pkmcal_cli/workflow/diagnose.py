"""Diagnosis from files to tables and JSON."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from pkmcal_cli.base.errors import BadInput, Location, UsageError
from pkmcal_cli.base.files import is_stream
from pkmcal_cli.base.outputs import check_folder
from pkmcal_cli.base.plural import count
from pkmcal_cli.calibration.identify import RowsFailed
from pkmcal_cli.calibration.measured_problem import problem_of
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.selection import select
from pkmcal_cli.diagnosis.hypotheses import Candidates, candidates
from pkmcal_cli.diagnosis.run_diagnosis import Diagnosis, Verdict, diagnose
from pkmcal_cli.gross_errors.hints import absurd_rows, copied_rows, measurement_hints, nothing_measured
from pkmcal_cli.loading.covariates import derived_directions
from pkmcal_cli.loading.load_machine import LoadedMachine, load_machine, load_measurements
from pkmcal_cli.loading.poses import place_of
from pkmcal_cli.report.console import Reporter, emit_json
from pkmcal_cli.report.diagnosis import DiagnosisReport
from pkmcal_cli.report.loads import Loads
from pkmcal_cli.report.provenance import provenance
from pkmcal_cli.tables.measurement_set import Measurements
from pkmcal_cli.workflow.alpha import check_alpha
from pkmcal_cli.workflow.arguments import one_stdin, selection
from pkmcal_cli.workflow.calibrate import unsolved
from pkmcal_cli.workflow.fail_on import failing

FAILING: tuple[Verdict, ...] = ("found", "ambiguous", "unknown", "measurement_fault", "sigma_too_small")
FEWEST_ROWS = 8  # with fewer, no effect is told from noise


@dataclass(frozen=True, kw_only=True)
class DiagnosisRequest:
    """The arguments of `diagnose`."""

    machine: str
    measurements: tuple[str, ...]
    select: str
    alpha: float
    seed: int
    plots: str | None
    fail_on: str | None
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
    hints: tuple[str, ...]  # at gross mistakes

    @property
    def inputs(self) -> dict[str, str]:
        """sha256 by name of all that was read."""
        return self.loaded.inputs | self.measured.inputs


def prepare(machine: str, measurements: tuple[str, ...], text: str, to: Reporter, fewest: int = FEWEST_ROWS) -> Case:
    """Read the files and gather the hypotheses; the table needs some rows. Raises PkmcalError."""
    one_stdin(machine, *measurements)
    loaded = load_machine(machine, receptive=True)
    selection(loaded.model, text)
    measured = load_measurements(loaded, measurements)
    model = loaded.model.for_sessions(measured.sessions)
    selected = selection(model, text)
    candidates_ = candidates(model, select(model, text), measured)
    problem = problem_of(candidates_.model, measured)
    if not problem.count:
        raise BadInput([nothing_measured(loaded, problem)])
    _enough(problem, measured, selected, fewest)
    if absurd := absurd_rows(problem, lambda row: place_of(measured, row)):
        raise BadInput(absurd)
    to.notes(measured.notes)
    for gap in _gaps(measured):
        to.warn(f"warning: {gap}")
    for fault in (*loaded.warnings, *measured.warnings):
        to.warn(fault.text())
    hints = measurement_hints(loaded, problem, candidates_.model.nominal, measured)
    for hint in (*hints, *copied_rows(problem, measured)):
        to.warn(f"warning: {hint}")
    if derived := derived_directions(measured, [a.name for a in loaded.model.actuators]):
        to.notes([f"direction of {', '.join(derived)}: taken from the order of the rows"])
    return Case(loaded, measured, candidates_, problem, selected, hints)


def _enough(problem: Problem, measured: Measurements, selected: tuple[str, ...], fewest: int) -> None:
    """Raises BadInput where the table has too few rows, or no more values than parameters."""
    rows = int(problem.measured.any(axis=1).sum())
    if rows >= fewest and problem.count > len(selected):
        return
    what = f"too few measurements to find an effect: {count(rows, 'row')}, {count(problem.count, 'measured value')}"
    hint = f"measure {fewest} rows or more, and more values than the {len(selected)} parameters"
    hint += ", or name what to look for (`--only`)" if rows >= FEWEST_ROWS < fewest else ""
    raise BadInput.single(what, Location(measured.files[0]), hint, "measurements")


def _gaps(measured: Measurements) -> list[str]:
    """Columns with holes, which effects cannot use."""
    out = []
    for name, values in measured.covariates.items():
        empty = int(np.isnan(values).sum())
        if 0 < empty < len(values) and not name.startswith("dir."):
            out.append(
                f"column `{name}` is empty in {empty} of {len(values)} rows: effects that need it are not tested"
            )
    return out


def run_diagnosis(request: DiagnosisRequest) -> int:
    """Diagnose and show; returns the exit code. Raises PkmcalError."""
    check_alpha(request.alpha)
    fails_on = failing(request.fail_on, FAILING)
    if request.plots is not None and is_stream(request.plots) and request.quiet:
        raise UsageError("--plots - draws on the terminal, but -q suppresses it", hint="write files with `--plots DIR`")
    if request.plots is not None and not is_stream(request.plots):
        from pkmcal_cli.report.pictures import check_library

        check_folder(request.plots)
        check_library()
    to = Reporter(request.quiet)
    case = prepare(request.machine, request.measurements, request.select, to)
    diagnosis = diagnosed(case, request.alpha, request.seed)
    report = DiagnosisReport(case.loaded.machine, case.measured, diagnosis)
    report.show(to)
    Loads.of_fit(diagnosis.search.problem, diagnosis.search.fit, partial(place_of, case.measured)).show(to)
    _draw(request, case, diagnosis, to)
    if request.as_json:
        emit_json(report.json() | {"provenance": _origin(case)})
    failed = diagnosis.verdict in fails_on
    if request.quiet and failed:
        to.fail(report.verdict_line())
    return int(failed)


def _origin(case: Case) -> dict[str, Any]:
    """Versions and inputs; no time and no command line, so that the same data give the same bytes."""
    return {k: v for k, v in provenance(case.inputs).items() if k not in ("created", "arguments")}


def _draw(request: DiagnosisRequest, case: Case, diagnosis: Diagnosis, to: Reporter) -> None:
    """Pictures as files, or as text where they are asked for on the terminal. Raises UsageError, OutputError."""
    if request.plots is None:
        return
    if is_stream(request.plots):
        from pkmcal_cli.report.text_pictures import text_pictures

        to.say(text_pictures(diagnosis))
        return
    from pkmcal_cli.report.pictures import write_pictures

    for file in write_pictures(request.plots, case.loaded.machine, diagnosis, case.inputs):
        to.say(f"written: {file}")


def diagnosed(case: Case, alpha: float, seed: int) -> Diagnosis:
    """The diagnosis of a case. Raises BadInput for rows that cannot be predicted."""
    try:
        return diagnose(case.candidates, case.problem, case.selected, alpha, seed)
    except RowsFailed as failure:
        raise unsolved(case.measured, failure.evaluation.prediction) from None
