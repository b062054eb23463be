"""One accepted step of a fit, in range units: Levenberg-Marquardt within the directions that the data determine.

Confined to a trust region once a step kept little of its promise, and kept within bounds by an active set; the
drives' errors follow (Ecorchard 2010, eq. 24, with weights).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import compress

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.condensed import condensed, evaluate_condensed
from pkmcal_cli.calibration.identifiability import Directions, directions
from pkmcal_cli.calibration.patience import Patience
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import Evaluation, Linearised, chi_square
from pkmcal_cli.calibration.second_order import SecondOrder
from pkmcal_cli.calibration.trust_region import Region, confined
from pkmcal_cli.prediction import RowLost
from pkmcal_cli.units.measurands import Measurand

_STEP = 1e-8  # converged: the next step would be shorter than this share of the ranges ...
_GAIN = 1e-11  # ... or lower chi-square by less than this share, or by less than rounding
_GAINING, _LITTLE = 8, 0.01  # steps in turn, and what they must gain together, in variances of the noise
_MUCH = 100.0  # damping at which a fit that is far off has lost its way
_CREEPING, _FAR = 8, 1e4  # steps that creep, and chi-square per value, at which a fit leads nowhere
_HEAVY = 1e9  # damping that leaves the drives' errors where they are
_LIGHT = 1e-9  # of damping for parameters, as a share of the largest squared column of the scaled Jacobian
_SHOWN = 1e3  # times rounding that a step must promise to show second derivatives
_ROUNDING = 1e-15  # of a predicted reading, as a share of the machine's size or of the reading


@dataclass(frozen=True)
class Scaled:
    """The selected parameters in range units, relative to their nominal values."""

    index: NDArray[np.intp]
    names: tuple[str, ...]
    ranges: Array
    low: Array
    high: Array
    beside: Array | None = None  # (p, g), see `directions`

    @classmethod
    def of(cls, problem: Problem, selected: tuple[str, ...]) -> Scaled:
        model = problem.model
        index = np.array([model.names.index(n) for n in selected], dtype=np.intp)
        chosen = [model.parameters[k] for k in index]
        low, high = problem.bounds[index].T
        return cls(index, selected, np.array([p.range for p in chosen]), low, high, problem.beside(selected))

    def directions(self, jacobian: Array, free: NDArray[np.bool_]) -> Directions:
        """Of a whitened Jacobian (n, p), for those parameters (p,) that are free."""
        beside = None if self.beside is None else self.beside[free]
        return directions(jacobian[:, free], tuple(compress(self.names, free)), self.ranges[free], beside=beside)


def advance(
    problem: Problem,
    scale: Scaled,
    evaluation: Evaluation,
    near: Linearised,
    region: Region,
    patience: Patience,
    compare: bool = True,
) -> tuple[Evaluation, Region, str]:
    """One accepted step; returns the new evaluation, the region for the next and why to stop, "" to go on.

    region: `Region()` at first; compare: rows in doubt with other assemblies; else chi-square is continuous along the
    step. "step": it would be shorter than matters; "rounding", "gradient", "enough": it could lower chi-square by no
    more than rounding does, by a negligible share, or by what is enough; "no_descent": no step lowers it, as the
    prediction fails there, or none with little damping above the chi-square of `patience`, or steps creep far off.
    """
    place = (near.jacobian * scale.ranges, near.residual)  # (m, p), (m,)
    region, values = region.at(*place), evaluation.values[scale.index]
    full = _step(scale, values, near, near, region.bent)
    blur, lost = _blur(problem, near.chi2), region.creeping >= _CREEPING and near.chi2 > _FAR * problem.count
    little = {"gradient": _GAIN * near.chi2, "rounding": blur, "enough": patience.little(near.chi2, problem.count)}
    if end := _end(full, near.chi2 - near.expected(full * scale.ranges) - region.bent.added(full), little):
        last = _moved(problem, scale, evaluation, near, full, compare)
        return last or evaluation, region, end
    while True:
        damped = condensed(problem, evaluation, region.damping) if region.damping > 0.0 else near
        step = full if region.holds(full) else _step(scale, values, near, damped, region.bent, region)
        if lost or (np.abs(step).max() < _STEP if len(step) else region.damping > _HEAVY):
            return evaluation, region, "no_descent"
        trial = _moved(problem, scale, evaluation, damped, step, compare)
        if trial and (gained := near.chi2 - chi_square(problem, trial)) >= -blur:
            linear = near.chi2 - damped.expected(step * scale.ranges)
            kept = _share(gained, linear - region.bent.added(step))
            if not region.doubts(step, kept):
                region = region.taken(step, kept, gained / near.chi2)
                return trial, region.remembering(step, place, gained, linear, _SHOWN * blur), ""
            region = region.narrowed()
            continue
        region = region.refused(step)
        lost |= near.chi2 > patience.chi2 and region.damping > _MUCH


def creeps(problem: Problem, scale: Scaled, near: Linearised, chi2: Sequence[float]) -> str:
    """Why to stop after steps from values of chi-square on, the last one at `near`: "noise", or "" to go on.

    Where a direction is held that turns on the way, each step finds a little to gain, and they never end.
    """
    if len(chi2) <= _GAINING or chi2[-1 - _GAINING] - chi2[-1] > _LITTLE * chi2[-1] / problem.count:
        return ""
    spectrum = directions(near.jacobian, scale.names, scale.ranges, problem.unseen, scale.beside)
    return "noise" if spectrum.weak.any() else ""


def _share(gained: float, promised: float) -> float:
    """Of what a step promised, what it gained; none where it promised nothing."""
    return gained / promised if promised > 0.0 else 0.0


def _end(step: Array, hoped: float, little: Mapping[str, float]) -> str:
    """Why a fit has converged, "" where it has not: the next step (p,) in ranges, and by how much it lowers chi-square.

    The largest of the limits is the reason, since it was reached first.
    """
    if len(step) and np.abs(step).max() < _STEP:
        return "step"
    reason = max(little, key=lambda name: little[name])
    return reason if hoped <= little[reason] else ""


def _blur(problem: Problem, chi2: float) -> float:
    """Change of chi-square by rounding of the predicted readings."""
    size = np.array(
        [problem.model.length if c.measurand is Measurand.POSITION else 0.0 for c in problem.model.channels]
    )
    size = np.maximum(size, np.abs(np.where(problem.measured, problem.readings, 0.0)).max(axis=0, initial=0.0))
    share = _ROUNDING * np.where(problem.measured, size / problem.sigma, 0.0)
    return float(2.0 * np.sqrt(chi2) * share.max(initial=0.0) + (share**2).sum())


def _moved(
    problem: Problem, scale: Scaled, evaluation: Evaluation, near: Linearised, step: Array, compare: bool
) -> Evaluation | None:
    """The evaluation after a step (p,) in range units, drive errors following; None if anything measured is lost."""
    values = evaluation.values.copy()
    values[scale.index] = np.clip(values[scale.index] + step * scale.ranges, scale.low, scale.high)
    shift = near.shift(step * scale.ranges)
    if near.frames is not None:
        values = near.frames.moved(values, step * scale.ranges)
    try:
        there = evaluate_condensed(problem, values, scale.names, evaluation.start, shift, compare, sparing=True)
    except RowLost:
        return None
    return there if there.solved else None


def _step(
    scale: Scaled,
    values: Array,
    near: Linearised,
    damped: Linearised,
    bent: SecondOrder,
    region: Region | None = None,
) -> Array:
    """Minimum-norm step (p,) in range units within bounds, the directions that `near` determines, and the region."""
    light = 0.0 if region is None else region.damping * _LIGHT * float(np.square(region.size).max(initial=0.0))
    p, r, jacobian = len(values), damped.residual, damped.jacobian * scale.ranges
    if bent.rows is not None:
        jacobian, r = np.vstack([jacobian, bent.rows]), np.concatenate([r, np.zeros(len(bent.rows))])
    step = np.zeros(p)
    if not p:
        return step
    room_down = (scale.low - values) / scale.ranges
    room_up = (scale.high - values) / scale.ranges
    free = np.ones(p, dtype=bool)
    for _ in range(p + 1):
        residual = r - jacobian[:, ~free] @ step[~free]
        spectrum = scale.directions(near.jacobian, free)
        vectors = spectrum.vectors[~spectrum.held]
        step[free] = vectors.T @ _least_squares(jacobian[:, free] @ vectors.T, residual, light)
        if region is not None and region.length(np.where(free, step, 0.0)) > region.radius:
            size = (vectors * np.asarray(region.size)[free]).T
            step[free] = vectors.T @ confined(jacobian[:, free] @ vectors.T, residual, size, region.radius)
        over = free & ((step < room_down - 1e-12) | (step > room_up + 1e-12))
        if not over.any():
            break
        step[over] = np.where(step[over] < 0, room_down[over], room_up[over])
        free &= ~over
    return step


def _least_squares(matrix: Array, right: Array, damping: float) -> Array:
    """Minimum (k,) of |matrix z - right|^2 + damping |z|^2, columns being independent."""
    k = matrix.shape[1]
    if not k:  # which not every LAPACK takes
        return np.zeros(0)
    if damping > 0.0:
        matrix = np.vstack([matrix, np.sqrt(damping) * np.eye(k)])
        right = np.concatenate([right, np.zeros(k)])
    q, upper = np.linalg.qr(matrix)
    return np.asarray(solve_triangular(upper, q.T @ right))
