"""Fits that bad rows do not bend: M-estimation on the whitened residuals of each channel.

Iteratively reweighted least squares. Huber's loss is convex; Tukey's biweight, which leaves gross errors out
altogether, starts at Huber's solution. Where the stated sigma is too small, the scale of a channel is the median
absolute deviation.
"""

from __future__ import annotations

import warnings
from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.special import ndtri

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.condensed import condensed, in_parts
from pkmcal_cli.calibration.deletion import deletion_residuals
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import Evaluation, whitened_residual

Loss = Literal["squares", "huber", "tukey"]
_HUBER, _TUKEY = 1.345, 4.685  # 95 % efficiency with normal noise
_NORMAL_VALUES = 2000
_NORMAL = 1.4826  # standard deviations per median absolute deviation
_STANDSTILL = 1e-3
_ROUNDS = 30
_NO_STEP = 1e-3  # of a mean square: parameters are within some hundredths of their standard uncertainties
_OFF = 3.5  # standard uncertainties from which on a value is told as doubtful
_LEAST = 1e-8  # weight of a value that is left out
NEGLIGIBLE = 10 * _LEAST
_CUT_OFF = 0.1  # weight below which a value pulls as hard wherever it is (Huber), or not at all
_FEWEST = 10  # values of a channel by which its scale is judged


@dataclass(frozen=True, kw_only=True)
class Doubtful:
    """A value that a robust fit weighs down.

    row, channel: where, of each row the channel that is furthest off; off: by how much from what the fit and the other
    readings of its row tell, SI; deviation: the same in standard uncertainties, as its channel scatters; weight: the
    least of its row; leverage: share of the value that the fit would follow; moved: parameter that changes most if the
    value stays with full weight, and by how much, in its standard uncertainties.
    """

    row: int
    channel: int
    off: float
    deviation: float
    weight: float
    leverage: float
    moved: tuple[str, float]


@dataclass(frozen=True)
class RobustFit:
    """A fit, the problem with its weights, and what was weighed down; scale (C,) of the channels in stated sigmas.

    gain: step of the parameters over that of a fit with the same weights (they change with the parameters).
    """

    fit: Fit
    problem: Problem
    doubtful: tuple[Doubtful, ...]
    scale: Array
    loss: Loss = "squares"
    gain: float = 1.0


def plain_fit(problem: Problem, fit: Fit) -> RobustFit:
    """A fit by least squares, with the values that are off by far, which would be weighed down."""
    weighted = replace(problem, weight=np.ones_like(problem.readings))
    if fit.status != "converged":
        return RobustFit(fit, problem, (), np.ones(problem.readings.shape[1]))
    _, scale = _deviations(problem, fit)
    return RobustFit(fit, problem, _doubtful(weighted, fit, scale), scale)


def weights_of(loss: Loss, deviation: Array) -> Array:
    """Weights of deviations in standard uncertainties: 1 near zero."""
    size = np.maximum(np.abs(deviation), 1e-12)
    if loss == "huber":
        return np.minimum(1.0, _HUBER / size)
    return np.maximum((1 - (np.minimum(size, _TUKEY) / _TUKEY) ** 2) ** 2, _LEAST)


def without_weight(problem: Problem, rows: Collection[int]) -> Problem:
    """The problem in which some rows hardly count, but for what was measured on the bench."""
    if not rows:
        return problem
    weight = np.ones_like(problem.readings)
    weight[list(rows)] = _LEAST
    weight[:, problem.once] = 1.0
    return replace(problem, weight=weight)


def without_far_off(problem: Problem) -> Problem:
    """The problem by which a fit follows what changes: values that are far off pull as hard when they are further off.

    By its weight one would go with the slopes of its row, which may be wild where a reading is wrong.
    """
    weight = problem.weight
    return problem if weight is None else replace(problem, weight=np.where(weight < _CUT_OFF, _LEAST, weight))


def identify_robustly(problem: Problem, first: Fit, loss: Loss) -> RobustFit:
    """Identify with a robust loss, from a fit by least squares."""
    fit, weighted, selected, failed = first, problem, first.selected, dict(first.failed)
    scale = np.ones(problem.readings.shape[1])
    for stage in ("huber", "tukey") if loss == "tukey" else ("huber",):
        weight = np.ones_like(problem.readings)
        for _ in range(_ROUNDS):
            white, scale = _deviations(problem, fit)
            fresh = np.where(problem.measured, weights_of(stage, white / scale), 1.0)  # type: ignore[arg-type]
            weighted = replace(problem, weight=fresh)
            fit = identify(weighted, selected, fit.values, shift=fit.shift, states=fit.last.start)
            failed |= fit.failed
            problem, weighted = problem.without(fit.failed), weighted.without(fit.failed)
            change, weight = float(np.abs(fresh - weight).max(initial=0.0)), fresh
            if change < _STANDSTILL:
                break
    if fit.stopped == "no_descent" and _remaining(weighted, fit) < _NO_STEP:
        fit = replace(fit, status="converged", stopped="gradient")
    white, _ = _deviations(problem, fit)
    spread, gain = _efficiency(loss, (white / scale)[problem.measured])
    moved = int((~fit.directions.held).sum())
    freedom = max(problem.count - moved, 1) / max(problem.count, 1)
    size = float((scale**2 * problem.measured.sum(axis=0)).sum() / max(problem.count, 1))
    least, _ = _efficiency(loss, _normal_values())
    spread = size * max(spread / freedom, least)  # never narrower than the stated sigma says
    fit = replace(fit, before=first.before, directions=replace(fit.directions, spread=spread), failed=failed)
    return RobustFit(fit, weighted, _doubtful(weighted, fit, scale), scale, loss, gain)


def _remaining(weighted: Problem, fit: Fit) -> float:
    """By how much a step could still lower chi-square, in mean squares of what is left.

    Where drives have errors, residuals are whitened by what depends on the parameters, and no step sees that.
    """
    near, directions = condensed(weighted, fit.last), fit.directions
    basis, _ = np.linalg.qr(near.jacobian * directions.ranges @ directions.vectors[~directions.held].T)
    return float(((basis.T @ near.residual) ** 2).sum()) / max(fit.chi2 / max(fit.dof, 1), 1.0)


def _deviations(problem: Problem, fit: Fit) -> tuple[Array, Array]:
    """Whitened residuals (N, C) at a fit, and the scale (C,) of each channel, at least 1."""
    white = whitened_residual(problem, fit.last)
    some = np.where(problem.measured, np.abs(white), np.nan)
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        typical = np.nan_to_num(np.nanmedian(some, axis=0))
    many = problem.measured.sum(axis=0) >= _FEWEST  # fewer say nothing of their own scale
    return white, np.where(many, np.maximum(_NORMAL * typical, 1.0), 1.0)


def normal_figures(loss: Loss) -> tuple[float, float]:
    """Of normal noise: the mean weighted square, and variances over those by weights divided by it."""
    z = _normal_values()
    level = float((weights_of(loss, z) * z**2).mean())
    return level, _efficiency(loss, z)[0] / level


def _normal_values() -> Array:
    return np.asarray(ndtri((np.arange(_NORMAL_VALUES) + 0.5) / _NORMAL_VALUES))


def _efficiency(loss: Loss, z: Array) -> tuple[float, float]:
    """Of deviations (n,) in scales: what the variances of the weighted fit must be multiplied by, and its steps.

    mean(w) mean(psi^2) / mean(psi')^2 (Huber 1981, 7.6: the sandwich, averaged) and mean(w) / mean(psi'), of all values
    that have not been left out.
    """
    w = weights_of(loss, z)
    if loss == "huber":
        slope = (np.abs(z) < _HUBER).astype(float)
    else:
        u = np.minimum((z / _TUKEY) ** 2, 1.0)
        slope = (1 - u) * (1 - 5 * u)
    kept = w > NEGLIGIBLE
    if not kept.any() or slope[kept].mean() <= 0:
        return 1.0, 1.0
    psi2, bend = float(((w * z) ** 2)[kept].mean()), float(slope[kept].mean())
    return psi2 * float(w[kept].mean()) / bend**2, float(w[kept].mean()) / bend


def _doubtful(weighted: Problem, fit: Fit, scale: Array) -> tuple[Doubtful, ...]:
    """The audit of every value that is off by more than noise, worst first; of each row what tells most."""
    once: list[Doubtful] = []
    others: list[Doubtful] = []

    def visit(rows: slice, part: Problem, evaluation: Evaluation) -> None:
        for listed, more in zip((others, once), _doubtful_of(part, fit, evaluation, scale, rows.start), strict=True):
            listed += more

    in_parts(weighted, fit.last, visit)
    return tuple(sorted([*others, *once], key=lambda d: -abs(d.deviation)))


def _doubtful_of(
    weighted: Problem, fit: Fit, evaluation: Evaluation, scale: Array, first: int
) -> tuple[list[Doubtful], list[Doubtful]]:
    """Of some rows, numbered from `first` on: of what was measured in them, and of what was measured once."""
    assert weighted.weight is not None
    off, slopes, unit = deletion_residuals(replace(weighted, weight=None), evaluation)
    deviation = np.where(weighted.measured, off / scale, 0.0)
    covariance = replace(fit.directions, spread=1.0).determined_covariance()
    once = np.array([not np.isnan(c.once) for c in weighted.model.channels])  # stands in a row, is none of it
    doubtful_rows: tuple[list[Doubtful], list[Doubtful]] = [], []
    for part, doubtful in zip((~once, once), doubtful_rows, strict=True):
        size = np.where(part, np.abs(deviation), 0.0)
        for row in np.nonzero((size > _OFF).any(axis=1))[0].tolist():
            k = int(size[row].argmax())
            weight = float(weighted.weight[row][weighted.measured[row] & part].min())
            leverage, step = _influence(covariance, slopes[row, k], float(off[row, k]), weight)
            worst = int(np.argmax(np.abs(step))) if len(step) else 0
            moved = (fit.selected[worst], float(step[worst])) if len(step) else ("", 0.0)
            far = float(off[row, k] * unit[row, k])
            doubtful.append(
                Doubtful(
                    row=first + row,
                    channel=k,
                    off=far,
                    deviation=float(deviation[row, k]),
                    weight=weight,
                    leverage=leverage,
                    moved=moved,
                )
            )
    return doubtful_rows


def _influence(covariance: Array, slope: Array, off: float, weight: float) -> tuple[float, Array]:
    """Leverage of a value, and what it changes in standard uncertainties (p,).

    Of one with full weight: by leaving it out; of another: by letting it stay with full weight.
    """
    gain = covariance @ slope
    share = float(slope @ gain)
    std = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    if weight == 1.0:
        return share, gain * off / max(1.0 - share, 1e-3) / std
    grown = 1.0 + (1.0 - weight) * share
    return share / grown, gain * off * (1.0 - weight) / grown / std
