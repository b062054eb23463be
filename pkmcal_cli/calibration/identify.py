"""Weighted nonlinear least squares with exact derivatives; what is not seen is not moved.

Each step is the minimum-norm Gauss-Newton step in range units within the directions that the data determine, damped
(Levenberg-Marquardt) where the prediction is not yet linear enough, kept within bounds by an active set (Ecorchard
2010, eq. 24, with weights and errors in the drive readings).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..rotation import Array
from .identifiability import Directions, directions
from .residual import Evaluation, Linearised, Problem, chi_square, evaluate, linearise

_STEP = 1e-8  # converged: the next step would be shorter than this share of the ranges ...
_GAIN = 1e-11  # ... or lower chi-square by less than this share
_BIND = 1e-9  # a parameter this near to its bound, in ranges, is on it


@dataclass(frozen=True)
class Fit:
    """Result of an identification.

    values (P,): all parameters, SI; selected: names identified; found: directions at the solution; covariance
    (p, p) of the selected ones, SI, nan where undetermined; chi2 and dof of the weighted residuals; status
    "converged", "not_converged" or "nothing_identifiable"; at_bound: names of selected parameters on a bound.
    """

    values: Array
    selected: tuple[str, ...]
    found: Directions
    covariance: Array
    before: Evaluation
    after: Evaluation
    chi2: float
    dof: int
    status: str
    iterations: int
    at_bound: tuple[str, ...]

    @property
    def std(self) -> Array:
        """Standard uncertainties (p,) of the selected parameters, nan where undetermined."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def chi2_per_dof(self) -> float:
        """Chi-square per degree of freedom; nan without any."""
        return self.chi2 / self.dof if self.dof > 0 else float("nan")


class RowsFailed(Exception):
    """Some rows cannot be predicted at the starting values."""

    def __init__(self, evaluation: Evaluation) -> None:
        super().__init__("rows cannot be predicted")
        self.evaluation = evaluation


@dataclass(frozen=True)
class _Scaled:
    """The selected parameters in range units, relative to their nominal values."""

    index: NDArray[np.intp]
    names: tuple[str, ...]
    ranges: Array
    low: Array
    high: Array

    @classmethod
    def of(cls, problem: Problem, selected: tuple[str, ...]) -> _Scaled:
        model = problem.model
        index = np.array([model.names.index(n) for n in selected], dtype=np.intp)
        chosen = [model.parameters[k] for k in index]
        low = np.array([p.bounds[0] for p in chosen])
        high = np.array([p.bounds[1] for p in chosen])
        return cls(index, selected, np.array([p.range for p in chosen]), low, high)


def identify(
    problem: Problem,
    selected: tuple[str, ...],
    start: Array | None = None,
    iterations: int = 60,
    progress: Callable[[int, float], None] | None = None,
) -> Fit:
    """Identify the selected parameters, from nominal values or `start` (P,). Raises RowsFailed."""
    model = problem.model
    first = evaluate(problem, model.nominal if start is None else start, selected)
    if not first.solved:
        raise RowsFailed(first)
    if not selected or problem.count == 0:
        return _finished(problem, selected, first, first, "nothing_identifiable", 0)
    scale = _Scaled.of(problem, selected)
    now, damping, done = first, 0.0, False
    count = 0
    while count < iterations and not done:
        count += 1
        near = linearise(problem, now)
        now, damping, done = _advance(problem, scale, now, near, damping)
        if progress is not None:
            progress(count, near.chi2)
    status = "converged" if done else "not_converged"
    return _finished(problem, selected, first, now, status, count)


def _advance(
    problem: Problem, scale: _Scaled, now: Evaluation, near: Linearised, damping: float
) -> tuple[Evaluation, float, bool]:
    """One accepted step; returns the new evaluation, the damping for the next and whether it has converged."""
    full = _step(scale, now.values[scale.index], near, 0.0)
    if np.abs(full).max(initial=0.0) < _STEP or near.chi2 - _hoped(scale, near, full) <= _GAIN * near.chi2:
        return _moved(problem, scale, now, near, full), 0.0, True
    for _ in range(25):
        step = full if damping == 0.0 else _step(scale, now.values[scale.index], near, damping)
        trial = _moved(problem, scale, now, near, step)
        if trial.solved:
            gained = near.chi2 - chi_square(problem, trial)
            if gained >= -1e-12 * near.chi2:
                good = gained > 0.5 * (near.chi2 - _hoped(scale, near, step))
                return (
                    trial,
                    (0.0 if damping < _light(near, scale) else (0.1 if good else 1.0) * damping),
                    False,
                )
        damping = max(10.0 * damping, _light(near, scale))
    return now, damping, False


def _hoped(scale: _Scaled, near: Linearised, step: Array) -> float:
    """Chi-square after a step if the prediction were linear."""
    return float(((near.residual - near.jacobian @ (step * scale.ranges)) ** 2).sum())


def _light(near: Linearised, scale: _Scaled) -> float:
    """The smallest damping worth trying."""
    return 1e-5 * _largest(near.jacobian * scale.ranges)


def _largest(matrix: Array) -> float:
    return float((matrix**2).sum(axis=0).max(initial=1e-300))


def _moved(problem: Problem, scale: _Scaled, now: Evaluation, near: Linearised, step: Array) -> Evaluation:
    """The evaluation after a step (p,) in range units, drive errors following."""
    values = now.values.copy()
    values[scale.index] = np.clip(values[scale.index] + step * scale.ranges, scale.low, scale.high)
    return evaluate(problem, values, scale.names, now.state, near.shift(step * scale.ranges))


def _step(scale: _Scaled, values: Array, near: Linearised, damping: float) -> Array:
    """Damped minimum-norm step (p,) in range units within determined directions and bounds."""
    p, r, jacobian = len(values), near.residual, near.jacobian
    step = np.zeros(p)
    room_down = (scale.low - values) / scale.ranges
    room_up = (scale.high - values) / scale.ranges
    free = np.ones(p, dtype=bool)
    for _ in range(p + 1):
        rest = r - jacobian[:, ~free] @ (step[~free] * scale.ranges[~free])
        found = directions(jacobian[:, free], tuple(np.array(scale.names)[free]), scale.ranges[free])
        keep = ~found.null & ~found.weak
        vectors, s = found.vectors[keep], found.singular_values[keep]
        gradient = (jacobian[:, free] * scale.ranges[free]).T @ rest
        step[free] = vectors.T @ ((vectors @ gradient) / (s**2 + damping))
        over = free & ((step < room_down - 1e-12) | (step > room_up + 1e-12))
        if not over.any():
            break
        step[over] = np.where(step[over] < 0, room_down[over], room_up[over])
        free &= ~over
    return step


def _finished(
    problem: Problem, selected: tuple[str, ...], first: Evaluation, last: Evaluation, status: str, count: int
) -> Fit:
    near = linearise(problem, last)
    scale = _Scaled.of(problem, selected)
    values = last.values[scale.index]
    on_bound = (values - scale.low < _BIND * scale.ranges) | (scale.high - values < _BIND * scale.ranges)
    found = directions(near.jacobian, selected, scale.ranges)
    if not len(selected) or not (~found.null & ~found.weak).any():
        status = "nothing_identifiable"
    moved = int((~found.null & ~found.weak).sum()) - int(on_bound.sum())
    names = tuple(n for n, b in zip(selected, on_bound, strict=True) if b)
    return Fit(
        last.values,
        selected,
        found,
        found.covariance(),
        first,
        evaluate(problem, last.values, start=last.state) if last.shift.any() else last,
        near.chi2,
        problem.count - max(moved, 0),
        status,
        count,
        names,
    )
