"""Fits that bad rows do not bend: M-estimation on the whitened residuals of each channel.

Iteratively reweighted least squares. Huber's loss is convex; Tukey's biweight, which leaves gross errors out
altogether, starts at Huber's solution. Where the stated sigma is too small, the scale of a channel is the median
absolute deviation.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import linearise, whitened_residual
from pkmcal_cli.rotation import Array

Loss = Literal["squares", "huber", "tukey"]
_HUBER, _TUKEY = 1.345, 4.685  # 95 % efficiency with normal noise
_NORMAL = 1.4826  # standard deviations per median absolute deviation
_SETTLED = 1e-3
_ROUNDS = 30
_OFF = 3.5  # standard uncertainties from which on a value is told as doubtful
_LEAST = 1e-8  # weight of a value that is left out


@dataclass(frozen=True)
class Doubtful:
    """A value that a robust fit weighs down.

    row, channel: where; deviation: whitened residual, in standard uncertainties of its channel as it scatters; weight;
    leverage: share of the value that the fit would follow; moved: parameter that changes most if the value stays with
    full weight, and by how much, in its standard uncertainties.
    """

    row: int
    channel: int
    deviation: float
    weight: float
    leverage: float
    moved: tuple[str, float]


@dataclass(frozen=True)
class RobustFit:
    """A fit, the problem with its weights, and what was weighed down; scale (C,) of the channels in stated sigmas."""

    fit: Fit
    problem: Problem
    doubtful: tuple[Doubtful, ...]
    scale: Array
    loss: Loss = "squares"


def plain_fit(problem: Problem, fit: Fit) -> RobustFit:
    """A fit by least squares, with the values that are off by far, which would be weighed down; spread as chi2 asks."""
    fit = fit.widened
    weighted = replace(problem, weight=np.ones_like(problem.readings))
    if fit.status != "converged" or not fit.after.solved:
        return RobustFit(fit, problem, (), np.ones(problem.readings.shape[1]))
    _, scale = _deviations(problem, fit)
    return RobustFit(fit, problem, _doubtful(weighted, fit, scale), scale)


def weights_of(loss: Loss, deviation: Array) -> Array:
    """Weights of deviations in standard uncertainties: 1 near zero."""
    size = np.maximum(np.abs(deviation), 1e-12)
    if loss == "huber":
        return np.minimum(1.0, _HUBER / size)
    return np.maximum((1 - (np.minimum(size, _TUKEY) / _TUKEY) ** 2) ** 2, _LEAST)


def identify_robustly(problem: Problem, first: Fit, loss: Loss) -> RobustFit:
    """Identify with a robust loss, from a fit by least squares."""
    fit, weighted, selected = first, problem, first.selected
    scale = np.ones(problem.readings.shape[1])
    for stage in ("huber", "tukey") if loss == "tukey" else ("huber",):
        weight = np.ones_like(problem.readings)
        for _ in range(_ROUNDS):
            white, scale = _deviations(problem, fit)
            fresh = np.where(problem.measured, weights_of(stage, white / scale), 1.0)  # type: ignore[arg-type]
            weighted = replace(problem, weight=fresh)
            fit = identify(weighted, selected, fit.values, shift=fit.shift)
            change, weight = float(np.abs(fresh - weight).max(initial=0.0)), fresh
            if change < _SETTLED:
                break
    fit = replace(fit, before=first.before, found=replace(fit.found, spread=_spread(loss, problem, fit, scale)))
    return RobustFit(fit, weighted, _doubtful(weighted, fit, scale), scale, loss)


def _deviations(problem: Problem, fit: Fit) -> tuple[Array, Array]:
    """Whitened residuals (N, C) at a fit, and the scale (C,) of each channel, at least 1."""
    white = whitened_residual(problem, fit.last)
    some = np.where(problem.measured, np.abs(white), np.nan)
    with np.errstate(all="ignore"):
        typical = np.nan_to_num(np.nanmedian(some, axis=0)) if len(some) else np.ones(some.shape[1])
    return white, np.maximum(_NORMAL * typical, 1.0)


def _spread(loss: Loss, problem: Problem, fit: Fit, scale: Array) -> float:
    """What the variances of the weighted fit must be multiplied by (Huber 1981, 7.6: the sandwich, averaged).

    mean(w) mean(psi^2) / mean(psi')^2 times the square of the scale, of all values that have not been left out.
    """
    white, _ = _deviations(problem, fit)
    on = problem.measured
    z = (white / scale)[on]
    w = weights_of(loss, z)
    if loss == "huber":
        slope = (np.abs(z) < _HUBER).astype(float)
    else:
        u = np.minimum((z / _TUKEY) ** 2, 1.0)
        slope = (1 - u) * (1 - 5 * u)
    kept = w > 10 * _LEAST
    psi2 = float(((w * z) ** 2)[kept].mean())
    freedom = max(int(kept.sum()) - len(fit.selected), 1) / max(int(kept.sum()), 1)
    size = float((scale**2 * on.sum(axis=0)).sum() / max(on.sum(), 1))
    return size * psi2 * float(w[kept].mean()) / float(slope[kept].mean()) ** 2 / freedom


def _doubtful(weighted: Problem, fit: Fit, scale: Array) -> tuple[Doubtful, ...]:
    """The audit of every value that is off by more than noise, worst first."""
    assert weighted.weight is not None
    plain = replace(weighted, weight=None)
    near, white = linearise(plain, fit.last), whitened_residual(plain, fit.last)
    covariance = replace(fit.found, spread=1.0).determined_covariance()
    std = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    shape = weighted.readings.shape
    jacobian = near.jacobian[: weighted.readings.size].reshape(*shape, -1)
    found = []
    for row, channel in np.argwhere(weighted.measured & (np.abs(white / scale) > _OFF)):
        a = jacobian[row, channel]
        gain = covariance @ a
        inside = weighted.weight[row, channel] == 1.0  # a part of the fit; else what it would be
        share = float(a @ gain)
        step = gain * white[row, channel] / (max(1.0 - share, 1e-3) if inside else 1.0 + share) / std
        worst = int(np.argmax(np.abs(step))) if len(step) else 0
        leverage = share if inside else share / (1.0 + share)
        moved = (fit.selected[worst], float(step[worst])) if len(step) else ("", 0.0)
        deviation = float(white[row, channel] / scale[channel])
        found.append(Doubtful(int(row), int(channel), deviation, float(weighted.weight[row, channel]), leverage, moved))
    return tuple(sorted(found, key=lambda d: -abs(d.deviation)))
