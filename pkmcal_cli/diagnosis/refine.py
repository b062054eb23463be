"""After the search: is each accepted effect needed, is another better, and which could stand in its place?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.diagnosis.confirm import held_out_gain
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.linear import Linear
from pkmcal_cli.diagnosis.search import Scored, Search, refit, score_without, scored, shape_gains

RIVALS = 4
ALL = "all"
CREDIBLE = 0.95
WEAK = 15.0  # log evidence below which an effect must be confirmed by rows held out
_BETTER = 0.5  # log evidence by which another set must be better


@dataclass(frozen=True)
class Rival:
    """A hypothesis that could stand in the place of an accepted one, and its weight among all."""

    hypothesis: Hypothesis
    weight: float
    cosine: float  # of the angle between the two, declared parameters and other effects projected out


def swapped(now: Search) -> Search:
    """The search with effects dropped or replaced by rivals while that raises the evidence of the whole set."""
    for _ in range(2 * len(now.accepted)):
        kinds = dict.fromkeys(h.effect for h in now.accepted)
        better = next((s for k in kinds if (s := _reselected(now, k)) is not None), None)
        better = better or next((s for h in now.accepted if (s := _improved(now, h)) is not None), None)
        if better is None:
            return now
        now = better
    return now


def _improved(now: Search, hypothesis: Hypothesis) -> Search | None:
    """The search with this effect dropped or replaced, if that is better; None if not."""
    rest = replace(now, accepted=tuple(h for h in now.accepted if h != hypothesis))
    found = score_without(now, [hypothesis], (hypothesis, *now.open))
    shape = shape_gains(now, found)
    shaped = found.log_bayes + shape
    mine, price = float(shaped[0]), float(np.log(len(now.candidates.hypotheses)))
    if len(now.accepted) > 1 and mine < price - _BETTER and found.p_values[0] > now.critical:
        fit = refit(rest, {})
        return None if fit is None else replace(rest, fit=fit)
    order = np.argsort(-shaped[1:])[:RIVALS] + 1
    for k in order:
        if shaped[k] > mine + _BETTER:
            after = replace(rest, accepted=(*rest.accepted, found.hypotheses[k]))
            starts = {
                found.hypotheses[k]: found.scores[k].estimate * found.linear.scale_of(found.hypotheses[k].parameters)
            }
            fit = refit(after, starts)
            if fit is None:
                continue
            gain = 0.5 * (now.fit.chi2 - fit.chi2) / found.scale.variance + _price(found, 0) - _price(found, int(k))
            if gain + shape[k] - shape[0] > _BETTER:
                return _renamed(replace(after, fit=fit), found, int(k))
    return None


def _reselected(now: Search, keyword: str) -> Search | None:
    """The search with all effects of one kind chosen anew among single places, if that is better; None if not.

    `all` accepted first, and then what is wrong about it, stands for two single places.
    """
    mine = [h for h in now.accepted if h.effect == keyword]
    if len(mine) < 2 or ALL not in [h.at for h in mine]:
        return None
    rest = replace(now, accepted=tuple(h for h in now.accepted if h not in mine))
    singles = [h for h in now.candidates.hypotheses if h.effect == keyword and h.at != ALL]
    linear = score_without(now, mine, singles).linear
    chosen: list[Hypothesis] = []
    while len(chosen) < len(mine):
        rest_of_them = [h for h in singles if h not in chosen]
        if not rest_of_them:
            break
        found = scored(linear, now.problem, rest_of_them)
        best = int(np.argmax(found.log_bayes))
        if found.log_bayes[best] <= 0:
            break
        chosen.append(found.hypotheses[best])
        linear = linear.projecting((*linear.projected, *found.hypotheses[best].parameters))
    after = replace(rest, accepted=(*rest.accepted, *chosen))
    fit = refit(after, {})
    if fit is None or not chosen or set_evidence(replace(after, fit=fit), found) < set_evidence(now, found) - _BETTER:
        return None
    p, evidence = dict(now.p_values), dict(now.evidence)
    for h in chosen:
        p.setdefault(h.name, min(now.p_values.get(m.name, 1.0) for m in mine))
        evidence.setdefault(h.name, max(now.evidence.get(m.name, 0.0) for m in mine))
    return replace(after, fit=fit, p_values=p, evidence=evidence)


def _renamed(now: Search, found: Scored, k: int) -> Search:
    name = found.hypotheses[k].name
    p = now.p_values | {name: float(found.p_values[k])}
    return replace(now, p_values=p, evidence=now.evidence | {name: float(found.log_bayes[k])})


def _price(found: Scored, k: int) -> float:
    """What a hypothesis's log evidence is below half its statistic."""
    return 0.5 * found.scores[k].statistic / found.scale.variance - float(found.log_bayes[k])


def set_evidence(now: Search, found: Scored) -> float:
    """Log evidence of the accepted effects (BIC), with the price of choosing them."""
    count = sum(len(h.parameters) for h in now.accepted)
    price = len(now.accepted) * float(np.log(len(now.candidates.hypotheses)))
    return -0.5 * (now.fit.chi2 / found.scale.variance + count * float(np.log(found.linear.used))) - price


def confirmed_only(now: Search) -> Search:
    """The search without effects of little evidence that do not help rows held out, the weakest first."""
    while True:
        weak = [h for h in now.accepted if now.evidence[h.name] < WEAK and not held_out_gain(now, h).confirmed]
        if not weak:
            return now
        worst = min(weak, key=lambda h: now.evidence[h.name])
        rest = replace(now, accepted=tuple(h for h in now.accepted if h != worst))
        fit = refit(rest, {})
        if fit is None:
            return now
        now = replace(rest, fit=fit)


def settled_evidence(now: Search, hypothesis: Hypothesis, found: Scored) -> Array:
    """Log evidence (H,) of an accepted effect (first) and all open ones in its place; `found`: scored without it.

    With what they gain by shapes of their own; where scores and fits disagree, fits decide.
    """
    evidence = found.log_bayes + shape_gains(now, found)
    order = np.argsort(-evidence, kind="stable")
    if order[0] != 0:
        better = [int(k) for k in order[:RIVALS] if k != 0]
        evidence[better] = [_fitted_evidence(now, hypothesis, found, evidence, k) for k in better]
    return evidence


def credible_set(found: Scored, evidence: Array) -> tuple[Rival, ...]:
    """The smallest set of hypotheses that holds 95 % of the evidence (H,) in place of an accepted one, best first."""
    order = np.argsort(-evidence, kind="stable")
    weight = np.exp(evidence - evidence.max()) / np.exp(evidence - evidence.max()).sum()
    last = int(np.searchsorted(np.cumsum(weight[order]), CREDIBLE)) + 1
    chosen = order[:last]
    cosines = _cosines(found.linear, found, 0, [int(k) for k in chosen])
    return tuple(Rival(found.hypotheses[k], float(weight[k]), c) for k, c in zip(chosen, cosines, strict=True))


def _fitted_evidence(now: Search, hypothesis: Hypothesis, found: Scored, evidence: Array, k: int) -> float:
    """Evidence of rival number k from a fit with it, against that of the accepted effect (number 0); no more than its
    score says."""
    rival = found.hypotheses[k]
    after = replace(now, accepted=(*(h for h in now.accepted if h != hypothesis), rival))
    fit = refit(after, {rival: found.scores[k].estimate * found.linear.scale_of(rival.parameters)})
    if fit is None:
        return min(float(evidence[k]), float(evidence[0]))
    gain = 0.5 * (now.fit.chi2 - fit.chi2) / found.scale.variance + _price(found, 0) - _price(found, k)
    return min(float(evidence[k]), float(evidence[0]) + gain)


def _cosines(linear: Linear, found: Scored, one: int, others: Sequence[int]) -> list[float]:
    """Cosines between what one hypothesis explains and what others could, declared parameters projected out."""
    basis = linear.free(_basis(linear, found, one))
    return [min(float(np.linalg.norm(_basis(linear, found, int(k)).T @ basis, 2)), 1.0) for k in others]


def _basis(linear: Linear, found: Scored, k: int) -> Array:
    """Columns (n, m) of a hypothesis, orthonormal in the metric of what is left after projection."""
    score = found.scores[k]
    return np.asarray(linear.of(found.hypotheses[k].parameters) @ score.basis / np.sqrt(score.information))
