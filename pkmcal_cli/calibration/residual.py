"""Measured minus predicted, whitened by the covariance of each row.

A row's covariance is S_y + (dy/dq) S_q (dy/dq)^T: drives are instruments too (Wampler, Hollerbach, Arai 1995). With
it, to first order, it does not matter which drives of a redundant machine are taken as inputs.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..equilibrium.kinematics import State
from ..measurement_set import Measurements
from ..model import Model
from ..prediction import Prediction, Request, Rows, predict
from ..rotation import Array


@dataclass(frozen=True)
class Problem:
    """A model and what was measured: readings (N, C), their sigma (N, C) and that of the drives as travel (N, A).

    `measured` (N, C): cells with a number and a known sigma, the only ones that a fit uses.
    """

    model: Model
    rows: Rows
    readings: Array
    sigma: Array
    drive_sigma: Array
    measured: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.readings)

    @property
    def count(self) -> int:
        """Number of measured values."""
        return int(self.measured.sum())

    def take(self, rows: NDArray[np.intp]) -> Problem:
        """Some rows."""
        return replace(
            self,
            rows=self.rows.take(rows),
            readings=self.readings[rows],
            sigma=self.sigma[rows],
            drive_sigma=self.drive_sigma[rows],
            measured=self.measured[rows],
        )


def problem_of(model: Model, measurements: Measurements) -> Problem:
    """Measurements bound to a model; a channel's sigma is the table's where it has one, else the machine's."""
    declared = np.array([c.sigma for c in model.channels]).reshape(1, -1)
    drives = np.array([a.sigma for a in model.actuators]).reshape(1, -1)
    sigma = np.where(np.isnan(measurements.sigma), declared, measurements.sigma)
    drive_sigma = np.where(np.isnan(measurements.actuator_sigma), drives, measurements.actuator_sigma)
    readings = np.asarray(measurements.readings, dtype=float)
    rows = Rows(np.asarray(measurements.actuators, dtype=float), np.asarray(measurements.forces, dtype=float))
    known = ~np.isnan(readings) & ~np.isnan(sigma)
    return Problem(model, rows, readings, sigma, np.nan_to_num(drive_sigma), known)


def design_problem(model: Model, rows: Rows) -> Problem:
    """A plan without data: every channel with a sigma will be measured in every row."""
    shape = (len(rows), len(model.channels))
    sigma = np.tile([c.sigma for c in model.channels], (len(rows), 1)).reshape(shape)
    drives = np.tile(np.nan_to_num([a.sigma for a in model.actuators]), (len(rows), 1))
    return Problem(model, rows, np.full(shape, np.nan), sigma, drives, ~np.isnan(sigma))


@dataclass(frozen=True)
class Evaluation:
    """Residuals (N, C), zero where nothing was measured, at parameter values (P,)."""

    values: Array
    residual: Array
    prediction: Prediction

    @property
    def solved(self) -> bool:
        """Whether every row has numbers."""
        return bool(self.prediction.solved.all())

    @property
    def state(self) -> State:
        """States of all rows, a start for the next evaluation."""
        return self.prediction.state


def evaluate(
    problem: Problem, values: Array, parameters: tuple[str, ...] | None = None, start: State | None = None
) -> Evaluation:
    """Residuals at `values`, with derivatives with respect to `parameters` and drives where these are asked."""
    request = Request(parameters=parameters, by_drive=parameters is not None)
    prediction = predict(problem.model, values, problem.rows, request, start)
    return Evaluation(values, residuals(problem, prediction.values), prediction)


def residuals(problem: Problem, predicted: Array) -> Array:
    """Measured minus predicted (N, C), zero where not measured; rotation vectors compared by the shorter way."""
    measured = problem.readings.copy()
    turning = [k for k, c in enumerate(problem.model.channels) if c.quantity == "orientation"]
    if len(turning) == 3:
        measured[:, turning] = _nearest_turn(measured[:, turning], predicted[:, turning])
    return np.where(problem.measured, np.nan_to_num(measured) - predicted, 0.0)


def _nearest_turn(measured: Array, predicted: Array) -> Array:
    """Of the two rotation vectors of one rotation, that nearer to the prediction."""
    angle = np.sqrt((measured**2).sum(axis=1, keepdims=True))
    with np.errstate(divide="ignore", invalid="ignore"):
        other = np.where(angle > 0, measured * (1 - 2 * np.pi / angle), measured)
    near = ((other - predicted) ** 2).sum(axis=1) < ((measured - predicted) ** 2).sum(axis=1)
    return np.where(near[:, None], other, measured)


def whitening(problem: Problem, evaluation: Evaluation) -> Array:
    """W (N, C, C) with W^T W the inverse covariance of each row's measured channels; zero rows for the others."""
    by_drive = evaluation.prediction.by_drive
    assert by_drive is not None
    gains = _reading_sigma(problem)
    on = problem.measured[:, :, None]
    spread = np.where(on, by_drive * gains[:, None, :], 0.0)  # (N, C, A)
    channels = np.arange(problem.readings.shape[1])
    covariance = spread @ np.swapaxes(spread, 1, 2)
    covariance[:, channels, channels] += np.where(problem.measured, problem.sigma, 1.0) ** 2
    factor = np.linalg.cholesky(covariance)
    return np.asarray(np.linalg.inv(factor) * np.swapaxes(on, 1, 2))


def _reading_sigma(problem: Problem) -> Array:
    """Standard uncertainty of the drive readings (N, A) from that of their travel."""
    slots = problem.model.layout.slots.constants
    gain = np.array([abs(slots[a.gain_slot]) for a in problem.model.actuators])
    return np.asarray(problem.drive_sigma / gain)


def whitened(problem: Problem, evaluation: Evaluation, weights: Array) -> tuple[Array, Array | None]:
    """Whitened residuals (N * C,) and Jacobian (N * C, P') of the prediction."""
    r = (weights @ evaluation.residual[..., None])[..., 0].ravel()
    jacobian = evaluation.prediction.jacobian
    if jacobian is None:
        return r, None
    on = np.where(problem.measured[:, :, None], jacobian, 0.0)
    return r, (weights @ on).reshape(-1, jacobian.shape[-1])
