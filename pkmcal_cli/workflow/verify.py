"""`check M.yaml AFTER.csv -p PARAMS.yaml`: does a second table agree with identified parameters?"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from functools import partial

from pkmcal_cli.base.errors import BadInput, Location, UsageError
from pkmcal_cli.calibration.identify import RowsFailed
from pkmcal_cli.calibration.measured_problem import problem_of
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.unknown_sides import with_unknown_sides
from pkmcal_cli.calibration.verification import Known, judged, own_of, verified
from pkmcal_cli.gross_errors.hints import unsided
from pkmcal_cli.loading.evidence import Evidence
from pkmcal_cli.loading.known_parameters import fitted_tables, known_parameters
from pkmcal_cli.loading.load_machine import LoadedMachine, Start
from pkmcal_cli.loading.poses import origin_of
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.report.verification import VerificationReport
from pkmcal_cli.tables.measurement_set import Measurements
from pkmcal_cli.units.dimensions import ANGLE, LENGTH
from pkmcal_cli.units.measurands import Measurand
from pkmcal_cli.units.unit_text import Unit
from pkmcal_cli.workflow.amounts import amount
from pkmcal_cli.workflow.unsolved_rows import unsolved


def verify(
    loaded: LoadedMachine,
    measured: Measurements,
    start: Start,
    parameters: str,
    tolerance: tuple[float, Unit] | None,
    to: Reporter,
    faulty: Collection[int] = (),
) -> VerificationReport:
    """Readings against the parameters of a file, named `parameters`; shown. Raises BadInput and UsageError.

    faulty: rows without a prediction that are shown as faults of the table.
    """
    problem = problem_of(loaded.model, measured)
    on = problem.measured.copy()
    on[:, problem.once] = False  # what was measured on the bench is no reading of this table
    problem = replace(problem, measured=on)
    problem = with_unknown_sides(problem, values=start.values)
    to.notes(unsided(problem, measured))
    for text in start.remarks(bool(measured.named_sessions), own_of(problem.model)):
        to.warn(text)
    if fitted := fitted_tables(known_parameters(parameters), measured.inputs):
        to.warn(f"warning: {', '.join(fitted)}: the calibration was fitted to these rows, so they do not check it")
    if start.covariance is None:
        message = "this parameter file has no `correlations` with `std`, so the uncertainty of predictions is unknown"
        raise BadInput.single(message, Location(parameters), "write it with `pkmcal calibrate -o`", "parameters")
    limit, unit = tolerance or (None, None)
    angle = unit is not None and unit.dimension == ANGLE
    if unit is not None:
        _judges_something(problem, angle)
    left = dict((start.evidence or Evidence({})).unexplained)
    try:
        verification = verified(problem, start.values, Known(*start.covariance, left))
    except RowsFailed as failure:
        raise unsolved(measured, failure.evaluation.prediction) from None
    by_limit = None if limit is None else judged(verification, limit, angle)
    report = VerificationReport(verification, by_limit, unit, partial(origin_of, measured), faulty)
    report.show(to)
    return report


def _judges_something(problem: Problem, angle: bool) -> None:
    """Raises UsageError where a tolerance, a length or an `angle`, is of nothing that was measured."""
    lengths = (Measurand.POSITION, Measurand.DISTANCE)
    there = [
        bool(problem.measured[:, [k for m in kinds for k in problem.model.measuring(m)]].any())
        for kinds in (lengths, (Measurand.ORIENTATION,))
    ]
    if not there[angle]:
        measured, other = ("orientations", '"20 um"') if angle else ("positions or distances", '"10 arcsec"')
        hint = f"give one of what was measured, such as {other}" if there[not angle] else "leave out `--tolerance`"
        raise UsageError(f"--tolerance: no {measured} were measured", hint=hint)


def tolerance_of(text: str | None, angles: bool = False) -> tuple[float, Unit] | None:
    """A tolerance, m, and its unit; `angles`: or rad. Raises UsageError for what is neither, or not positive."""
    if text is None:
        return None
    allowed = (LENGTH, ANGLE) if angles else (LENGTH,)
    words, example = ("length or angle", '"20 um" or "10 arcsec"') if angles else ("length", '"20 um"')
    value, unit = amount("--tolerance", text, fitting=allowed)
    if unit.dimension not in allowed or value <= 0:
        raise UsageError(f"--tolerance: `{text}` is not a positive {words}", hint=f"give one such as {example}")
    return value, unit
