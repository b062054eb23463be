"""Measured minus predicted; turns by the shorter way."""

from __future__ import annotations

import numpy as np

from pkmcal_cli.base.rotation import Array, other_way_round
from pkmcal_cli.calibration.problem import Problem


def residuals(problem: Problem, predicted: Array) -> Array:
    """Measured minus predicted (N, C), zero where not measured, nan where not predicted; turns by the shorter way."""
    model, measured = problem.model, problem.readings.copy()
    for sensor in model.sensors:
        rotating = [channel for channel, _ in sensor.rotates]
        read, there = measured[:, rotating], predicted[:, rotating]
        near = _nearest(read, there, 2 * np.pi)
        if len(rotating) == 3:
            near = np.where(np.isnan(read).any(axis=1, keepdims=True), near, _nearest_rotation(read, there))
        measured[:, rotating] = near
        if sensor.kind.measurand.periodic:
            number = sensor.known["scale"].coefficients[0]
            scale = float(model.topology.coefficients.constants[number])  # rad per unit of the reading
            columns = sensor.channels
            measured[:, columns] = _nearest(measured[:, columns], predicted[:, columns], 2 * np.pi / scale)
    return np.where(problem.measured, np.nan_to_num(measured) - predicted, 0.0)


def _nearest(measured: Array, predicted: Array, period: float) -> Array:
    """Readings less as many periods as bring them nearest to the prediction."""
    return np.asarray(measured - period * np.round((measured - predicted) / period))


def _nearest_rotation(measured: Array, predicted: Array) -> Array:
    """Of the two rotation vectors of one rotation, that nearer to the prediction."""
    other = other_way_round(measured)
    near = ((other - predicted) ** 2).sum(axis=1) < ((measured - predicted) ** 2).sum(axis=1)
    return np.where(near[:, None], other, measured)
