"""After the search: is each accepted effect confirmed, and which others could stand in its place?"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.diagnosis.alikeness import cosines
from pkmcal_cli.diagnosis.beyond_range import begun_beyond
from pkmcal_cli.diagnosis.confirm import held_out_gain
from pkmcal_cli.diagnosis.hypotheses import RELEASE, Hypothesis
from pkmcal_cli.diagnosis.refits import refit
from pkmcal_cli.diagnosis.score import log_evidence
from pkmcal_cli.diagnosis.scoring import Scored, Search, score_without, shape_gains
from pkmcal_cli.diagnosis.search import ranked, stands_on_one_row
from pkmcal_cli.diagnosis.warming import alike_in_time, fits_as_well

RIVALS = 4
_FITS = 12  # with others in the place of an accepted effect, at most
_SAME = 0.99999  # cosine at which an effect is another name for a parameter beside what was found
CREDIBLE = 0.95


@dataclass(frozen=True)
class Rival:
    """A hypothesis that could stand in the place of an accepted one, and its weight among all."""

    hypothesis: Hypothesis
    weight: float
    cosine: float  # of the angle between the two, declared parameters and other effects projected out


@dataclass(frozen=True)
class RunnerUp:
    """The best hypothesis that the data do not support in the place of an accepted one; log odds against it."""

    hypothesis: Hypothesis
    log_odds: float


def gain(search: Search, after: Search, scores: Scored, k: int) -> float:
    """Log evidence that rival k gains, fitted in place of the accepted effect (0)."""
    fall = 0.5 * (search.fit.chi2 - after.fit.chi2) / scores.scale.variance
    return fall + _price(scores, 0) - _price(scores, k)


def preferences(scores: Scored) -> Array:
    """Log evidence (H,) by which hypotheses go before others."""
    return np.array([h.preference for h in scores.hypotheses])


def renamed(search: Search, scores: Scored, k: int) -> Search:
    """The search with p value and evidence of hypothesis k as they were scored."""
    name = scores.hypotheses[k].name
    p = search.p_values | {name: float(scores.p_values[k])}
    return replace(search, p_values=p, evidence=search.evidence | {name: float(scores.log_bayes[k])})


def _price(scores: Scored, k: int) -> float:
    """What a hypothesis's log evidence is below half its statistic; of one that scores tell nothing of, with as large a
    statistic as any has."""
    if not scores.scores[k].count:
        most = max(s.statistic for s in scores.scores) / scores.scale.variance
        return 0.5 * most - float(log_evidence(np.array(most), np.array(len(scores.hypotheses[k].unknown))))
    return 0.5 * scores.scores[k].statistic / scores.scale.variance - float(scores.log_bayes[k])


def confirmed_only(search: Search) -> Search:
    """The search without effects with which rows held out are predicted worse, the weakest first.

    One of its credible set that does help takes an effect's place. What was dropped does not come back.
    """
    dropped: set[Hypothesis] = set()
    while True:
        refuted = [h for h in search.near if held_out_gain(search, h).contradicts]
        if not refuted:
            return declared_first(search)
        worst = min(refuted, key=lambda h: search.evidence[h.name])
        dropped.add(worst)
        better = _confirmed_rival(search, worst, dropped)
        if better is None:
            others = search.accepting((), [worst])
            fit = refit(others, {})
            if fit is None:
                return search
            better = replace(others, fit=fit, vetoed=(*search.vetoed, worst))
        search = better


def declared_first(search: Search) -> Search:
    """The search in which a parameter that the machine file names and holds stands for an effect of one number that is
    another name for it beside what else was found: two zeros are one zero and the zero of all."""
    for h in (h for h in search.near if h.effect != RELEASE and len(h.parameters) == 1 and not h.begin):
        opened = [o for o in search.open_without([h]) if o.effect == RELEASE]
        scores = score_without(search, [h], (h, *opened))
        alike = cosines(scores.linear, scores.hypotheses, scores.scores, 0, range(len(scores.hypotheses)))
        for k in (k for k in range(1, len(alike)) if alike[k] > _SAME and not scores.unusual[k]):
            after = replaced(search, h, scores, k)
            if after is not None and gain(search, after, scores, k) + scores.hypotheses[k].preference > h.preference:
                return declared_first(renamed(after, scores, k))
    return search


def _confirmed_rival(search: Search, hypothesis: Hypothesis, dropped: Collection[Hypothesis]) -> Search | None:
    """The search with another of the credible set, which is significant and helps rows held out; None without one."""
    near = set_of(search, hypothesis)
    without = near.without
    for rival in near.rivals[: RIVALS + 1]:
        k = without.hypotheses.index(rival.hypothesis)
        if rival.hypothesis in dropped or not without.p_values[k] < search.critical:
            continue
        after = replaced(search, hypothesis, without, k)
        if after is not None and not held_out_gain(after, rival.hypothesis).contradicts:
            return renamed(after, without, k)
    return None


def replaced(search: Search, hypothesis: Hypothesis, scores: Scored, k: int) -> Search | None:
    """The search fitted with rival k in place of an accepted effect; None where it cannot be, or stands on one row."""
    if stands_on_one_row(scores, k):
        return None
    offsets = scores.scores[k].estimate * scores.linear.scale_of(scores.hypotheses[k].parameters)
    rival = begun_beyond(scores.hypotheses[k], scores.scores[k], offsets, search.null, search.problem)
    after = search.accepting([rival], [hypothesis])
    fit = refit(after, {rival: offsets})
    return None if fit is None else replace(after, fit=fit)


def final_evidence(search: Search, hypothesis: Hypothesis, scores: Scored) -> Array:
    """Log evidence (H,) of an accepted effect (first) and all open ones in its place; `scores`: scored without it.

    With what they gain by shapes of their own; where scores and fits disagree, fits decide: of the best, and of all
    that are ahead of the accepted one. Of one so far off that scores tell nothing of it, fits alone tell.
    """
    shape = shape_gains(search, scores)
    evidence = scores.log_bayes + shape + preferences(scores)
    best, seen = ranked(evidence)[:RIVALS].tolist(), {0}
    if best[0] == 0:
        return evidence
    if not np.isfinite(evidence[0]):
        evidence[0] = evidence.max()
    while len(seen) <= _FITS:
        better = np.nonzero(evidence > evidence[0])[0]
        ahead = [k for k in (*best, *better[ranked(evidence[better])].tolist()) if k not in seen]
        if not ahead:
            return evidence
        by_fit = evidence[0] + _fitted_gain(search, hypothesis, scores, shape + preferences(scores), ahead[0])
        evidence[ahead[0]] = min(evidence[ahead[0]], by_fit)
        seen.add(ahead[0])
    unseen = [k for k in range(len(evidence)) if k not in seen]
    evidence[unseen] = np.minimum(evidence[unseen], evidence[0])
    return evidence


@dataclass(frozen=True)
class CredibleSet:
    """What could stand in the place of an accepted effect, best first; all hypotheses scored `without` it, and their
    log evidence (H,)."""

    rivals: tuple[Rival, ...]
    without: Scored
    evidence: Array

    @property
    def members(self) -> tuple[Hypothesis, ...]:
        """The hypotheses."""
        return tuple(r.hypothesis for r in self.rivals)

    @property
    def runner_up(self) -> RunnerUp | None:
        """The best of those that are not in it; None of none. Other places of an accepted group are no other cause."""
        accepted, others = self.without.hypotheses[0], self.without.hypotheses
        left = [k for k, h in enumerate(others) if h not in self.members and not h.akin(accepted)]
        best = max(left, key=lambda k: float(self.evidence[k]), default=None)
        if best is None or not np.isfinite(self.evidence[[0, best]]).all():
            return None
        return RunnerUp(others[best], float(self.evidence[0] - self.evidence[best]))


def rivals_of(search: Search, hypothesis: Hypothesis) -> tuple[Rival, ...]:
    """The set of an accepted effect, also of one that is far off."""
    if hypothesis.name in search.far_off:
        return tuple(Rival(h, weight, 1.0) for h, weight in search.far_off[hypothesis.name].rivals)
    return set_of(search, hypothesis).rivals


def set_of(search: Search, hypothesis: Hypothesis) -> CredibleSet:
    """The set of an accepted effect, judged where the search has come to."""
    without = score_without(search, [hypothesis], (hypothesis, *search.open_without([hypothesis])))
    evidence = final_evidence(search, hypothesis, without)
    statistic = np.array([s.statistic for s in without.scores])
    kept = fits_as_well(statistic, float(statistic[0]), without.scale.variance)
    kept &= alike_in_time(search.problem, hypothesis, without.hypotheses)  # no evidence decides between them
    return CredibleSet(credible_set(without, evidence, kept), without, evidence)


def credible_set(scores: Scored, evidence: Array, kept: NDArray[np.bool_]) -> tuple[Rival, ...]:
    """The smallest set of hypotheses that holds 95 % of the evidence (H,) in place of an accepted one, best first.

    The accepted one (first) and those kept (H,) are in it at any rate. Where a part has as much evidence as the group,
    the part stands for it.
    """
    same = [k > 0 and h.name == scores.hypotheses[0].name for k, h in enumerate(scores.hypotheses)]
    needless = same | _needless_groups(scores.hypotheses, evidence)
    evidence = np.where(needless, -np.inf, evidence)
    order = ranked(evidence)
    weight = np.exp(evidence - evidence.max()) / np.exp(evidence - evidence.max()).sum()
    last = int(np.searchsorted(np.cumsum(weight[order]), CREDIBLE)) + 1
    chosen = [*order[:last], *(k for k in order[last:] if k == 0 or (kept[k] and not needless[k]))]
    alike = cosines(scores.linear, scores.hypotheses, scores.scores, 0, [int(k) for k in chosen])
    return tuple(Rival(scores.hypotheses[k], float(weight[k]), c) for k, c in zip(chosen, alike, strict=True))


def _needless_groups(hypotheses: Sequence[Hypothesis], evidence: Array) -> NDArray[np.bool_]:
    """Of which hypotheses (H,), but the accepted one (first), something of the same effect has as much evidence."""
    needless = np.zeros(len(hypotheses), dtype=bool)
    for k in (k for k, h in enumerate(hypotheses) if h.members and k > 0):
        group = hypotheses[k]
        parts = [len(h.members) < len(group.members) and h.akin(group) for h in hypotheses]
        needless[k] = evidence[parts].max(initial=-np.inf) >= evidence[k]
    return needless


def _fitted_gain(search: Search, hypothesis: Hypothesis, scores: Scored, shape: Array, k: int) -> float:
    """By how much more log evidence rival k has than the accepted effect (0), by a fit with it; 0 where there is none.

    shape (H,): what each gains by a shape of its own, and by what goes before others.
    """
    after = replaced(search, hypothesis, scores, k)
    return 0.0 if after is None else gain(search, after, scores, k) + float(shape[k] - shape[0])
