"""How large errors of held-out rows are by noise, and by what ranges leave open, if nothing else is wrong.

In a linear model with readings A x + e, e of covariance 1, and offsets x in half ranges, also of covariance 1, readings
that a fit has not seen are off by 1 + A_g (A^T A - A_g^T A_g + 1)^-1 A_g^T: more than 1 + p / n, since poses of a fold
lie outside of the others, and p may be a large share of n (docs/decisions.md).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.condensed import is_long
from pkmcal_cli.calibration.errors_before_after import kinds_of
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import linearise


def held_out_noise(problem: Problem, fit: Fit, labels: NDArray[np.intp]) -> dict[str, float]:
    """Mean square by kind of errors of held-out readings over that of their noise; labels (N,): folds.

    None of a long table, where it is 1.
    """
    if is_long(problem) or not fit.selected:
        return {}
    half = 0.5 * problem.model.ranges[[problem.model.names.index(n) for n in fit.selected]]
    near = linearise(problem, fit.last)
    jacobian = near.jacobian * half
    width = problem.readings.shape[1]
    by_row = jacobian[: len(problem) * width].reshape(len(problem), width, -1)
    whole, more = jacobian.T @ jacobian + np.eye(len(half)), np.zeros(problem.readings.shape)
    for fold in np.unique(labels):
        inside = by_row[labels == fold]
        flat = inside.reshape(-1, len(half))
        spread = np.linalg.solve(whole - flat.T @ flat, flat.T).T.reshape(inside.shape)
        more[labels == fold] = (inside * spread).sum(axis=2)
    return {kind: _ratio(problem, more, columns) for kind, columns in kinds_of(problem.model).items()}


def _ratio(problem: Problem, more: Array, columns: list[int]) -> float:
    """1 and what the others' fit adds (N, C) to the variance, on average of the readings of a kind."""
    weight = np.where(problem.measured, np.nan_to_num(problem.sigma) ** 2, 0.0)[:, columns]
    whole = float(weight.sum())
    return 1.0 + (float((weight * more[:, columns]).sum()) / whole if whole > 0 else 0.0)
