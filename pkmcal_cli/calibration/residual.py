"""Measured minus predicted, whitened by the covariance of each row.

Drives are instruments too (Wampler, Hollerbach, Arai 1995): a drive's reading q has an error of its own, `shift`, that
is estimated with the parameters (errors in variables). Linearised at q + shift, a row's residual is
r + (dy/dq) shift and its covariance S_y + (dy/dq) S_q (dy/dq)^T. So it does not matter which drives of a redundant
machine are taken as inputs.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from pkmcal_cli.base.rotation import Array, other_way_round
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.whitening import Index, Slopes, Whitened, whiten
from pkmcal_cli.prediction import Prediction, Request, WarmStart
from pkmcal_cli.prediction.differences import predict_with_derivatives


@dataclass(frozen=True)
class Evaluation:
    """Residuals (N, C) at values (P,) and drive errors (N, A): 0 where nothing was measured, nan where not
    predicted.
    """

    values: Array
    shift: Array
    residual: Array
    prediction: Prediction
    parameters: tuple[str, ...] = ()  # by which there are derivatives

    @property
    def solved(self) -> bool:
        """Whether all that was measured is predicted."""
        return bool(np.isfinite(self.residual).all())

    @property
    def start(self) -> WarmStart:
        """States of all rows, where the next evaluation may start."""
        return self.prediction.start


def evaluate(
    problem: Problem,
    values: Array,
    parameters: tuple[str, ...] | None = None,
    start: WarmStart | None = None,
    shift: Array | None = None,
    compare: bool = True,
) -> Evaluation:
    """Residuals at `values`, with derivatives with respect to `parameters` and drives where these are asked.

    `shift` (N, A): errors of the drive readings, m or rad, by default zero; `compare`: see `Request`.
    """
    request = Request(problem.method, parameters=parameters, by_drive=parameters is not None, compare=compare)
    shift = np.zeros_like(problem.rows.readings) if shift is None else shift
    measured = np.where(problem.measured, problem.readings, np.nan)
    rows = replace(problem.rows.moved(shift), measured=measured)
    prediction = predict_with_derivatives(problem.model, values, rows, request, start)
    return Evaluation(values, shift, residuals(problem, prediction.values), prediction, parameters or ())


def lost_rows(problem: Problem, evaluation: Evaluation) -> Index:
    """Rows that are not predicted though something was measured in them, or from another row to them."""
    short = np.asarray((problem.measured & ~np.isfinite(evaluation.residual)).any(axis=1))
    partner = problem.rows.partner
    if partner is not None:
        short[partner[short & (partner >= 0)]] = True
    return np.nonzero(short & ~evaluation.prediction.solved)[0]


def reasons(problem: Problem, evaluation: Evaluation) -> dict[int, str]:
    """Why each of these rows is not predicted."""
    return {int(row): evaluation.prediction.reason(int(row)) for row in lost_rows(problem, evaluation)}


def predicted_part(problem: Problem, evaluation: Evaluation) -> tuple[Problem, Evaluation]:
    """Both without what was measured and is not predicted, so that no linear step sees a nan; themselves if all is."""
    if evaluation.solved:
        return problem, evaluation
    on = problem.measured & np.isfinite(evaluation.residual)
    return replace(problem, measured=on), replace(evaluation, residual=np.where(on, evaluation.residual, 0.0))


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


@dataclass(frozen=True, kw_only=True)
class Linearised:
    """A problem near one evaluation: whitened residuals (N * C + k,) and Jacobian (N * C + k, P'), the drives' part.

    The last k are what is known of the parameters besides.

    chi2: sum of squares of the readings' and the drives' errors in standard uncertainties. The drive errors that
    belong to a parameter step d are `kept + drives @ (whitened residual - jacobian d)` by row, or by joined rows.
    """

    residual: Array
    jacobian: Array
    drives: tuple[tuple[Index, Array], ...]  # rows (M, k) and S_q G^T W^T (M, k A, k C)
    kept: Array  # (N, A)
    chi2: float
    least: float  # share of chi2 that no step removes
    known: int = 0  # equations that are no readings
    root: Array | None = None  # (N, C) square roots of the weights, None for 1

    @property
    def values(self) -> tuple[Array, Array]:
        """Residuals (N * C,) and Jacobian (N * C, P') of the readings alone."""
        count = len(self.residual) - self.known
        return self.residual[:count], self.jacobian[:count]

    @property
    def besides(self) -> tuple[Array, Array]:
        """Errors (k,) and derivatives (k, P') of what is known of the parameters besides."""
        count = len(self.residual) - self.known
        return self.residual[count:], self.jacobian[count:]

    def shift(self, step: Array) -> Array:
        """Drive errors (N, A) after the parameter step (P',), SI."""
        out = self.kept.copy()
        count = len(self.residual) - self.known
        residual = (self.residual - self.jacobian @ step)[:count].reshape(len(out), -1)
        if self.root is not None:  # the drives' errors are those without weights
            residual = residual / self.root
        for cluster, drives in self.drives:
            m, k = cluster.shape
            moved = drives @ residual[cluster].reshape(m, -1, 1)
            out[cluster] += moved.reshape(m, k, -1)
        return out

    def expected(self, step: Array) -> float:
        """Chi-square after the parameter step (P',) if the prediction were linear; no less with damping."""
        return float(((self.residual - self.jacobian @ step) ** 2).sum()) + self.least


def linearise(problem: Problem, evaluation: Evaluation, damping: float = 0.0) -> Linearised:
    """Whiten an evaluation with derivatives by W with W^T W = (S_y + G S_q G^T)^-1, G = dy/dq.

    Values that are not predicted are left out. `damping` holds the drive errors where they are, with this weight in
    their standard uncertainties: the problem is then that with S_q / (1 + damping) about damping / (1 + damping) of the
    present errors.
    """
    problem, evaluation = predicted_part(problem, evaluation)
    prediction = evaluation.prediction
    assert prediction.by_drive is not None and prediction.jacobian is not None
    free = 1.0 / (1.0 + damping)
    residual = np.zeros(problem.readings.shape)
    jacobian = np.zeros(prediction.jacobian.shape)
    moved = np.where(problem.measured[:, :, None], prediction.jacobian, 0.0)
    drives = []
    for part, whitened in _whitened(problem, evaluation, free):
        residual[part.cluster] = whitened
        jacobian[part.cluster] = part.apply(moved)
        drives.append((part.cluster, part.drives))
    root = None if problem.weight is None else np.sqrt(problem.weight)
    if root is not None:
        residual *= root
        jacobian *= root[..., None]
    flat = jacobian.reshape(problem.readings.size, prediction.jacobian.shape[2])
    errors, columns = _known(problem, evaluation)
    return Linearised(
        residual=np.concatenate([residual.ravel(), errors]),
        jacobian=np.vstack([flat, columns]),
        drives=tuple(drives),
        kept=(1.0 - free) * evaluation.shift,
        chi2=chi_square(problem, evaluation),
        least=(1.0 - free) * _drive_chi_square(problem, evaluation),
        known=len(errors),
        root=root,
    )


def _known(problem: Problem, evaluation: Evaluation) -> tuple[Array, Array]:
    """Errors (k,) and derivatives (k, P') of what is known besides the readings."""
    if problem.prior is None:
        return np.zeros(0), np.zeros((0, len(evaluation.parameters)))
    columns = problem.prior.columns(evaluation.parameters)
    return problem.prior.errors(problem.model, evaluation.values), columns


def linearise_at(problem: Problem, values: Array, parameters: tuple[str, ...], start: WarmStart | None) -> Linearised:
    """The problem linearised at parameter values (P,), without drive errors."""
    return linearise(problem, evaluate(problem, values, parameters, start))


def chi_square(problem: Problem, evaluation: Evaluation) -> float:
    """Sum of squares of reading errors, drive errors and errors of what is known, each in its standard uncertainty."""
    known = 0.0 if problem.prior is None else float((problem.prior.errors(problem.model, evaluation.values) ** 2).sum())
    residual = evaluation.residual
    if problem.weight is not None:
        return known + _weighted_chi_square(problem, evaluation)
    if problem.model.correlated:
        white = np.linalg.solve(problem.noise, residual[..., None])[..., 0]
    else:
        white = np.where(problem.measured, residual / np.where(problem.measured, problem.sigma, 1.0) ** 2, 0.0)
    return known + float((residual * white).sum()) + _drive_chi_square(problem, evaluation)


def _weighted_chi_square(problem: Problem, evaluation: Evaluation) -> float:
    """Of whitened readings with weights; drive errors are those that suit them best."""
    prediction = evaluation.prediction
    if prediction.by_drive is None or not evaluation.solved:
        return float("inf")
    white = whitened_residual(problem, evaluation)
    assert problem.weight is not None
    return float((problem.weight * white**2).sum())


def whitened_residual(problem: Problem, evaluation: Evaluation) -> Array:
    """Residuals (N, C) in standard uncertainties, of an evaluation with derivatives by drives; without weights."""
    out = np.zeros(problem.readings.shape)
    for part, residual in _whitened(*predicted_part(problem, evaluation), 1.0):
        out[part.cluster] = residual
    return out


def weighted_residual(problem: Problem, evaluation: Evaluation) -> Array:
    """The same with the weights of a robust fit."""
    white = whitened_residual(problem, evaluation)
    return white if problem.weight is None else np.asarray(white * np.sqrt(problem.weight))


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
    for part, residual in _whitened(problem, evaluation, 1.0):
        m, k = part.cluster.shape
        size = np.sqrt((part.weights**2).sum(axis=1))  # (M, k C)
        size = np.where(size > 0, size, 1.0)
        unit[part.cluster] = 1.0 / size.reshape(m, k, -1)
        rotated = np.swapaxes(part.weights / size[:, None], 1, 2)
        off[part.cluster] = (rotated @ residual.reshape(m, -1, 1)).reshape(m, k, -1)
        flat = part.apply(moved).reshape(m, rotated.shape[1], -1)
        slopes[part.cluster] = (rotated @ flat).reshape(m, k, *moved.shape[1:])
    return off, slopes, unit


def _whitened(problem: Problem, evaluation: Evaluation, free: float) -> Iterator[tuple[Whitened, Array]]:
    """Weights of all clusters of rows, and residuals W (r + G shift), (M, k, C); `free`: share of S_q that is left."""
    prediction = evaluation.prediction
    assert prediction.by_drive is not None
    slopes = Slopes(np.nan_to_num(prediction.by_drive), prediction.by_partner, problem.rows.partner)
    sigma = problem.reading_sigma * np.sqrt(free)  # (N, A)
    for part in whiten(problem.clusters, slopes, problem.noise, sigma, problem.measured):
        m, k = part.cluster.shape
        back = part.slopes @ (free * evaluation.shift)[part.cluster].reshape(m, -1, 1)
        residual = evaluation.residual[part.cluster].reshape(m, -1, 1) + back
        yield part, (part.weights @ residual).reshape(m, k, -1)


def _drive_chi_square(problem: Problem, evaluation: Evaluation) -> float:
    sigma = problem.reading_sigma
    drive = np.where(sigma > 0, evaluation.shift / np.where(sigma > 0, sigma, 1.0), 0.0)
    return float((drive**2).sum())
