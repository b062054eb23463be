"""Two models of one machine on the same held-out rows: errors in pairs, and whether they differ."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.complete_fit import FitOptions, refit
from pkmcal_cli.calibration.identify import RowsFailed
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import evaluate

_DRAWS = 4000


def held_out_squares(
    problem: Problem, selected: tuple[str, ...], start: Array, folds: NDArray[np.intp], columns: list[int]
) -> tuple[Array, tuple[str, ...]]:
    """Squared errors (N,) of some channels in rows that were not fitted; nan where nothing was measured or predicted.

    Each of the `folds` (N,) is predicted from a fit of the others, which begins at `start` (P,). Also what became of
    the fits that failed, one by one.
    """
    out, failures = np.full(len(problem), np.nan), list[str]()
    for fold in np.unique(folds):
        inside, outside = np.nonzero(folds == fold)[0], np.nonzero(folds != fold)[0]
        try:
            fit = refit(FitOptions(), problem.take(outside), selected, start)
        except RowsFailed:
            failures.append("reaches too few rows")
            continue
        part = problem.take(inside)
        if not fit.usable:
            failures.append(fit.status.replace("_", " "))
        else:
            errors, on = evaluate(part, fit.values).residual[:, columns], part.measured[:, columns]
            out[inside] = np.where(on.any(axis=1), np.where(on, errors**2, 0.0).sum(axis=1), np.nan)
    return out, tuple(failures)


@dataclass(frozen=True)
class PairedErrors:
    """rms of both over the same rows; difference, second less first, with its 95 % interval; number of rows."""

    first: float
    second: float
    low: float
    high: float
    count: int

    @property
    def better(self) -> int:
        """Which predicts better: 1, 2, or 0 where the rows do not tell."""
        return 1 if self.low > 0 else 2 if self.high < 0 else 0


def paired(first: Array, second: Array, groups: NDArray[np.intp], seed: int = 0) -> PairedErrors:
    """Squared errors (N,) of both, by resampling groups (N,) of rows (repeated poses go together)."""
    both = np.isfinite(first) & np.isfinite(second)
    one, other, group = first[both], second[both], np.unique(groups[both], return_inverse=True)[1].ravel()
    blocks = int(group.max(initial=-1)) + 1
    sums = [np.bincount(group, weights=w, minlength=blocks) for w in (one, other, np.ones(len(one)))]
    rng = np.random.default_rng(seed)
    drawn = rng.integers(blocks, size=(_DRAWS, blocks)) if blocks else np.zeros((1, 0), dtype=np.intp)
    a, b, n = (s[drawn].sum(axis=1) for s in sums)
    with np.errstate(invalid="ignore", divide="ignore"):
        apart = np.sqrt(b / n) - np.sqrt(a / n)
        rms = [float(np.sqrt(x.mean())) if len(x) else float("nan") for x in (one, other)]
    low, high = np.quantile(apart, [0.025, 0.975])
    return PairedErrors(rms[0], rms[1], float(low), float(high), int(both.sum()))
