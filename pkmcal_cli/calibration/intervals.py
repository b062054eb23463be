"""Intervals of 95 %: from the covariance, or from the profile of chi-square.

Profile: a parameter is held at values further and further off, the others fitted again, until chi-square has grown by
the square of 1.96, times the budget's variance over that of the covariance; both sides for themselves, so that a bent
problem has lopsided intervals.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.base.stages import Observer, unobserved
from pkmcal_cli.base.workers import ALONE, Workers
from pkmcal_cli.calibration.condensed import condensed
from pkmcal_cli.calibration.error_budget import COVER, ErrorBudget
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.prior import prior_of_held
from pkmcal_cli.calibration.problem import Problem

Method = Literal["linear", "profile", "bootstrap"]
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


def linear_intervals(fit: Fit, budget: ErrorBudget, index: Array) -> Intervals:
    """Value and 1.96 standard uncertainties; index (p,) of the selected parameters among all."""
    std = np.where(fit.directions.undetermined(), np.nan, budget.std) if len(fit.selected) else np.zeros(0)
    values = fit.values[index]
    return Intervals("linear", np.stack([values - COVER * std, values + COVER * std], axis=1), std)


def with_held(intervals: Intervals, fit: Fit, budget: ErrorBudget, index: Array) -> Intervals:
    """Intervals by the data with what parameters that are not identified add to them."""
    more, values = budget.std_by_held[:, None], fit.values[index][:, None]
    ends = values + np.array([-1.0, 1.0]) * np.hypot(intervals.low_high - values, COVER * more)
    return replace(intervals, low_high=ends, std=np.hypot(intervals.std, more[:, 0]))


def profile_intervals(
    problem: Problem,
    fit: Fit,
    budget: ErrorBudget,
    index: Array,
    observe: Observer = unobserved,
    workers: Workers = ALONE,
) -> Intervals:
    """Where chi-square has grown by 1.96 squared, in proportion to the budget's uncertainty by data and ranges.

    Directions that are held stay as their ranges say.
    """
    with_prior = problem
    if problem.prior is None and fit.directions.held.any():  # a prior of its own leaves no direction to be held
        with_prior = replace(problem, prior=prior_of_held(fit.directions, fit.values[index]))
    low_high = np.full((len(fit.selected), 2), np.nan)
    std = np.where(fit.directions.undetermined(), np.nan, budget.std_by_data)
    wider = std / np.sqrt(np.diag(fit.with_spread(1.0).directions.determined_covariance()))
    if with_prior is not problem:  # with what ranges say, the best fit lies elsewhere
        fit = identify(with_prior, fit.selected, fit.values, shift=fit.shift, states=fit.last.start)
    profile = _Profile(with_prior, fit, condensed(with_prior, fit.last).chi2, std, wider)
    ends = workers.results(profile, len(fit.selected), "profile of parameter", observe)
    for k, column in enumerate(index):
        low_high[k] = np.clip(ends[k], *problem.bounds[column])
    lost = [
        n for n, ends, s in zip(fit.selected, low_high, std, strict=True) if np.isfinite(s) and np.isnan(ends).any()
    ]
    remark = f"profile interval: no end found for {', '.join(lost)}" if lost else ""
    return Intervals("profile", low_high, (low_high[:, 1] - low_high[:, 0]) / (2 * COVER), remark)


@dataclass(frozen=True)
class _Profile:
    """The ends of a parameter's interval, by its number among those identified; std, wider (p,), see `_cross`."""

    problem: Problem
    fit: Fit
    best: float
    std: Array
    wider: Array

    def __call__(self, number: int, observe: Observer = unobserved) -> tuple[float, float]:
        if not np.isfinite(self.std[number]):
            return float("nan"), float("nan")
        name, std, wider = self.fit.selected[number], float(self.std[number]), self.wider[number]
        low, high = (_cross(self.problem, self.fit, name, sign * std, self.best, wider) for sign in (-1, 1))
        return low, high


def _cross(problem: Problem, fit: Fit, name: str, std: float, best: float, wider: float) -> float:
    """Where the signed root of the growth of chi-square is 1.96 (times `wider`), by the secant rule; nan if nowhere."""
    others = tuple(n for n in fit.selected if n != name)
    column = problem.model.names.index(name)
    aim = COVER * wider
    start, step, before = fit.values, COVER * std, (0.0, 0.0)
    for _ in range(_TRIALS):
        values = start.copy()
        values[column] = fit.values[column] + step
        trial = identify(problem, others, values, shift=fit.shift, states=fit.last.start)
        if trial.status == "not_converged" or trial.failed:
            return float("nan")
        grown = float(np.sqrt(max(trial.chi2 - best, 0.0)))
        if abs(grown - aim) < _NEAR * aim:
            return float(fit.values[column] + step)
        slope = (grown - before[1]) / (step - before[0]) if step != before[0] else 0.0
        before, start = (step, grown), trial.values
        if slope == 0.0 or not np.isfinite(slope):
            return float("nan")
        step = step + float(np.clip((aim - grown) / slope, -2 * abs(step), 2 * abs(step)))
        if step * std <= 0:
            return float("nan")
    return float("nan")
