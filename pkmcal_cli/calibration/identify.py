"""Weighted nonlinear least squares with exact derivatives; what is not seen is not moved.

Each step is the minimum-norm Gauss-Newton step in range units within the directions that the data determine, damped
(Levenberg-Marquardt) where the prediction is not yet linear enough, kept within bounds by an active set (Ecorchard
2010, eq. 24, with weights and errors in the drive readings).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identifiability import directions
from pkmcal_cli.calibration.measured_pose import errors_at_poses, loose_drives
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import (
    Evaluation,
    Linearised,
    chi_square,
    evaluate,
    linearise,
    lost_rows,
    reasons,
    residuals,
)
from pkmcal_cli.rotation import Array

_STEP = 1e-8  # converged: the next step would be shorter than this share of the ranges ...
_GAIN = 1e-11  # ... or lower chi-square by less than this share, or by less than rounding
_HEAVY = 1e9  # damping that leaves the drives' errors where they are
_LIGHT = 1e-5  # the smallest damping, as a share of the largest squared column of the scaled Jacobian
_PARTS = (1.0, 0.5, 0.25, 0.0)  # of the way of a row that cannot be solved at the end of it
_LEAD = 30  # steps of a fit of those rows that can be predicted
_ROUNDING = 1e-15  # of a predicted reading, as a share of the machine's size or of the reading
_SPOILT = 100.0  # times chi-square per degree of freedom by which rows out of reach at the start may spoil a fit
_LAST, _LITTLE = 4, 1e-3  # values of chi-square, and the share by which they may differ, at which it has settled
_BIND = 1e-9  # a parameter this near to its bound, in ranges, is on it


class RowsFailed(Exception):
    """Most rows cannot be predicted at the starting values, nor where fits of the others lead."""

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
    shift: Array | None = None,
) -> Fit:
    """Identify the selected parameters, from nominal values or `start` (P,). Raises RowsFailed.

    Rows that cannot be predicted wherever fits of the others lead are left out: `Fit.failed`, less than half of all.
    So are those that can be predicted only where nothing is explained any more.
    `shift`: drive errors (N, A) of an earlier fit, to begin with.
    """
    fit = _identified(problem, selected, start, iterations, progress, shift)
    doubt = reasons(problem, fit.before) if fit.chi2_per_dof > _SPOILT else {}
    if not doubt or doubt.keys() <= fit.failed.keys():
        return fit
    try:
        rest = _identified(problem.without(doubt), selected, start, iterations, progress, None)
    except RowsFailed:
        return fit
    spoilt = rest.status == "converged" and fit.chi2_per_dof > _SPOILT * max(rest.chi2_per_dof, 1.0)
    return replace(rest, before=fit.before, failed={**doubt, **rest.failed}) if spoilt else fit


def _identified(
    problem: Problem,
    selected: tuple[str, ...],
    start: Array | None,
    iterations: int,
    progress: Callable[[int, float], None] | None,
    shift: Array | None,
) -> Fit:
    """The fit of all rows that can be predicted where it leads. Raises RowsFailed."""
    first = evaluate(problem, problem.model.nominal if start is None else start, selected, shift=shift)
    scale = _Scaled.of(problem, selected)
    fixed = problem.count == 0 or not (selected or problem.drive_sigma.any())
    lead = first if fixed or (shift is not None and first.solved) else _led(problem, scale, first)
    failed = reasons(problem, lead)
    kept, now = _kept(problem, first, lead, failed)
    if fixed:
        return _finished(kept, selected, first, now, "nothing_identifiable", 0, failed)
    damping, status, chi2 = 0.0, "", list[float]()
    while len(chi2) < iterations and not status:
        near = linearise(kept, now)
        chi2.append(near.chi2)
        now, damping, status = _advance(kept, scale, now, near, damping)
        if status and not (again := evaluate(kept, now.values, None, now.state, now.shift)).solved:
            failed, status = failed | reasons(kept, again), ""  # a state that does not hold is none
            kept, now = _kept(problem, first, evaluate(problem, now.values, selected, now.state, now.shift), failed)
        if progress is not None:
            progress(len(chi2), near.chi2)
    fit = _finished(kept, selected, first, now, status or "not_converged", len(chi2), failed)
    return replace(fit, flat=_flat([*chi2, fit.chi2]))


def _flat(chi2: Sequence[float]) -> bool:
    """Whether chi-square has hardly changed in the last steps."""
    last = chi2[-_LAST:]
    return len(last) == _LAST and max(last) - min(last) < _LITTLE * min(last)


def _kept(problem: Problem, first: Evaluation, now: Evaluation, failed: Collection[int]) -> tuple[Problem, Evaluation]:
    """The problem without rows that failed, and the evaluation as it is for that.

    Raises RowsFailed with the start's evaluation, `first`, where half of the rows failed, or too few values are left.
    """
    if not failed:
        return problem, now
    kept, shift = problem.without(failed), now.shift.copy()
    if 2 * len(failed) >= int(problem.measured.any(axis=1).sum()) or kept.count < len(now.parameters) <= problem.count:
        raise RowsFailed(first)
    shift[list(failed)] = 0.0
    return kept, replace(now, shift=shift, residual=residuals(kept, now.prediction.values))


def _led(problem: Problem, scale: _Scaled, first: Evaluation) -> Evaluation:
    """Where all rows can be predicted: the start, or where fits of the rows that can be lead to.

    Where these do not lead to more and more rows, the evaluation that has fewest lost rows.
    """
    now = _nearest(problem, scale, first)
    while not now.solved:
        rows = np.nonzero(now.prediction.solved)[0]
        if not len(rows):
            break
        part = problem.take(rows)
        lead, damping, status = evaluate(part, now.values, scale.names, shift=now.shift[rows]), 0.0, ""
        for _ in range(_LEAD if lead.solved else 0):
            lead, damping, status = _advance(part, scale, lead, linearise(part, lead), damping)
            if status:
                break
        further = _nearest(problem, scale, evaluate(problem, lead.values, scale.names))
        if len(lost_rows(problem, further)) >= len(lost_rows(problem, now)):
            break
        now = further
    return now


def _nearest(problem: Problem, scale: _Scaled, plain: Evaluation) -> Evaluation:
    """An evaluation without drive errors, or that with those which put the rows at their measured poses.

    The one that predicts more rows, then the one of lower chi-square.
    """
    seen = np.where(problem.measured, problem.readings, np.nan)
    shift = np.nan_to_num(errors_at_poses(problem, plain.values, seen))
    if not shift.any():
        return plain
    posed = evaluate(problem, plain.values, scale.names, shift=shift)
    if plain.solved and posed.solved:
        return min(plain, posed, key=lambda e: chi_square(problem, e))
    return posed if len(lost_rows(problem, posed)) < len(lost_rows(problem, plain)) else plain


def _advance(
    problem: Problem, scale: _Scaled, now: Evaluation, near: Linearised, damping: float
) -> tuple[Evaluation, float, str]:
    """One accepted step; returns the new evaluation, the damping for the next and the status, "" to go on."""
    full = _step(scale, now.values[scale.index], near, near, 0.0)
    blur = _blur(problem, near.chi2)
    hoped = near.chi2 - near.expected(full * scale.ranges)
    if (len(full) and np.abs(full).max() < _STEP) or hoped <= max(_GAIN * near.chi2, blur):
        last = _moved(problem, scale, now, near, full)
        return (last if last.solved else now), 0.0, "converged"
    light = _LIGHT * float(((near.jacobian * scale.ranges) ** 2).sum(axis=0).max(initial=0.0))
    while True:
        damped, step = near, full
        if damping > 0.0:
            damped = linearise(problem, now, damping)
            step = _step(scale, now.values[scale.index], near, damped, damping * light)
        if np.abs(step).max() < _STEP if len(step) else damping > _HEAVY:
            return now, damping, "not_converged"  # no step of any length lowers chi-square: the prediction fails here
        trial = _moved(problem, scale, now, damped, step)
        if trial.solved:
            gained = near.chi2 - chi_square(problem, trial)
            if gained >= -blur:
                good = gained > 0.5 * (near.chi2 - damped.expected(step * scale.ranges))
                eased = (0.1 if good else 1.0) * damping
                return trial, (eased if eased >= 1.0 else 0.0), ""
        damping = max(10.0 * damping, 1.0)


def _blur(problem: Problem, chi2: float) -> float:
    """Change of chi-square by rounding of the predicted readings."""
    size = np.array([problem.model.length if c.quantity == "position" else 0.0 for c in problem.model.channels])
    size = np.maximum(size, np.abs(np.where(problem.measured, problem.readings, 0.0)).max(axis=0, initial=0.0))
    share = _ROUNDING * np.where(problem.measured, size / problem.sigma, 0.0)
    return float(2.0 * np.sqrt(chi2) * share.max(initial=0.0) + (share**2).sum())


def _moved(problem: Problem, scale: _Scaled, now: Evaluation, near: Linearised, step: Array) -> Evaluation:
    """The evaluation after a step (p,) in range units, drive errors following.

    Rows that cannot be solved there (the drives' ends of reach are near) go to the pose that the linear step aims at,
    or only part of the way, with the drive errors that this pose asks for.
    """
    values = now.values.copy()
    values[scale.index] = np.clip(values[scale.index] + step * scale.ranges, scale.low, scale.high)
    shift = near.shift(step * scale.ranges)
    trial = evaluate(problem, values, scale.names, now.state, shift)
    if trial.solved or not loose_drives(problem).any():
        return trial
    by_step, by_drive = now.prediction.jacobian, now.prediction.by_drive
    assert by_step is not None and by_drive is not None
    way = by_step @ (step * scale.ranges) + (by_drive @ (shift - now.shift)[..., None])[..., 0]
    for part in _PARTS:
        lost = ~np.isfinite(trial.residual).all(axis=1, keepdims=True)
        posed = errors_at_poses(problem, values, now.prediction.values + part * way)
        shift = np.where(lost & ~np.isnan(posed), posed, shift)
        trial = evaluate(problem, values, scale.names, now.state, shift)
        if trial.solved:
            break
    return trial


def _step(scale: _Scaled, values: Array, near: Linearised, damped: Linearised, damping: float) -> Array:
    """Minimum-norm step (p,) in range units within bounds and the directions that `near` determines."""
    p, r, jacobian = len(values), damped.residual, damped.jacobian * scale.ranges
    step = np.zeros(p)
    if not p:
        return step
    room_down = (scale.low - values) / scale.ranges
    room_up = (scale.high - values) / scale.ranges
    free = np.ones(p, dtype=bool)
    for _ in range(p + 1):
        rest = r - jacobian[:, ~free] @ step[~free]
        found = directions(near.jacobian[:, free], tuple(np.array(scale.names)[free]), scale.ranges[free])
        vectors = found.vectors[~found.held]
        step[free] = vectors.T @ _least_squares(jacobian[:, free] @ vectors.T, rest, damping)
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


def _finished(
    problem: Problem,
    selected: tuple[str, ...],
    first: Evaluation,
    last: Evaluation,
    status: str,
    count: int,
    failed: Mapping[int, str],
) -> Fit:
    """What is told of a fit of what is left without rows that failed."""
    near = linearise(problem, last)
    scale = _Scaled.of(problem, selected)
    values = last.values[scale.index]
    on_bound = (values - scale.low < _BIND * scale.ranges) | (scale.high - values < _BIND * scale.ranges)
    found = directions(near.jacobian, selected, scale.ranges, near.known)
    if not len(selected) or found.held.all():
        status = "nothing_identifiable"
    moved = int((~found.held).sum()) - int(on_bound.sum())
    names = tuple(n for n, b in zip(selected, on_bound, strict=True) if b)
    return Fit(
        last.values,
        selected,
        found,
        first,
        evaluate(problem, last.values, start=last.state) if last.shift.any() else last,
        near.chi2,
        problem.count + near.known - max(moved, 0),
        status,
        count,
        names,
        last,
        failed,
    )
