"""Effects that depend on forces, fitted instead of scored: a calibration without them moves the forces they turn on.

The score of a clearance is taken where the declared parameters have already given way to it; there joints may be
pulled that are pushed in truth, and the clearance is not recognised. So where doubt is left, each such effect is put
in at a plausible size, in place of what was accepted or beside it, and the best ones are fitted.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc

from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.linear import linear_problem, log_evidence
from pkmcal_cli.diagnosis.refine import set_evidence
from pkmcal_cli.diagnosis.search import Search, refit, score_all
from pkmcal_cli.effects import catalogue
from pkmcal_cli.rotation import Array

_FITTED = 3  # trials that are fitted
_BETTER = 2.0  # log evidence by which a trial must be better


@dataclass(frozen=True)
class _Trial:
    """A set of effects with a reactive one at a size (k,), SI, and the sum of squares that one step promises."""

    search: Search
    hypothesis: Hypothesis
    size: Array
    chi2: float


def reactive_instead(now: Search) -> Search | None:
    """The search with a reactive effect in place of accepted ones, or beside them, if that is better; None if not."""
    known = catalogue()
    kinds = [h for h in now.open if h.effect in known and known[h.effect].reactive]
    trials = [trial for h in kinds for rest in _rests(now) if (trial := _promised(rest, h)) is not None]
    found = score_all(now, ())
    best = now
    for trial in sorted(trials, key=lambda t: t.chi2)[:_FITTED]:
        fit = refit(trial.search, {trial.hypothesis: trial.size})
        if fit is None:
            continue
        after = replace(trial.search, fit=fit)
        if set_evidence(after, found) > set_evidence(best, found) + (_BETTER if best is now else 0.0):
            best = _told(after, trial.hypothesis, found.scale.variance)
    return None if best is now else best


def _rests(now: Search) -> Iterator[Search]:
    """The search without any effect, without each one, and with all."""
    sets = {(), *(tuple(h for h in now.accepted if h != one) for one in now.accepted), now.accepted}
    for accepted in sorted(sets, key=lambda s: [h.name for h in s]):
        yield replace(now, accepted=accepted)


def _promised(rest: Search, hypothesis: Hypothesis) -> _Trial | None:
    """What one step from a plausible size, with the other parameters where they are without it, promises."""
    model = rest.problem.model
    index = [model.names.index(n) for n in hypothesis.parameters]
    size = 0.5 * model.ranges[index]
    values = np.where(np.isin(model.names, rest.selected), rest.fit.values, model.nominal)
    values[index] = size
    after = replace(rest, accepted=(*rest.accepted, hypothesis))
    linear = linear_problem(rest.problem, values, after.selected, (), rest.fit.after.state)
    return _Trial(after, hypothesis, size, linear.chi2) if np.isfinite(linear.chi2) else None


def _told(after: Search, hypothesis: Hypothesis, variance: float) -> Search:
    """With the p value and evidence of the new effect, by the likelihood ratio to a fit without it."""
    without = refit(replace(after, accepted=tuple(h for h in after.accepted if h != hypothesis)), {})
    gain = 0.0 if without is None else max(without.chi2 - after.fit.chi2, 0.0) / variance
    count = len(hypothesis.parameters)
    p = after.p_values | {hypothesis.name: float(chdtrc(count, gain))}
    told = float(log_evidence(np.array(gain), np.array(count)))
    return replace(after, p_values=p, evidence=after.evidence | {hypothesis.name: told})
