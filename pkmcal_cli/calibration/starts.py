"""Fits from far away: continuation from what the ranges say, scattered starts, and whether they agree.

A start that is far off is led nearer by a fit that knows the parameters to half their ranges (which is well
conditioned) before the data alone decide. Other starts are drawn within the ranges; the best end counts.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from pkmcal_cli.base.budget import Budget, OutOfTime
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.base.stages import Observer, Stage, unobserved
from pkmcal_cli.base.workers import ALONE, Workers
from pkmcal_cli.calibration.agreement import SAME, Agreement, agreement_of, apart
from pkmcal_cli.calibration.estimated_ranges import centred
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identify import STEPS, RowsFailed, identify
from pkmcal_cli.calibration.patience import EXACT, SHORT, Patience
from pkmcal_cli.calibration.prior import Prior
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.steady_ropes import steady_fit
from pkmcal_cli.calibration.tightened_ropes import with_tightened_ropes
from pkmcal_cli.prediction import WarmStart

ON_FAILURE = 8  # starts that are tried when the first one fails, or ends in a fit of chi-square above
_STEPS = 25  # of further starts; those that end well take fewer than ten
_HOPELESS = 1e6  # chi-square per degree of freedom: a thousand times noise, where damped steps lead nowhere soon
_SOON = 5  # steps after which a fit of a wrong table is given up that has not led below this
_DOUBTFUL = 100.0  # per degree of freedom: ten times noise is a missing effect, or the wrong one of several minima


Progress = Callable[[int, float], None] | None
"""Told the number of each step, and chi-square."""


def _fitted(observe: Observer, steps: int, _: float) -> None:
    """Tell how far the fit is."""
    observe(Stage("fit", steps))


def identify_from(
    problem: Problem,
    selected: tuple[str, ...],
    start: Array,
    count: int,
    seed: int,
    tell: Callable[[str], None] | None = None,
    states: WarmStart | None = None,
    observe: Observer = unobserved,
    workers: Workers = ALONE,
    steps: int = STEPS,
    wrong_table: bool = False,
) -> tuple[Fit, Agreement | None]:
    """The best fit of `count` starts, the first one as given (P,), with `states` of the rows there; see `calibrated`.

    Raises RowsFailed where none can be predicted. With `count` 0 one that fails, or explains nothing, is helped.
    """
    observe(Stage("fit"))
    first: Fit | None = None
    failure: RowsFailed | None = None
    try:
        patience = Patience(_HOPELESS * problem.count, _SOON) if wrong_table else EXACT if steps == STEPS else SHORT
        progress = partial(_fitted, observe)
        first = identify(problem, selected, start, steps, progress=progress, states=states, patience=patience)
        first = _centred(problem, selected, start, first)
        first = _with_ropes(problem, selected, start, first)
    except RowsFailed as error:
        failure = error
    if first is not None and (count == 1 or (count == 0 and not _doubtful(first))):
        return first, None
    if not count and tell is not None:
        outcome = "leaves large residuals" if first is not None and first.status == "converged" else "fails"
        tell(f"the fit from the start {outcome}: up to {ON_FAILURE - 1} further starts follow")
    best, agreement = best_of_starts(
        problem, selected, start, first, count, seed=seed, observe=observe, workers=workers
    )
    if best is None:
        assert failure is not None
        raise failure
    return best, agreement


def best_of_starts(
    problem: Problem,
    selected: tuple[str, ...],
    start: Array,
    first: Fit | None,
    count: int,
    seed: int,
    observe: Observer = unobserved,
    workers: Workers = ALONE,
) -> tuple[Fit | None, Agreement]:
    """The best fit of `count` starts (0: until one explains the data), the first of which ended in `first`."""
    ends = _further(problem, selected, start, [first], count, seed=seed, observe=observe, workers=workers)
    good = [e for e in ends if e is not None and e.status == "converged"]
    untried = 0 if count or _helped(ends) else ON_FAILURE - len(ends)
    if not good:
        none = Agreement(starts=len(ends), agree=0, rivals=0, worse=0, failed=len(ends), spread=0.0, untried=untried)
        return first, none
    best = _not_beaten(min(good, key=lambda e: (len(e.failed), e.chi2)), ends)
    whole = first is not None and first.failed.keys() == best.failed.keys()
    if first is not None and whole and first.status == "converged" and apart(problem, first, best) <= SAME:
        best = first  # the same, with what is not seen as it was given
    before = first.before if first is not None else best.before
    return replace(best, before=before), replace(agreement_of(problem, ends, good, best), untried=untried)


def _not_beaten(best: Fit, ends: Sequence[Fit | None]) -> Fit:
    """The best fit that converged; or one that did not, if it leaves much less: then the best is no minimum of all."""
    if best.excess <= 1.0:
        return best
    lower = (e for e in ends if e is not None and e.failed.keys() == best.failed.keys())
    return min((e for e in lower if e.chi2 < best.chi2 - SAME**2 * best.excess), key=lambda e: e.chi2, default=best)


def _with_ropes(problem: Problem, selected: tuple[str, ...], start: Array, first: Fit) -> Fit:
    """The fit, or a better one where ropes are slack, or between taut and slack."""
    if first.before.prediction.slack:
        first = _by_taut_ropes(problem, selected, start, first)
    if first.status == "not_converged":
        first = steady_fit(problem, first)
    return with_tightened_ropes(problem, first)


def _by_taut_ropes(problem: Problem, selected: tuple[str, ...], start: Array, first: Fit) -> Fit:
    """The better one of a fit and of that from where ropes that push too lead.

    A rope that is slack at the start tells nothing of where it is held, so that the fit cannot make it taut.
    """
    taut = replace(problem, model=problem.model.with_taut_ropes())
    try:
        values = identify(taut, selected, start, iterations=_STEPS).values
    except RowsFailed:
        return first
    other = _tried(problem, selected, start, values, None)
    ends = [e for e in (first, other) if e is not None]
    best = min(ends, key=lambda e: (e.status != "converged", len(e.failed), e.chi2))
    return replace(best, before=first.before)


def _doubtful(fit: Fit) -> bool:
    """Whether another start may end in a better fit: this one fails, explains little, or not all with fewer rows."""
    explained = fit.chi2_per_dof <= _DOUBTFUL and not (fit.failed and fit.excess > 1.0)
    return fit.status == "not_converged" or not (explained or np.isnan(fit.chi2_per_dof))


def _further(
    problem: Problem,
    selected: tuple[str, ...],
    start: Array,
    ends: list[Fit | None],
    count: int,
    seed: int,
    observe: Observer,
    workers: Workers,
) -> list[Fit | None]:
    """Ends of `count` starts; with 0, until one explains the data or the time is over, so one after the other."""
    total, budget = count or ON_FAILURE, Budget()
    scattered = _scattered(problem, selected, start, total - len(ends) - 1, seed)
    further = _Starts(problem, selected, start, tuple(ends), tuple(scattered), None if count else budget.check)
    if count:
        return workers.results(further, total, "start", observe)
    for number in range(len(further.known), total):
        if _helped(ends) and number > len(further.known):
            break
        observe(Stage("start", number, total))
        try:
            ends = [*ends, further(number)]
        except OutOfTime:
            break
    return ends


def _helped(ends: list[Fit | None]) -> bool:
    """Whether one explains the data."""
    return any(e is not None and e.status == "converged" and e.excess == 1.0 for e in ends)


@dataclass(frozen=True)
class _Starts:
    """Ends of starts by number: after the known ones the first is led nearer, the others begin at values (P,).

    progress: told of each step; what it raises ends all.
    """

    problem: Problem
    selected: tuple[str, ...]
    start: Array
    known: tuple[Fit | None, ...]
    scattered: tuple[Array, ...]
    progress: Progress = None

    def __call__(self, number: int, observe: Observer = unobserved) -> Fit | None:
        if number < len(self.known):
            return self.known[number]
        if number == len(self.known):
            return _led(self.problem, self.selected, self.start, self.progress)
        values = self.scattered[number - len(self.known) - 1]
        return _tried(self.problem, self.selected, self.start, values, self.progress)


def _led(problem: Problem, selected: tuple[str, ...], start: Array, progress: Progress) -> Fit | None:
    """A fit from where a fit ends that knows the parameters to their ranges about the start."""
    model = problem.model
    index = [model.names.index(n) for n in selected]
    known = Prior(selected, np.diag(2.0 / model.ranges[index]), start[index])
    try:
        near = _short_fit(replace(problem, prior=known), selected, start, progress)
    except RowsFailed:
        return None
    return _tried(problem, selected, start, near.values, progress)


def _scattered(problem: Problem, selected: tuple[str, ...], start: Array, count: int, seed: int) -> list[Array]:
    """Values (P,) drawn within the ranges about a start, inside the bounds."""
    model, rng = problem.model, np.random.default_rng([seed, 2])
    index = [model.names.index(n) for n in selected]
    low, high = problem.bounds[index].T
    out = []
    for _ in range(max(count, 0)):
        values = start.copy()
        drawn = values[index] + model.ranges[index] * rng.uniform(-1.0, 1.0, len(index))
        values[index] = np.clip(drawn, low, high)
        out.append(values)
    return out


def _tried(problem: Problem, selected: tuple[str, ...], start: Array, values: Array, progress: Progress) -> Fit | None:
    """A fit from values (P,), if it ends soon; what data do not see is as at the start."""
    try:
        return _centred(problem, selected, start, _short_fit(problem, selected, values, progress))
    except RowsFailed:
        return None


def _short_fit(problem: Problem, selected: tuple[str, ...], values: Array, progress: Progress) -> Fit:
    """A fit from values (P,), given up early where it is far off. Raises RowsFailed."""
    patience = Patience(_HOPELESS * problem.count)
    return identify(problem, selected, values, iterations=_STEPS, progress=progress, patience=patience)


def _centred(problem: Problem, selected: tuple[str, ...], start: Array, fit: Fit) -> Fit:
    """The fit with weak directions about nominal, null ones as at the start (P,), whatever they were on the way.

    What the data hardly see is what the ranges say; and ends could not be compared otherwise.
    """
    model, held = problem.model, fit.directions.held
    index = [model.names.index(n) for n in selected]
    nominal = model.nominal[index]
    if fit.status != "converged" or not held.any() or (fit.before.values[index] == nominal).all():
        return fit
    values = centred(problem, fit.values, start, fit.directions)
    try:
        return replace(identify(problem, selected, values, _STEPS, states=fit.last.start), before=fit.before)
    except RowsFailed:
        return fit
