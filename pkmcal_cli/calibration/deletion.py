"""What each reading is off by what the others of its row tell, in standard uncertainties."""

from __future__ import annotations

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import Evaluation, predicted_part, whitened_parts


def deletion_residuals(problem: Problem, evaluation: Evaluation) -> tuple[Array, Array, Array]:
    """What each reading is off (N, C) if the others of its row, and of rows joined to it, tell it; without weights.

    In standard uncertainties, zero where not measured: (V^-1 r)_i / sqrt((V^-1)_ii), whatever the order of channels;
    minus its derivatives (N, C, P'); and that standard uncertainty (N, C), 1 / sqrt((V^-1)_ii).
    """
    problem, evaluation = predicted_part(problem, evaluation)
    jacobian = evaluation.prediction.jacobian
    assert jacobian is not None
    moved = np.where(problem.measured[:, :, None], jacobian, 0.0)
    off, unit, slopes = np.zeros(problem.readings.shape), np.ones(problem.readings.shape), np.zeros(moved.shape)
    for part, residual in whitened_parts(problem, evaluation, 1.0):
        m, k = part.cluster.shape
        size = np.sqrt((part.weights**2).sum(axis=1))  # (M, k C)
        size = np.where(size > 0, size, 1.0)
        unit[part.cluster] = 1.0 / size.reshape(m, k, -1)
        rotated = np.swapaxes(part.weights / size[:, None], 1, 2)
        off[part.cluster] = (rotated @ residual.reshape(m, -1, 1)).reshape(m, k, -1)
        flat = part.apply(moved).reshape(m, rotated.shape[1], -1)
        slopes[part.cluster] = (rotated @ flat).reshape(m, k, *moved.shape[1:])
    return off, slopes, unit
