"""Far off before fine: constants, scales and signs of drives, of any size, where values run out of their ranges.

What is far off is not found by a linear test at a calibration without it: declared parameters have taken up what they
can, and the machine is elsewhere. So each candidate is fitted from the nominal machine, nonlinear and free in size; the
best are fitted again from several starts. One is named where it explains most of what is left, brings the declared
parameters back, and does not harm rows that were held out. Where declared parameters have taken up all of it, what is
left is how far these are off: as improbable as their ranges say.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from pkmcal_cli.base.budget import Budget, OutOfTime
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.base.stages import Observer, Stage, unobserved
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identify import RowsFailed, identify
from pkmcal_cli.calibration.patience import SHORT, Patience
from pkmcal_cli.calibration.plausible import implausible_residuals
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.diagnosis.confirm import held_out_gain
from pkmcal_cli.diagnosis.far_starts import TIMES, absorbed, far_starts
from pkmcal_cli.diagnosis.first_fit import OUT
from pkmcal_cli.diagnosis.hypotheses import RELEASE, Hypothesis
from pkmcal_cli.diagnosis.near_causes import with_near_cause
from pkmcal_cli.diagnosis.off_nominal import NOWHERE, beyond_ranges, furthest, off_nominal
from pkmcal_cli.diagnosis.score import UNUSUAL
from pkmcal_cli.diagnosis.scoring import FarOff, Search

_KINDS = ("zero", "scale", "meas_zero", "meas_scale")
_EXPLAINED = 0.75  # share of chi-square that a far cause explains
_WORTH = 0.5  # share of chi-square that it may leave after a few steps
_BACK = 0.5  # share of the furthest offset that may be left with it
_ROWS, _STEPS, _LAST_STEPS = 150, 12, 30  # rows and steps of a screening fit, steps of the last ones
_CLEARLY = 25.0  # times the squares that a cause of all leaves linearly, which another one must leave to be none
_CANDIDATES, _BEST, _MOST = 48, 5, 2  # that are screened, fitted from several starts, and named one after the other
_RIVAL = 0.02  # weight from which on a hypothesis is told beside the best


def with_far_causes(search: Search, observe: Observer = unobserved) -> Search:
    """The search with far-off causes accepted, one after the other, where the calibration has run away."""
    budget: Budget | None = None
    while len(search.far_off) < _MOST and (absorbed(search) or (_run_away(search) and not _held_explain(search))):
        budget = budget or Budget()
        candidates = [h for h in search.open if h.effect in _KINDS and not h.session]
        candidates.sort(key=lambda h: len(h.unknown))  # few numbers first, where there are too many or no time
        try:
            better, untried = _best(_from_nominal(search), candidates[:_CANDIDATES], observe, budget)
        except RowsFailed:  # the nominal machine predicts too little to begin with
            break
        search = replace(better or search, untried=(*untried, *(h.name for h in candidates[_CANDIDATES:])))
        if better is None:
            break
    return search


def far_beyond(before: Search, after: Search) -> bool:
    """Whether something was accepted, and all of it is far beyond its usual size: no calibration explains it away."""
    return bool(after.accepted) and all(_size(before, h, after.fit) > UNUSUAL for h in after.accepted)


def _run_away(search: Search) -> bool:
    """Whether a calibration has taken declared parameters out of their ranges, or leaves most of what it began with."""
    fit = search.fit
    if not fit.chi2_per_dof > TIMES:
        return False
    return bool(beyond_ranges(search, fit)) or bool(implausible_residuals(search.problem, fit))


def _from_nominal(search: Search) -> Search:
    """The search with fits that begin at the nominal machine, as declared parameters are to come back there."""
    return replace(search, candidates=replace(search.candidates, start=None))


def _misfit(search: Search, fit: Fit, share: float = 1.0) -> float:
    """Chi-square, times a share, and where parameters have taken up what was off, how improbable they are, as much."""
    if not absorbed(search):
        return share * fit.chi2
    improbable = float(((2.0 * off_nominal(search, fit)[2]) ** 2).sum())
    return share * fit.chi2 + max(search.fit.chi2_per_dof, 1.0) * improbable


def _held_explain(search: Search) -> bool:
    """Whether declared parameters that are held explain most of it within their ranges: they go before effects."""
    model = search.problem.model
    held = tuple(n for h in search.open if h.effect == RELEASE for n in h.parameters)
    if not held:
        return False
    chosen, most = {*search.selected, *held}, (1 - _EXPLAINED) * search.fit.chi2
    try:
        names = tuple(n for n in model.names if n in chosen)
        states, patience = search.fit.before.start, replace(SHORT, hoped=most)
        fit = identify(search.problem, names, search.start, _STEPS, states=states, patience=patience)
    except (RowsFailed, np.linalg.LinAlgError):
        return False
    index = [model.names.index(n) for n in held]
    off = np.abs(fit.values[index] - model.nominal[index]) / model.ranges[index]
    return fit.chi2 < most and float(off.max(initial=0.0)) < OUT


def _best(
    search: Search, candidates: Sequence[Hypothesis], observe: Observer, budget: Budget
) -> tuple[Search | None, tuple[str, ...]]:
    """The search with the far-off cause that has most evidence; None where none is one. Names for which no time was.

    Where the one with most evidence is of usual size, with that, if it leaves little: else it is for the linear tests.
    """
    screened, untried = _screened(search, candidates, observe, budget)
    variance = max(min((f.chi2_per_dof for f in screened.values()), default=1.0), 1.0)
    order = sorted(screened, key=lambda h: _cost(search, screened[h], h, variance))[:_BEST]
    hoped = _CLEARLY * min((f.chi2_per_dof for f in screened.values()), default=1.0) * search.problem.count
    ends = {h: fit for h in order if (fit := _fitted(search, h, screened[h], hoped)) is not None}
    variance = max(min((f.chi2_per_dof for f in ends.values()), default=1.0), 1.0)
    cost = {h: _cost(search, fit, h, variance) for h, fit in ends.items()}
    able = [h for h in sorted(ends, key=lambda h: cost[h]) if _explains(search, ends[h])]
    for hypothesis in able:
        if not _is_far(search, hypothesis, ends[hypothesis]):
            explained = ends[hypothesis].chi2_per_dof <= TIMES
            return (with_near_cause(search, hypothesis, ends[hypothesis]) if explained else None), untried
        competing = [h for h in able if h is hypothesis or not h.akin(hypothesis)]
        weight = np.exp([cost[hypothesis] - cost[h] for h in competing])
        rivals = [(h.whole, float(w / weight.sum())) for h, w in zip(competing, weight, strict=True)]
        far_off = FarOff(
            offsets=beyond_ranges(search, search.fit), rivals=tuple(r for r in rivals if r[1] > _RIVAL),
            absorbed=search.fit if absorbed(search) else None,
        )  # fmt: skip
        extended = _with(search, hypothesis, ends[hypothesis], far_off)
        gain = held_out_gain(extended, extended.accepted[-1])
        if not (gain.contradicts if far_off.absorbed is None else gain.harms):
            return extended, untried
    return None, untried


def _cost(search: Search, fit: Fit, hypothesis: Hypothesis, variance: float) -> float:
    """Less log evidence (BIC) of a fit with a hypothesis."""
    return 0.5 * (_misfit(search, fit) / variance + len(hypothesis.unknown) * float(np.log(max(fit.dof, 2))))


def _screened(
    search: Search, candidates: Sequence[Hypothesis], observe: Observer, budget: Budget
) -> tuple[dict[Hypothesis, Fit], tuple[str, ...]]:
    """One fit of some rows with each candidate, where it explains about as much as a far-off cause does.

    Not those that linearly leave clearly more than one with no more numbers that explains all. And the names of those
    for which there was no time.
    """
    rows = np.unique(np.linspace(0, len(search.problem) - 1, min(_ROWS, len(search.problem))).astype(np.intp))
    some = replace(search, problem=search.problem.take(rows))
    gross = bool(implausible_residuals(search.problem, search.fit))
    most = _WORTH * _misfit(search, search.fit, some.problem.count / search.problem.count)
    out: dict[Hypothesis, Fit] = {}
    every, most_left, most_by_drives, hoped = far_starts(some, candidates, gross), np.inf, np.inf, np.inf
    for k, start in enumerate(every):
        observe(Stage("far-off causes", k, len(every)))
        if start.left > most_left or (start.by_drives or 0.0) > most_by_drives:
            continue
        patience = replace(SHORT, chi2=hoped, hoped=hoped)
        try:
            fits = [_fit(some, start.hypothesis, values, _STEPS, patience, budget) for values in start.values]
        except OutOfTime:
            return out, tuple(s.hypothesis.name for s in every[k:])
        best = min((f for f in fits if f is not None), key=partial(_misfit, search), default=None)
        if best is not None and _misfit(search, best) < most:
            out[start.hypothesis] = best
            if best.chi2_per_dof <= TIMES and furthest(search, best) <= OUT:
                most_left = min(most_left, _CLEARLY * start.left)
                most_by_drives = min(most_by_drives, _CLEARLY * (start.by_drives or np.inf))
                hoped = min(hoped, _CLEARLY * best.chi2)
    return out, ()


def _fit(
    search: Search, hypothesis: Hypothesis, start: Array, steps: int, patience: Patience, budget: Budget | None = None
) -> Fit | None:
    """A fit with a hypothesis of any size from values (P,), SI; None where it fails or is given up.

    Raises OutOfTime.
    """
    check = None if budget is None else budget.check
    problem, chosen = of_any_size(search.problem, hypothesis), {*search.selected, *hypothesis.unknown}
    try:
        selected = tuple(n for n in problem.model.names if n in chosen)
        fit = identify(problem, selected, start, steps, check, patience=patience)
        return None if fit.abandoned else fit
    except (RowsFailed, np.linalg.LinAlgError):
        return None


def of_any_size(problem: Problem, hypothesis: Hypothesis) -> Problem:
    """The problem in which the numbers of a hypothesis may have any size: lengths that of the machine, scales all."""
    ranges = problem.model.ranges.copy()
    for name in hypothesis.parameters:
        k = problem.model.names.index(name)
        ranges[k] = problem.model.length if problem.model.parameters[k].dimension == "length" else 1.0
    return replace(problem, model=problem.model.with_ranges(ranges))


def _fitted(search: Search, hypothesis: Hypothesis, screened: Fit, hoped: float) -> Fit | None:
    """The best fit of all rows with a hypothesis, from where the screening ended, or else from the nominal machine.

    None where none comes near the chi-square that is hoped for.
    """
    if screened.status == "converged" and len(search.problem) <= _ROWS:
        return screened
    patience = Patience(chi2=hoped, hoped=hoped)
    fits = [_fit(search, hypothesis, screened.values, _LAST_STEPS, patience)]
    if (first := fits[0]) is None or first.status != "converged" or first.chi2 > hoped:
        fits.append(_fit(search, hypothesis, search.start, _LAST_STEPS, patience))
    return min((f for f in fits if f is not None), key=partial(_misfit, search), default=None)


def _with(search: Search, hypothesis: Hypothesis, fit: Fit, far_off: FarOff) -> Search:
    """The search with a far-off cause accepted, from whose size later fits begin."""
    model = search.problem.model
    begin = tuple((n, float(fit.values[model.names.index(n)])) for n in hypothesis.unknown)
    gain = _misfit(search, search.fit) - _misfit(search, fit)
    return replace(
        search,
        problem=of_any_size(search.accepting([hypothesis.whole]).problem, hypothesis),
        accepted=(*search.accepted, replace(hypothesis.whole, begin=begin)),
        fit=fit,
        p_values=search.p_values | {hypothesis.name: float("nan")},  # no linear test finds it
        evidence=search.evidence | {hypothesis.name: 0.5 * gain / max(fit.chi2_per_dof, 1.0)},
        far_off={**search.far_off, hypothesis.name: far_off},
    )


def _is_far(search: Search, hypothesis: Hypothesis, fit: Fit) -> bool:
    """Whether a cause is far off, or declared parameters are without it."""
    return _size(search, hypothesis, fit) > UNUSUAL or furthest(search, search.fit) > NOWHERE


def _size(search: Search, hypothesis: Hypothesis, fit: Fit) -> float:
    """The largest number of a hypothesis, in usual sizes: ranges of the search."""
    model = search.problem.model
    index = [model.names.index(n) for n in hypothesis.unknown]
    return float((np.abs(fit.values[index] - model.nominal[index]) / model.ranges[index]).max(initial=0.0))


def _explains(search: Search, fit: Fit) -> bool:
    """Whether a fit with a cause explains most of what was left, and brings declared parameters back."""
    before = furthest(search, search.fit)
    return (
        _misfit(search, fit) < (1 - _EXPLAINED) * _misfit(search, search.fit)
        and (before <= OUT or furthest(search, fit) < max(_BACK * before, OUT))
        and len(fit.failed) <= len(search.fit.failed)
    )
