"""Rows beyond all noise, found before a table is fitted: a reason not to believe a fit by least squares."""

from __future__ import annotations

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.diagnosis.gross_rows import gross_rows
from pkmcal_cli.prediction import WarmStart

_CHANCE, _GROSS = 1e-3, 15.0  # chance, and standard deviations, from which on a row is no noise
_MOST = 0.1  # share of the rows; twice what a diagnosis takes out, since nothing is taken out here


def rows_beyond_noise(
    problem: Problem, selected: tuple[str, ...], start: Array, states: WarmStart
) -> tuple[int, ...]:
    """Rows that a fit of the others from values (P,) contradicts; `states` of the rows there.

    Found first: a fit that they spoil takes long, and its failure does not show them.
    """
    rows, _ = gross_rows(problem, selected, _CHANCE, 0, _GROSS, start=start, states=states, most=_MOST)
    return tuple(sorted(rows))
