"""Fits from far away: continuation from what the ranges say, scattered starts, and whether they agree.

A start that is far off is led nearer by a fit that knows the parameters to half their ranges (which is well
conditioned) before the data alone decide. Other starts are drawn within the ranges; the best end counts.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identify import RowsFailed, identify
from pkmcal_cli.calibration.prior import Prior
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.rotation import Array

_SAME = 3.0  # standard uncertainties, each with what is held, within which ends are the same
ON_FAILURE = 8  # starts that are tried when the first one fails, or ends in a fit of chi-square above
_DOUBTFUL = 100.0  # per degree of freedom: ten times noise is a missing effect, or the wrong one of several minima


@dataclass(frozen=True)
class Agreement:
    """How many starts there were; how many ended in the best fit, in others as good, in worse ones, in none.

    spread: of those that agree, in standard uncertainties.
    """

    starts: int
    agree: int
    rivals: int
    worse: int
    failed: int
    spread: float

    @property
    def text(self) -> str:
        """In words."""
        if not self.agree:
            return f"none of {self.starts} starts ends in a fit"
        parts = [f"{self.agree} of {self.starts} starts end in the best fit (within {self.spread:.2g} std)"]
        parts += [f"{self.rivals} in another one as good: these data do not say which is right"] if self.rivals else []
        parts += [f"{self.worse} in a worse one"] if self.worse else []
        parts += [f"{self.failed} in none"] if self.failed else []
        return ", ".join(parts)


def identify_from(
    problem: Problem, selected: tuple[str, ...], start: Array, count: int, seed: int
) -> tuple[Fit, Agreement | None]:
    """The best fit of `count` starts, the first one as given (P,). Raises RowsFailed where none can be predicted.

    With one start that fails, or explains nothing, further ones are tried all the same.
    """
    first: Fit | None = None
    failure: RowsFailed | None = None
    try:
        first = identify(problem, selected, start)
        if count == 1 and first.status != "not_converged" and not first.chi2_per_dof > _DOUBTFUL:
            return first, None
    except RowsFailed as error:
        failure = error
    ends = [first, _led(problem, selected, start)]
    for values in _scattered(problem, selected, start, max(count, ON_FAILURE) - len(ends), seed):
        ends += [_tried(problem, selected, start, values)]
    good = [e for e in ends if e is not None and e.status == "converged"]
    if not good:
        if failure is not None and first is None:
            raise failure
        assert first is not None
        return first, Agreement(len(ends), 0, 0, 0, len(ends), 0.0)
    best = min(good, key=lambda e: e.chi2)
    if first is not None and first in good and _apart(problem, first, best) <= _SAME:
        best = first  # the same, with what is not seen as it was given
    before = first.before if first is not None else best.before
    return replace(best, before=before), _agreement(problem, ends, good, best)


def _apart(problem: Problem, one: Fit, best: Fit) -> float:
    """Largest difference of a parameter, in its standard uncertainty."""
    index = [problem.model.names.index(n) for n in best.selected]
    std = np.where(np.isfinite(best.std), best.std, np.inf)
    return float(np.abs((one.values - best.values)[index] / std).max(initial=0.0))


def _agreement(problem: Problem, ends: list[Fit | None], good: list[Fit], best: Fit) -> Agreement:
    apart = np.array([_apart(problem, e, best) for e in good])
    same = apart <= _SAME
    as_good = np.array([e.chi2 - best.chi2 <= _SAME**2 * best.excess for e in good])
    agree, rivals = int(same.sum()), int((~same & as_good).sum())
    failed = len(ends) - len(good)
    return Agreement(len(ends), agree, rivals, len(good) - agree - rivals, failed, float(apart[same].max(initial=0.0)))


def _led(problem: Problem, selected: tuple[str, ...], start: Array) -> Fit | None:
    """A fit from where a fit ends that knows the parameters to their ranges about the start."""
    model = problem.model
    index = [model.names.index(n) for n in selected]
    known = Prior(selected, np.diag(2.0 / model.ranges[index]), start[index])
    try:
        near = identify(replace(problem, prior=known), selected, start)
    except RowsFailed:
        return None
    return _tried(problem, selected, start, near.values)


def _scattered(problem: Problem, selected: tuple[str, ...], start: Array, count: int, seed: int) -> list[Array]:
    """Values (P,) drawn within the ranges about a start, inside the bounds."""
    model, rng = problem.model, np.random.default_rng([seed, 2])
    index = [model.names.index(n) for n in selected]
    low = np.array([model.parameters[k].bounds[0] for k in index])
    high = np.array([model.parameters[k].bounds[1] for k in index])
    out = []
    for _ in range(max(count, 0)):
        values = start.copy()
        drawn = values[index] + model.ranges[index] * rng.uniform(-1.0, 1.0, len(index))
        values[index] = np.clip(drawn, low, high)
        out.append(values)
    return out


def _tried(problem: Problem, selected: tuple[str, ...], start: Array, values: Array) -> Fit | None:
    """A fit from values (P,); what data do not see is as at the start, or ends could not be compared."""
    model = problem.model
    index = [model.names.index(n) for n in selected]
    try:
        found = identify(problem, selected, values)
        unseen = found.found.vectors[found.found.held]  # (k, p)
        if not len(unseen):
            return found
        values = found.values.copy()
        values[index] += unseen.T @ (unseen @ ((start - values)[index] / model.ranges[index])) * model.ranges[index]
        return identify(problem, selected, values)
    except RowsFailed:
        return None
