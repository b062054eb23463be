"""Local effects: rows that are off side by side along a drive, such as those on a bump of a guide."""

from __future__ import annotations

import numpy as np
from scipy.special import chdtrc, chdtri

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import linearise_at
from pkmcal_cli.diagnosis.unknown import Unknown
from pkmcal_cli.prediction import WarmStart

_WIDTHS = (0.04, 0.08)  # of a drive's travel in the table
_FEWEST = 5  # rows in a window
_SPARED = 2  # of them the largest, which do not count, or bad rows that happen to be near would make a bump
_CUT = 20.0  # squares count up to so many times the typical one


def local_effects(problem: Problem, values: Array, alpha: float, states: WarmStart | None = None) -> list[Unknown]:
    """Where residuals at parameter values (P,) are large in a short stretch of a drive against all others.

    `problem` has all rows that were measured, also those taken for bad; `states`: near those there.
    """
    channels = problem.readings.shape[1]
    white = linearise_at(problem, values, (), states).values[0].reshape(-1, channels)
    squares = (white**2).sum(axis=1)
    local = []
    drives = zip(problem.model.actuators, problem.rows.readings.T, strict=True)
    axes = [(a.name, q) for a, q in drives if not np.isnan(q).any() and np.ptp(q) > 0]
    for name, q in axes:
        p, low, high = _strongest(q, squares, channels)
        stretch = f"rows at {100 * low:.0f} to {100 * high:.0f} % of the travel of {name}"
        local.append(Unknown("pose", min(p * len(axes), 1.0), float("nan"), f"local: {stretch}"))
    best = min(local, key=lambda u: u.p_value, default=None)
    return [best] if best is not None and best.p_value < alpha else []


def _strongest(q: Array, squares: Array, channels: int) -> tuple[float, float, float]:
    """Smallest p value over windows of a drive's travel, for all of them, and where the window is (shares)."""
    order = np.argsort(q, kind="stable")
    share = (q[order] - q.min()) / np.ptp(q)
    typical = max(float(np.median(squares)) / float(chdtri(channels, 0.5)), 1.0)
    size = np.minimum(squares[order] / typical, _CUT)
    best = (1.0, 0.0, 0.0)
    for width in _WIDTHS:
        last = np.searchsorted(share, share + width, side="right")
        for first, stop in enumerate(last):
            if stop - first >= _FEWEST:
                inside = np.sort(size[first:stop])[:-_SPARED]
                p = float(chdtrc(len(inside) * channels, float(inside.sum()))) * 2 / width
                best = min(best, (p, float(share[first]), float(share[stop - 1])))
    return best
