"""A whole calibration: the fit as it was asked for, its starts, its intervals, its datum."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np

from pkmcal_cli.base.errors import UsageError, did_you_mean
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.bootstrap import bootstrap_intervals
from pkmcal_cli.calibration.datum import Datum
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.intervals import (
    Intervals,
    Method,
    linear_intervals,
    profile_intervals,
)
from pkmcal_cli.calibration.prior import prior_of_ranges
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.robust import Loss, RobustFit, identify_robustly, plain_fit
from pkmcal_cli.calibration.starts import Agreement, identify_from


@dataclass(frozen=True)
class Treatment:
    """How a fit treats data: loss, what is known besides, how intervals are found, seed of the bootstrap.

    starts: how many; 0 is one, and more where it fails.
    """

    loss: str = "squares"
    prior: str = "none"
    uncertainty: str = "linear"
    seed: int = 0
    starts: int = 0

    def check(self) -> None:
        """Raises UsageError for words that are none."""
        known = {"loss": get_args(Loss), "prior": ("none", "ranges"), "uncertainty": get_args(Method)}
        for option, words in known.items():
            given = getattr(self, option)
            if given not in words:
                raise UsageError(f"--{option}: `{given}` is none", hint=did_you_mean(given, words, ", ".join(words)))


@dataclass(frozen=True)
class Fitted:
    """What was found, by which starts, held by which datum."""

    robust: RobustFit
    intervals: Intervals
    agreement: Agreement | None
    datum: Datum | None = None


def fitted(
    problem: Problem,
    selected: tuple[str, ...],
    start: Array,
    how: Treatment,
    session: Array,
    tell: Callable[[str], None] | None = None,
) -> Fitted:
    """Calibrate from values (P,); session (N,): number of the session of each row. Raises RowsFailed.

    The problem in what is found is without the rows that nothing predicts. `tell` announces what takes longer.
    """
    problem = _with_prior(problem, selected, how)
    first, agreement = identify_from(problem, selected, start, how.starts, how.seed, tell)
    found = _with_loss(problem.without(first.failed), first, how)
    return Fitted(found, _intervals(found, how, session), agreement)


def fitted_again(how: Treatment, problem: Problem, selected: tuple[str, ...], start: Array) -> Fit:
    """The same fit of other rows, from one start. Raises RowsFailed."""
    problem = _with_prior(problem, selected, how)
    first = identify(problem, selected, start)
    return _with_loss(problem.without(first.failed), first, how).fit


def _with_prior(problem: Problem, selected: tuple[str, ...], how: Treatment) -> Problem:
    return replace(problem, prior=prior_of_ranges(problem.model, selected)) if how.prior == "ranges" else problem


def _with_loss(problem: Problem, first: Fit, how: Treatment) -> RobustFit:
    """The fit by least squares, or from there with another loss."""
    if how.loss == "squares" or first.status != "converged":
        return plain_fit(problem, first)
    return identify_robustly(problem, first, how.loss)  # type: ignore[arg-type]


def _intervals(found: RobustFit, how: Treatment, session: Array) -> Intervals:
    """Intervals of the selected parameters, as they are asked for."""
    fit, names = found.fit, found.problem.model.names
    index = np.array([names.index(n) for n in fit.selected], dtype=np.intp)
    if fit.status != "converged" or how.uncertainty == "linear":
        return linear_intervals(fit, index)
    if how.uncertainty == "profile":
        return profile_intervals(found.problem, fit, index)
    return bootstrap_intervals(found.problem, fit, index, session, how.seed, found.gain)
