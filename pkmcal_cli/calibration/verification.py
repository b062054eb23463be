"""A second table against what parameters predict: normalised errors, one test of all readings, a tolerance.

An error e = measured - predicted has the variance u_p^2 + u_m^2: of the prediction, by the joint covariance of the
parameters and what the calibration left unexplained, and of the measurement. E_n = |e| / (2 sqrt(u_p^2 + u_m^2))
(ISO 13528; k = 2). All errors together have the covariance S + J Sigma J^T, since errors of parameters are common to
all rows; where an instrument stands anew, its frame is fitted to the rows first, and costs degrees of freedom.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.errors_before_after import kinds_of
from pkmcal_cli.calibration.fitted_frames import frame_parameters
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.point_errors import Judged, K, PointErrors, length_errors, orientation_errors, point_errors
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import Evaluation, evaluate, linearise, lost_rows, reasons
from pkmcal_cli.model.commanded import per_command
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction.unknown_shapes import between_knots
from pkmcal_cli.units.measurands import Measurand

SIGNIFICANT = 0.01
"""Chance of errors so large below which readings and parameters do not agree."""
_RANK = 1e-9
_DETERMINED = 1e-6  # share of a reading that what is fitted leaves, below which it rests on it


@dataclass(frozen=True, kw_only=True)
class Verification:
    """Errors (N, C) of readings and their standard uncertainties by prediction and by measurement, SI; `on` (N, C).

    values (P,): of all parameters, those fitted to these rows among them.

    alone (N, C): errors if what is fitted were fitted to the other rows, inf where it rests on a row alone.
    by_side (N, C): what an unknown side of approach adds, part of by_instrument.
    chi2, dof: of all errors together; refitted: what was fitted to these rows; failed: why rows have no prediction.
    """

    problem: Problem
    values: Array
    on: NDArray[np.bool_]
    errors: Array
    by_model: Array
    by_instrument: Array
    by_side: Array
    alone: Array
    chi2: float
    dof: int
    refitted: tuple[str, ...]
    failed: Mapping[int, str]

    @property
    def p_value(self) -> float:
        """Chance of errors as large if nothing has changed; nan without any degree of freedom."""
        return float(chdtrc(self.dof, self.chi2)) if self.dof > 0 else float("nan")

    @property
    def compatible(self) -> bool:
        """Whether parameters and readings agree, and every row has a prediction."""
        return not self.failed and self.p_value >= SIGNIFICANT

    @property
    def overdetermined(self) -> bool:
        """Whether there are more readings than values that are fitted to them."""
        return self.dof > 0

    @property
    def points(self) -> PointErrors:
        """Errors of points; U includes by how much each would be further off, were it not fitted itself, and what an
        unknown side of approach may add."""
        return self._errors(point_errors)

    @property
    def lengths(self) -> PointErrors:
        """The same of distances, each by itself."""
        return self._errors(length_errors)

    @property
    def orientations(self) -> PointErrors:
        """The same of orientations."""
        return self._errors(orientation_errors)

    def _errors(self, of: Callable[..., PointErrors]) -> PointErrors:
        points = of(self.problem, self.errors, self.on, self.by_side)
        if not self.refitted:
            return points
        more = of(self.problem, np.where(self.on, self.alone, 0.0), self.on).errors - points.errors
        return replace(points, expanded=points.expanded + np.maximum(more, 0.0))

    @property
    def normalised(self) -> Array:
        """E_n (N, C); 0 where nothing was measured."""
        u = K * np.hypot(self.by_model, self.by_instrument)
        return np.divide(np.abs(self.errors), u, out=np.zeros_like(u), where=self.on & (u > 0))


@dataclass(frozen=True)
class Known:
    """How well parameters are known: `covariance` (p, p) of `names`; unexplained: std beyond noise, by kind. SI."""

    names: tuple[str, ...]
    covariance: Array
    unexplained: Mapping[str, float]


def own_of(model: Model) -> tuple[str, ...]:
    """Parameters that rows of a new set-up have for themselves: frames of instruments that stand anywhere, sessions."""
    names = frame_parameters(model)
    free = (p for p in model.parameters if p.identify and not p.fixed)
    return tuple(p.name for p in free if p.name in names or p.session or p.per_session)


def verified(problem: Problem, values: Array, known: Known) -> Verification:
    """Readings against parameter values (P,). Raises RowsFailed where most rows have no prediction."""
    refitted = own_of(problem.model)
    values, failed = _set_up(problem, values, refitted)
    problem = problem.without(failed)
    names = tuple(n for n in known.names if n not in refitted)
    keep = [known.names.index(n) for n in names]
    root = _root(known.covariance[np.ix_(keep, keep)])
    evaluation = evaluate(problem, values, (*refitted, *names))
    problem = problem.without(lost_rows(problem, evaluation))
    left = _unexplained(problem, known.unexplained)
    left = np.hypot(left, np.sqrt(between_knots(problem.model, values, problem.rows, evaluation.start)))
    wider = replace(problem, sigma=np.hypot(problem.sigma, left))
    near = linearise(wider, evaluation)
    frame, moved = near.jacobian[:, : len(refitted)], near.jacobian[:, len(refitted) :] @ root
    basis, response = _fitted(frame)
    residual = near.residual - basis @ (basis.T @ near.residual)
    within = moved - basis @ (basis.T @ moved)
    errors = np.where(problem.measured, evaluation.residual, 0.0)
    chi2 = _chi_square(residual, within)
    by_model = _of_prediction(evaluation, root, len(refitted), response @ moved)
    return Verification(
        problem=problem,
        values=values,
        on=problem.measured,
        errors=errors,
        by_model=np.hypot(by_model, left),
        by_instrument=_of_measurement(problem, evaluation),
        by_side=_of_sides(problem, evaluation),
        alone=_alone(errors, basis, wider.sigma),
        chi2=chi2,
        dof=problem.count - basis.shape[1],
        refitted=refitted,
        failed=failed,
    )


def _set_up(problem: Problem, values: Array, refitted: tuple[str, ...]) -> tuple[Array, Mapping[int, str]]:
    """Values (P,) with what rows have for themselves fitted to them, and why rows have no prediction."""
    if not refitted:
        return values, reasons(problem, evaluate(problem, values))
    index = [problem.model.names.index(n) for n in refitted]
    start = values.copy()
    start[index] = problem.model.nominal[index]
    fit = identify(problem, refitted, start)
    return fit.values, fit.failed


def _root(covariance: Array) -> Array:
    """L (p, k) with L L^T a covariance (p, p)."""
    std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    scale = np.where(std > 0, std, 1.0)
    value, vector = np.linalg.eigh(covariance / np.outer(scale, scale))
    return np.asarray(scale[:, None] * vector * np.sqrt(np.maximum(value, 0.0)))


def _fitted(columns: Array) -> tuple[Array, Array]:
    """Orthonormal basis (n, k) of what is fitted, and the estimator (o, n) of its o parameters."""
    size = np.sqrt((columns**2).sum(axis=0))
    size = np.where(size > 0, size, 1.0)
    u, s, vt = np.linalg.svd(columns / size, full_matrices=False)
    kept = s > _RANK * s.max(initial=0.0)
    return u[:, kept], (vt[kept].T / s[kept]) @ u[:, kept].T / size[:, None]


def _alone(errors: Array, basis: Array, sigma: Array) -> Array:
    """Errors (N, C) if what spans a basis (n, k) of whitened readings were fitted to the other rows; inf for none."""
    count, width = errors.shape
    per_row = basis[: count * width].reshape(count, width, -1)
    left, ways = np.linalg.eigh(np.eye(width) - np.einsum("nck,ndk->ncd", per_row, per_row))
    scale = np.where(np.isfinite(sigma) & (sigma > 0), sigma, 1.0)
    white = np.einsum("ncw,nc->nw", ways, errors / scale) / np.maximum(left, _DETERMINED)
    out = np.einsum("ncw,nw->nc", ways, white) * scale
    held = np.asarray((left > _DETERMINED).all(axis=1))
    return np.where(held[:, None], out, np.inf)


def _chi_square(residual: Array, moved: Array) -> float:
    """r^T (1 + A A^T)^-1 r for residuals r (n,) and A (n, p) (Woodbury)."""
    pulled = moved.T @ residual
    inner = np.eye(len(pulled)) + moved.T @ moved
    return max(float(residual @ residual - pulled @ np.linalg.solve(inner, pulled)), 0.0)


def _of_prediction(evaluation: Evaluation, root: Array, refitted: int, answered: Array) -> Array:
    """Standard uncertainties (N, C) of predicted readings by parameters; `answered` (o, k): how fitted ones follow."""
    jacobian = evaluation.prediction.jacobian
    assert jacobian is not None
    moved = jacobian[..., refitted:] @ root - jacobian[..., :refitted] @ answered
    return np.asarray(np.sqrt((np.nan_to_num(moved) ** 2).sum(axis=2)))


def _of_measurement(problem: Problem, evaluation: Evaluation) -> Array:
    """Standard uncertainties (N, C) of readings, those of the drives' readings included."""
    by_drive = evaluation.prediction.by_drive
    assert by_drive is not None
    drives = np.nan_to_num(by_drive) * problem.reading_sigma[:, None, :]
    return np.where(problem.measured, np.sqrt(problem.sigma**2 + (drives**2).sum(axis=2)), 0.0)


def _of_sides(problem: Problem, evaluation: Evaluation) -> Array:
    """Standard uncertainties (N, C) of readings by drives whose side of approach is unknown."""
    by_drive = evaluation.prediction.by_drive
    assert by_drive is not None
    if problem.side_sigma is None:
        return np.zeros(problem.readings.shape)
    drives = np.nan_to_num(by_drive) * (problem.side_sigma / per_command(problem.model))[:, None, :]
    return np.where(problem.measured, np.sqrt((drives**2).sum(axis=2)), 0.0)


def _unexplained(problem: Problem, left: Mapping[str, float]) -> Array:
    """What a calibration left beyond noise, by the kind of a reading (C,)."""
    out = np.zeros(len(problem.model.channels))
    for kind, columns in kinds_of(problem.model).items():
        out[columns] = left.get(kind, 0.0)
    return out


def judged(v: Verification, tolerance: float, angle: bool = False) -> Judged:
    """Position errors by a tolerance, m: distance of measured from predicted point; without positions, lengths.

    By an angle, rad: orientation errors.
    """
    if angle:
        return Judged(v.orientations, tolerance, len(v.failed), Measurand.ORIENTATION)
    if v.on[:, v.problem.model.measuring(Measurand.POSITION)].any():
        return Judged(v.points, tolerance, len(v.failed))
    return Judged(v.lengths, tolerance, len(v.failed), Measurand.DISTANCE)
