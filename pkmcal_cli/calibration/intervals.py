"""Intervals of 95 %: from the covariance, or from the profile of chi-square.

Profile: a parameter is held at values further and further off, the others fitted again, until chi-square has grown by
the square of 1.96 (times the excess of chi-square); both sides for themselves, so that a bent problem has lopsided
intervals.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.prior import prior_of_held
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import linearise

Method = Literal["linear", "profile", "bootstrap"]
COVER = 1.959963985  # standard uncertainties of a 95 % interval
_TRIALS = 12
_NEAR = 1e-3  # of COVER


@dataclass(frozen=True)
class Intervals:
    """95 % intervals (p, 2) and standard uncertainties (p,) of the selected parameters, SI; nan where undetermined.

    `remark`: what is to be said of them, "" for nothing.
    """

    method: Method
    low_high: Array
    std: Array
    remark: str = ""


def linear_intervals(fit: Fit, index: Array) -> Intervals:
    """Value and 1.96 standard uncertainties; index (p,) of the selected parameters among all."""
    std = fit.std if len(fit.selected) else np.zeros(0)
    values = fit.values[index]
    return Intervals("linear", np.stack([values - COVER * std, values + COVER * std], axis=1), std)


def profile_intervals(problem: Problem, fit: Fit, index: Array) -> Intervals:
    """Where chi-square has grown by 1.96 squared; directions that are held stay as their ranges say."""
    given = problem
    if problem.prior is None and fit.found.held.any():  # a prior of its own leaves no direction to be held
        given = replace(problem, prior=prior_of_held(fit.found, fit.values[index]))
    low_high = np.full((len(fit.selected), 2), np.nan)
    std, spread = fit.std, fit.found.spread
    if given is not problem:  # with what ranges say, the best fit lies elsewhere
        fit = identify(given, fit.selected, fit.values, shift=fit.shift)
        fit = replace(fit, found=replace(fit.found, spread=spread))
    best, wider = linearise(given, fit.last).chi2, _wider(fit)
    for k, name in enumerate(fit.selected):
        if np.isfinite(std[k]):
            ends = [_cross(given, fit, name, sign * float(std[k]), best, wider[k]) for sign in (-1, 1)]
            low_high[k] = np.clip(ends, *problem.model.parameters[index[k]].bounds)
    lost = [
        n for n, ends, s in zip(fit.selected, low_high, std, strict=True) if np.isfinite(s) and np.isnan(ends).any()
    ]
    remark = f"no end of the profile was found for {', '.join(lost)}" if lost else ""
    return Intervals("profile", low_high, (low_high[:, 1] - low_high[:, 0]) / (2 * COVER), remark)


def _wider(fit: Fit) -> Array:
    """By how much intervals (p,) are wider than the growth of chi-square says: data are widened, priors are not."""
    plain = replace(fit.found, spread=1.0).determined_covariance()
    return np.asarray(np.sqrt(np.diag(fit.found.determined_covariance()) / np.diag(plain)))


def _cross(problem: Problem, fit: Fit, name: str, std: float, best: float, wider: float) -> float:
    """Where the signed root of the growth of chi-square is 1.96 (times `wider`), by the secant rule; nan if nowhere."""
    others = tuple(n for n in fit.selected if n != name)
    place = problem.model.names.index(name)
    aim = COVER * wider
    start, step, before = fit.values, COVER * std, (0.0, 0.0)
    for _ in range(_TRIALS):
        values = start.copy()
        values[place] = fit.values[place] + step
        trial = identify(problem, others, values, shift=fit.shift)
        if trial.status == "not_converged" or trial.failed:
            return float("nan")
        grown = float(np.sqrt(max(trial.chi2 - best, 0.0)))
        if abs(grown - aim) < _NEAR * aim:
            return float(fit.values[place] + step)
        slope = (grown - before[1]) / (step - before[0]) if step != before[0] else 0.0
        before, start = (step, grown), trial.values
        if slope == 0.0 or not np.isfinite(slope):
            return float("nan")
        step = step + float(np.clip((aim - grown) / slope, -2 * abs(step), 2 * abs(step)))
        if step * std <= 0:
            return float("nan")
    return float("nan")
