"""A whole calibration: the fit as it was asked for, its starts, its intervals, its datum."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import get_args

import numpy as np

from pkmcal_cli.base.errors import UsageError, did_you_mean
from pkmcal_cli.base.files import is_stream
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.base.stages import Observer, Stage, unobserved
from pkmcal_cli.base.workers import Workers
from pkmcal_cli.calibration.agreement import Agreement
from pkmcal_cli.calibration.bootstrap import bootstrap_intervals
from pkmcal_cli.calibration.datum import Datum
from pkmcal_cli.calibration.eliminated_frames import FrameUncertainty, frame_uncertainties
from pkmcal_cli.calibration.error_budget import ErrorBudget, error_budget, held_parameters
from pkmcal_cli.calibration.estimated_ranges import far_from_held, with_estimated_ranges
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identify import NOTHING, STEPS, identify
from pkmcal_cli.calibration.intervals import (
    Intervals,
    Method,
    linear_intervals,
    profile_intervals,
    with_held,
)
from pkmcal_cli.calibration.prior import joined, prior_of_ranges
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.robust import Loss, RobustFit, identify_robustly, plain_fit, without_weight
from pkmcal_cli.calibration.selected_shapes import with_free_shapes
from pkmcal_cli.calibration.starts import identify_from
from pkmcal_cli.calibration.steady_ropes import steady_fit
from pkmcal_cli.prediction import WarmStart

PRIORS = ("none", "ranges")
"""What may be known of parameters besides; `calibrate` takes a parameter file too."""


@dataclass(frozen=True)
class FitOptions:
    """How a fit treats data: loss, what is known besides, how intervals are found, seed of the bootstrap.

    starts: how many; 0 is one, and more where it fails. jobs: processes that share starts and profiles.
    """

    loss: str = "squares"
    prior: str = "none"
    uncertainty: str = "linear"
    seed: int = 0
    starts: int = 0
    jobs: int = 1

    @property
    def workers(self) -> Workers:
        """Who fits the starts and profiles."""
        return Workers.of(self.jobs)

    @property
    def plain(self) -> bool:
        """Whether it is by least squares, with intervals by the covariance."""
        return (self.loss, self.uncertainty) == ("squares", "linear")

    @property
    def prior_file(self) -> str | None:
        """The parameter file that `prior` names, None for a word."""
        return None if self.prior in PRIORS else self.prior

    def check(self, files: bool = False) -> None:
        """Raises UsageError for words that are none; `files`: whether the prior may be a parameter file."""
        known = {"loss": get_args(Loss), "prior": PRIORS, "uncertainty": get_args(Method)}
        for option, words in known.items():
            text = getattr(self, option)
            if option == "prior" and files and ("." in text or "/" in text or is_stream(text)):
                continue
            if text not in words:
                raise UsageError(
                    f"--{option}: `{text}` is not a valid value",
                    hint=did_you_mean(text, words, f"give one of {', '.join(words)}"),
                )


@dataclass(frozen=True)
class Calibration:
    """What was found, by which starts, held by which datum; frames: that were eliminated, by name of the parameter."""

    robust: RobustFit
    budget: ErrorBudget
    intervals: Intervals
    agreement: Agreement | None
    datum: Datum | None = None
    frames: Mapping[str, FrameUncertainty] = field(default_factory=dict)


def calibrated(
    problem: Problem,
    selected: tuple[str, ...],
    start: Array,
    options: FitOptions,
    session: Array,
    datum: Datum | None = None,
    states: WarmStart | None = None,
    tell: Callable[[str], None] | None = None,
    observe: Observer = unobserved,
    steps: int = STEPS,
    wrong_table: bool = False,
    gross: tuple[int, ...] = (),
) -> Calibration:
    """Calibrate from values (P,), with `states` of the rows there; session (N,): number of the session of each row.

    The problem in what is found is without the rows that nothing predicts. `tell` announces what takes longer;
    `observe` is told the steps; steps: that the fit from the start may take; wrong_table: whether it is given up where
    it does not soon come near its end; gross: rows beyond all noise, without which a robust loss begins. Raises
    RowsFailed.
    """
    problem = with_prior(problem, selected, options.prior, start)
    begun = problem if options.loss == "squares" else without_weight(problem, gross)
    first, agreement = identify_from(
        begun, selected, start, options.starts, options.seed, tell, states=states, observe=observe,
        workers=options.workers, steps=steps, wrong_table=wrong_table,
    )  # fmt: skip
    first = steady_fit(problem.without(first.failed), first)
    robust = _with_loss(problem.without(first.failed), first, options)
    held = held_parameters(problem, selected, () if datum is None else datum.held)
    robust, budget = _with_ranges(robust, start, held)
    intervals = _intervals(robust, budget, options, session, observe)
    frames = frame_uncertainties(robust.problem, robust.fit, budget)
    return Calibration(robust, budget, intervals, agreement, datum, frames)


def _with_ranges(robust: RobustFit, start: Array, held: tuple[str, ...]) -> tuple[RobustFit, ErrorBudget]:
    """The fit with ranges as they turned out to be, and what its errors are made of."""
    noise = None if robust.loss == "squares" else robust.fit.directions.spread
    budget = error_budget(robust.problem, robust.fit, held, noise=noise)
    fit = robust.fit.with_spread(budget.spread)
    if fit.status in ("converged", NOTHING):  # it may be the ranges that leave nothing to identify
        problem, fit = with_estimated_ranges(robust.problem, fit, start, budget.factors)
        if problem is not robust.problem:
            prior = replace(robust.problem, prior=problem.prior)
            budget = error_budget(prior, fit, held, scales=budget.scales)
            robust = replace(robust, problem=problem)
    return replace(robust, fit=fit), budget


def refit(
    options: FitOptions,
    problem: Problem,
    selected: tuple[str, ...],
    start: Array,
    states: WarmStart | None = None,
    factors: Array | None = None,
) -> Fit:
    """The same fit of other rows, from one start; `states`: near those there. Raises RowsFailed.

    factors (p,): of the ranges, by more rows; where with these nothing is nearly held, ranges need not be weighed anew.
    """
    problem = with_prior(problem, selected, options.prior, start)
    first = identify(problem, selected, start, states=states)
    robust = _with_loss(problem.without(first.failed), first, options)
    if factors is None or not far_from_held(robust.problem, robust.fit, factors):
        robust, _ = _with_ranges(robust, start, ())
    return robust.fit


def with_prior(problem: Problem, selected: tuple[str, ...], prior: str, start: Array | None = None) -> Problem:
    """The problem with what is known besides: ranges where they are a prior; shapes without a name always have one.

    A problem that already knows its parameters by an earlier calibration stays as it is. A datum is held as it is at
    the start (P,).
    """
    if problem.prior is not None and problem.prior.stated:
        return problem
    problem, weights = with_free_shapes(problem, selected)
    others = tuple(n for n in selected if n not in weights)
    if prior != "ranges" or not others:
        return problem
    ranges = prior_of_ranges(problem.model, others, problem.datum, start)
    return replace(problem, prior=ranges if problem.prior is None else joined(problem.prior, ranges))


def _with_loss(problem: Problem, first: Fit, options: FitOptions) -> RobustFit:
    """The fit by least squares, or from there with another loss."""
    if options.loss == "squares" or first.status != "converged":
        return plain_fit(problem, first)
    return identify_robustly(problem, first, options.loss)  # type: ignore[arg-type]


def _intervals(
    robust: RobustFit, budget: ErrorBudget, options: FitOptions, session: Array, observe: Observer
) -> Intervals:
    """Intervals of the selected parameters, as they are asked for."""
    fit, names = robust.fit, robust.problem.model.names
    index = np.array([names.index(n) for n in fit.selected], dtype=np.intp)
    if fit.status != "converged" or options.uncertainty == "linear":
        return linear_intervals(fit, budget, index)
    if options.uncertainty == "profile":
        intervals = profile_intervals(robust.problem, fit, budget, index, observe, options.workers)
        return with_held(intervals, fit, budget, index)
    observe(Stage("bootstrap"))
    intervals = bootstrap_intervals(robust.problem, fit, index, session, options.seed, robust.gain)
    return with_held(intervals, fit, budget, index)
