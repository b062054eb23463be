"""Rows beyond all noise in a table that was fitted by least squares: a reason not to believe the result."""

from __future__ import annotations

from collections.abc import Callable

from pkmcal_cli.calibration.complete_fit import Calibration
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.diagnosis.gross_rows import gross_rows
from pkmcal_cli.loading.poses import Place

_CHANCE, _GROSS = 1e-3, 15.0  # chance, and standard deviations, from which on a row is no noise
_MOST = 0.1  # share of the rows; twice what a diagnosis takes out, since nothing is taken out here
_LISTED = 5


def gross_row_reasons(problem: Problem, calibration: Calibration, place: Callable[[int], Place]) -> tuple[str, ...]:
    """The rows in words; none where a robust loss does without them."""
    fit = calibration.robust.fit
    if fit.status != "converged" or calibration.robust.loss != "squares":
        return ()
    start, states = fit.before.values, fit.before.start
    rows, _ = gross_rows(problem, fit.selected, _CHANCE, 0, _GROSS, start=start, states=states, most=_MOST)
    if not rows:
        return ()
    listed = ", ".join(str(place(row)) for row in rows[:_LISTED])
    more = f" and {len(rows) - _LISTED} more" if len(rows) > _LISTED else ""
    what = "row is" if len(rows) == 1 else "rows are"
    return (f"{len(rows)} {what} far off what the others say: {listed}{more} (`--loss tukey` does without them)",)
