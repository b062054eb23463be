"""Measured minus predicted, whitened by the covariance of each row.

Drives are instruments too (Wampler, Hollerbach, Arai 1995): a drive's reading q has an error of its own, `shift`, that
is estimated with the parameters (errors in variables). Linearised at q + shift, a row's residual is
r + (dy/dq) shift and its covariance S_y + (dy/dq) S_q (dy/dq)^T. So it does not matter which drives of a redundant
machine are taken as inputs.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.calibration.frame_start import with_frames
from pkmcal_cli.covariates import with_covariates, with_directions
from pkmcal_cli.equilibrium.kinematics import State
from pkmcal_cli.model import Model, tcp_model
from pkmcal_cli.prediction import Prediction, Request, Rows, predict
from pkmcal_cli.rotation import Array
from pkmcal_cli.tables.measurement_set import Measurements


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

    @cached_property
    def nominal_poses(self) -> Array:
        """TCP coordinates (N, d) that move independently, at nominal parameters; where these fail, drive readings."""
        model = self.model
        bare = replace(tcp_model(model), effects=())
        names = [k for k, c in enumerate(bare.channels) if c.name in model.independent_coordinates]
        found = predict(bare, model.nominal, self.rows)
        if names and found.solved.all():
            return np.asarray(found.values[:, names])
        held = [a for a, d in enumerate(model.layout.drives) if not d.force_controlled and not d.redundant]
        return np.asarray(self.rows.readings[:, held])

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
    rows = with_directions(with_covariates(rows, measurements), [a.name for a in model.actuators])
    known = ~np.isnan(readings) & ~np.isnan(sigma)
    model = with_frames(model, rows, np.where(known, readings, np.nan))
    return Problem(model, rows, readings, sigma, np.nan_to_num(drive_sigma), known)


def design_problem(model: Model, rows: Rows) -> Problem:
    """A plan without data: every channel with a sigma will be measured in every row."""
    shape = (len(rows), len(model.channels))
    sigma = np.tile([c.sigma for c in model.channels], (len(rows), 1)).reshape(shape)
    drives = np.tile(np.nan_to_num([a.sigma for a in model.actuators]), (len(rows), 1))
    return Problem(model, rows, np.full(shape, np.nan), sigma, drives, ~np.isnan(sigma))


@dataclass(frozen=True)
class Evaluation:
    """Residuals (N, C), zero where nothing was measured, at parameter values (P,) and drive errors (N, A)."""

    values: Array
    shift: Array
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
    problem: Problem,
    values: Array,
    parameters: tuple[str, ...] | None = None,
    start: State | None = None,
    shift: Array | None = None,
) -> Evaluation:
    """Residuals at `values`, with derivatives with respect to `parameters` and drives where these are asked.

    `shift` (N, A): errors of the drive readings, m or rad, by default zero.
    """
    request = Request(parameters=parameters, by_drive=parameters is not None)
    shift = np.zeros_like(problem.rows.readings) if shift is None else shift
    rows = problem.rows.moved(shift)
    prediction = predict(problem.model, values, rows, request, start)
    return Evaluation(values, shift, residuals(problem, prediction.values), prediction)


def residuals(problem: Problem, predicted: Array) -> Array:
    """Measured minus predicted (N, C), zero where not measured; turns compared by the shorter way."""
    measured = problem.readings.copy()
    turning = [k for k, c in enumerate(problem.model.channels) if c.quantity == "orientation"]
    if len(turning) == 3:
        measured[:, turning] = _nearest_turn(measured[:, turning], predicted[:, turning])
    elif problem.model.layout.planar:
        measured[:, turning] -= 2 * np.pi * np.round((measured[:, turning] - predicted[:, turning]) / (2 * np.pi))
    return np.where(problem.measured, np.nan_to_num(measured) - predicted, 0.0)


def _nearest_turn(measured: Array, predicted: Array) -> Array:
    """Of the two rotation vectors of one rotation, that nearer to the prediction."""
    angle = np.sqrt((measured**2).sum(axis=1, keepdims=True))
    with np.errstate(divide="ignore", invalid="ignore"):
        other = np.where(angle > 0, measured * (1 - 2 * np.pi / angle), measured)
    near = ((other - predicted) ** 2).sum(axis=1) < ((measured - predicted) ** 2).sum(axis=1)
    return np.where(near[:, None], other, measured)


@dataclass(frozen=True)
class Linearised:
    """A problem near one evaluation: whitened residuals (N * C,) and Jacobian (N * C, P'), and the drives' part.

    chi2: sum of squares of the readings' and the drives' errors in standard uncertainties. The drive errors that
    belong to a parameter step d are `kept + drives @ (whitened residual - jacobian d)` by row.
    """

    residual: Array
    jacobian: Array
    drives: Array  # (N, A, C) S_q G^T W^T
    kept: Array  # (N, A)
    chi2: float
    least: float  # share of chi2 that no step removes

    def shift(self, step: Array) -> Array:
        """Drive errors (N, A) after the parameter step (P',), SI."""
        rest = (self.residual - self.jacobian @ step).reshape(len(self.drives), -1)
        return np.asarray(self.kept + (self.drives @ rest[..., None])[..., 0])

    def expected(self, step: Array) -> float:
        """Chi-square after the parameter step (P',) if the prediction were linear; no less with damping."""
        return float(((self.residual - self.jacobian @ step) ** 2).sum()) + self.least


def linearise(problem: Problem, evaluation: Evaluation, damping: float = 0.0) -> Linearised:
    """Whiten an evaluation with derivatives by W with W^T W = (S_y + G S_q G^T)^-1, G = dy/dq.

    `damping` holds the drive errors where they are, with this weight in their standard uncertainties: the problem
    is then that with S_q / (1 + damping) about damping / (1 + damping) of the present errors.
    """
    prediction = evaluation.prediction
    assert prediction.by_drive is not None and prediction.jacobian is not None
    free = 1.0 / (1.0 + damping)
    sigma = _reading_sigma(problem) * np.sqrt(free)  # (N, A)
    on = problem.measured[:, :, None]
    by_drive = np.where(on, np.nan_to_num(prediction.by_drive), 0.0)  # (N, C, A)
    spread = by_drive * sigma[:, None, :]
    channels = np.arange(problem.readings.shape[1])
    covariance = spread @ np.swapaxes(spread, 1, 2)
    covariance[:, channels, channels] += np.where(problem.measured, problem.sigma, 1.0) ** 2
    weights = np.linalg.inv(np.linalg.cholesky(covariance)) * np.swapaxes(on, 1, 2)
    residual = evaluation.residual + (by_drive @ (free * evaluation.shift)[..., None])[..., 0]
    jacobian = weights @ np.where(on, prediction.jacobian, 0.0)
    return Linearised(
        (weights @ residual[..., None])[..., 0].ravel(),
        jacobian.reshape(problem.readings.size, jacobian.shape[-1]),
        (sigma**2)[..., None] * np.swapaxes(weights @ by_drive, 1, 2),
        (1.0 - free) * evaluation.shift,
        chi_square(problem, evaluation),
        (1.0 - free) * _drive_chi_square(problem, evaluation),
    )


def linearise_at(problem: Problem, values: Array, parameters: tuple[str, ...], start: State | None) -> Linearised:
    """The problem linearised at parameter values (P,), without drive errors."""
    return linearise(problem, evaluate(problem, values, parameters, start))


def chi_square(problem: Problem, evaluation: Evaluation) -> float:
    """Sum of squares of reading errors and drive errors, each in its standard uncertainty."""
    read = np.where(problem.measured, evaluation.residual / np.where(problem.measured, problem.sigma, 1.0), 0.0)
    return float((read**2).sum()) + _drive_chi_square(problem, evaluation)


def _drive_chi_square(problem: Problem, evaluation: Evaluation) -> float:
    sigma = _reading_sigma(problem)
    drive = np.where(sigma > 0, evaluation.shift / np.where(sigma > 0, sigma, 1.0), 0.0)
    return float((drive**2).sum())


def _reading_sigma(problem: Problem) -> Array:
    """Standard uncertainty of the drive readings (N, A) from that of their travel."""
    slots = problem.model.layout.slots.constants
    gain = np.array([abs(slots[a.gain_slot]) for a in problem.model.actuators])
    return np.asarray(problem.drive_sigma / gain)
