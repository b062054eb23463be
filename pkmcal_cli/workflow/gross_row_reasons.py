"""Rows beyond all noise, found before a table is fitted: a reason not to believe a fit by least squares."""

from __future__ import annotations

from collections.abc import Callable

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.diagnosis.gross_rows import gross_rows
from pkmcal_cli.gross_errors.far_rows import in_a_run
from pkmcal_cli.loading.poses import Place
from pkmcal_cli.prediction import WarmStart

_CHANCE, _GROSS = 1e-3, 15.0  # chance, and standard deviations, from which on a row is no noise
_MOST = 0.1  # share of the rows; twice what a diagnosis takes out, since nothing is taken out here
_LISTED = 5


def rows_beyond_noise(
    problem: Problem, selected: tuple[str, ...], start: Array, states: WarmStart
) -> tuple[int, ...]:
    """Rows that a fit of the others from values (P,) contradicts; `states` of the rows there.

    Found first: a fit that they spoil takes long, and its failure does not show them.
    """
    rows, _ = gross_rows(problem, selected, _CHANCE, 0, _GROSS, start=start, states=states, most=_MOST)
    return rows


def in_words(rows: tuple[int, ...], place: Callable[[int], Place]) -> str:
    """Which rows they are, and the remedy."""
    listed = ", ".join(str(place(row)) for row in rows[:_LISTED])
    more = f" and {len(rows) - _LISTED} more" if len(rows) > _LISTED else ""
    what = "row is" if len(rows) == 1 else "rows are"
    remedy = f"(`--loss tukey` does without them){in_a_run(sorted(rows))}"
    return f"{len(rows)} {what} far off what the others say: {listed}{more} {remedy}"
