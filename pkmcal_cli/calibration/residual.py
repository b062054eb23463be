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

from pkmcal_cli.base.lean import parts_of
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.misfit import residuals
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.session_frames import FrameSteps
from pkmcal_cli.calibration.triangles import Triangles
from pkmcal_cli.calibration.whitening import Index, Slopes, Whitened, whiten
from pkmcal_cli.prediction import Prediction, Request, WarmStart
from pkmcal_cli.prediction.differences import predict_with_derivatives
from pkmcal_cli.prediction.pipeline import Receiver


@dataclass(frozen=True, kw_only=True)
class Evaluation:
    """Residuals (N, C) at values (P,) and drive errors (N, A): 0 where nothing was measured, nan where not
    predicted. triangles: what a fit needs of the derivatives of a long table, which then are not kept by row; by_frame
    (N, C, L): derivatives by the frames that are eliminated.
    """

    values: Array
    shift: Array
    residual: Array
    prediction: Prediction
    parameters: tuple[str, ...] = ()  # by which there are derivatives
    triangles: Triangles | None = None
    by_frame: Array | None = None

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
    *,
    receive: Receiver | None = None,
    sparing: bool = False,
) -> Evaluation:
    """Residuals at `values`, with derivatives with respect to `parameters` and drives where these are asked.

    `shift` (N, A): errors of the drive readings, m or rad, by default zero; `compare` and `sparing`: see `Request`;
    `receive`: see `predict`. Raises RowLost where it is sparing.
    """
    frames = () if problem.frames is None else problem.frames.shared
    asked = None if parameters is None else (*parameters, *frames)
    by_drive = parameters is not None
    request = Request(
        method=problem.method, parameters=asked, by_drive=by_drive, compare=compare, sparing=sparing
    )  # fmt: skip
    moved = problem.rows if shift is None or not shift.any() else problem.moved(shift)
    every = bool(problem.measured.all())
    rows = replace(moved, measured=problem.readings if every else np.where(problem.measured, problem.readings, np.nan))
    prediction = predict_with_derivatives(problem.model, values, rows, request, start, receive)
    shift = np.broadcast_to(0.0, rows.readings.shape) if shift is None else shift
    residual, by_frame = residuals(problem, prediction.values), None
    if frames and prediction.jacobian is not None:
        jacobian, by_frame = np.split(prediction.jacobian, [len(parameters or ())], axis=2)
        prediction = replace(prediction, jacobian=jacobian)
    return Evaluation(
        values=values,
        shift=shift,
        residual=residual,
        prediction=prediction,
        parameters=parameters or (),
        by_frame=by_frame,
    )


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
    channel: Index  # (N * C + k,) of each equation, -1 for the last k
    frames: FrameSteps | None = None  # how frames follow that are eliminated

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
        if not self.drives:
            return self.kept
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
    problem, evaluation = predicted_part(problem, with_derivatives(problem, evaluation))
    prediction = evaluation.prediction
    assert prediction.by_drive is not None and prediction.jacobian is not None
    free = 1.0 / (1.0 + damping)
    parts = [prediction.jacobian] + ([] if evaluation.by_frame is None else [evaluation.by_frame])
    moved = np.where(problem.measured[:, :, None], np.concatenate(parts, axis=2), 0.0)
    residual, jacobian = np.zeros(problem.readings.shape), np.zeros(moved.shape)
    drives = []
    for part, whitened in whitened_parts(problem, evaluation, free):
        residual[part.cluster] = whitened
        jacobian[part.cluster] = part.apply(moved)
        drives.append((part.cluster, part.drives))
    root = None if problem.weight is None else np.sqrt(problem.weight)
    if root is not None:
        residual *= root
        jacobian *= root[..., None]
    frames = None
    if problem.frames is not None:
        residual, jacobian, frames = problem.frames.eliminated(problem.model, problem.rows, residual, jacobian)
    errors, columns = known_besides(problem, evaluation)
    return Linearised(
        residual=np.concatenate([residual.ravel(), errors]),
        jacobian=np.vstack([jacobian.reshape(residual.size, -1), columns]),
        drives=tuple(drives),
        kept=(1.0 - free) * evaluation.shift,
        chi2=chi_square(problem, evaluation),
        least=(1.0 - free) * _drive_chi_square(problem, evaluation),
        known=len(errors),
        root=root,
        channel=np.append(np.tile(np.arange(len(problem.model.channels)), len(problem)), np.full(len(errors), -1)),
        frames=frames,
    )


def with_derivatives(problem: Problem, evaluation: Evaluation) -> Evaluation:
    """The evaluation with derivatives by row, taken at its states where it has none."""
    if evaluation.triangles is None:
        return evaluation
    return evaluate(problem, evaluation.values, evaluation.parameters, evaluation.start, evaluation.shift, False)


def known_besides(problem: Problem, evaluation: Evaluation) -> tuple[Array, Array]:
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
    if (evaluation.prediction.by_drive is None and evaluation.triangles is None) or not evaluation.solved:
        return float("inf")
    white = whitened_residual(problem, evaluation)
    assert problem.weight is not None
    return float((problem.weight * white**2).sum())


def whitened_residual(problem: Problem, evaluation: Evaluation) -> Array:
    """Residuals (N, C) in standard uncertainties, of an evaluation with derivatives by drives; without weights."""
    out = np.zeros(problem.readings.shape)
    whole = evaluation.triangles is None
    for rows in [slice(0, len(out))] if whole else parts_of(len(out)):
        part, part_evaluation = (problem, evaluation) if whole else _rows_of(problem, evaluation, rows)
        for cluster, residual in whitened_parts(*predicted_part(part, part_evaluation), 1.0):
            out[rows][cluster.cluster] = residual
    return out


def _rows_of(problem: Problem, evaluation: Evaluation, rows: slice) -> tuple[Problem, Evaluation]:
    """Some rows of a long table: its drives have no errors, so derivatives by them do not matter."""
    part, shape = problem.part(rows), problem.rows.readings.shape[1]
    slopes = np.broadcast_to(0.0, (*part.readings.shape, shape))
    prediction = replace(evaluation.prediction, by_drive=slopes)
    shift, residual = evaluation.shift[rows], evaluation.residual[rows]
    return part, replace(evaluation, shift=shift, residual=residual, prediction=prediction)


def weighted_residual(problem: Problem, evaluation: Evaluation) -> Array:
    """The same with the weights of a robust fit."""
    white = whitened_residual(problem, evaluation)
    return white if problem.weight is None else np.asarray(white * np.sqrt(problem.weight))


def whitened_parts(problem: Problem, evaluation: Evaluation, free: float) -> Iterator[tuple[Whitened, Array]]:
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
