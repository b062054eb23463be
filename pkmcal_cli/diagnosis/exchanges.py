"""Exchanges at the end of a search: accepted effects replaced by others, one or two at a time, if that is better."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.refine import RIVALS, gain, preferences, renamed, replaced
from pkmcal_cli.diagnosis.refits import refit
from pkmcal_cli.diagnosis.score import log_evidence
from pkmcal_cli.diagnosis.scoring import Scored, Search, score_all, score_without, scored_beside, shape_gains
from pkmcal_cli.diagnosis.search import BETTER, MOST_EFFECTS, needed_only, ranked, set_evidence

_TRIALS, _FITS = 3, 10  # exchanges that are fitted in place of one or two effects, and in all
_ASTRAY, _LOST = 1.5, 2  # times the chi-square before, at which a fit went astray; such fits of an effect that is lost
_DIGITS = 6  # of a log evidence; the rest is rounding
_Way = tuple[float, tuple[Hypothesis, ...]]  # effects that could stand for others, with their log evidence


@dataclass(frozen=True)
class _Tried:
    """Sets of effects that are not better, and in how many fits that went astray effects were, or 0 since one did not.

    Where the equilibrium changes much, as with a rope that goes slack, no score tells what a fit does.
    """

    sets: set[frozenset[Hypothesis]] = field(default_factory=set)
    astray: dict[str, int] = field(default_factory=dict)

    def add(self, after: Search, new: Sequence[Hypothesis], astray: bool) -> None:
        """Remembers a fit with new effects."""
        self.sets.add(frozenset(after.accepted))
        self.astray.update({h.name: self.astray.get(h.name, 0) + 1 if astray else 0 for h in new})

    def excludes(self, after: Search, new: Sequence[Hypothesis]) -> bool:
        """Whether a set was tried or is too large, fits with one of its new effects go astray, or enough was tried."""
        lost = any(self.astray.get(h.name, 0) >= _LOST for h in new)
        enough = len(self.sets) >= _FITS or len(after.accepted) > MOST_EFFECTS
        return lost or enough or frozenset(after.accepted) in self.sets


def swapped(search: Search) -> Search:
    """The search with effects exchanged for others, one or two at a time, while that raises the evidence of all.

    Each exchange is judged by the scale of the noise without what it removes, which a strong effect makes large; where
    it led to, by that with all that was there. The furthest of these places counts that has no less evidence.
    """
    variance = score_all(search, ()).scale.variance
    least = set_evidence(search, variance) - BETTER
    return next((s for s in reversed([*_walk(search)]) if set_evidence(s, variance) > least), search)


def _walk(search: Search) -> Iterator[Search]:
    """Where single exchanges lead to, one after the other."""
    tried = _Tried()
    for _ in range(2 * len(search.near)):
        single = sorted(((h,) for h in search.near), key=_doubt)
        removed = (*single, *combinations(search.near, 2))
        better = next((s for some in removed if (s := _exchanged(search, some, tried))), None)
        better = better or next((s for h in search.near if (s := _improved(search, h)) is not None), None)
        if better is None:
            return
        search = needed_only(better)
        yield search


def _doubt(some: tuple[Hypothesis]) -> tuple[bool, bool]:
    """Order in which effects are doubted: what is beyond its range was accepted last; then groups."""
    return not some[0].begin, not some[0].members


def _improved(search: Search, hypothesis: Hypothesis) -> Search | None:
    """The search with this effect replaced, if that is better; None if not."""
    without = score_without(search, [hypothesis], (hypothesis, *search.open_without([hypothesis])))
    shape = shape_gains(search, without) + preferences(without)
    shaped = without.log_bayes + shape
    order, unusual = ranked(shaped[1:])[:RIVALS] + 1, without.unusual
    for k in (int(k) for k in order if shaped[k] > shaped[0] + BETTER and not unusual[k]):
        after = replaced(search, hypothesis, without, k)
        if after is not None and gain(search, after, without, k) + shape[k] - shape[0] > BETTER:
            return renamed(after, without, k)
    return None


def _exchanged(search: Search, removed: tuple[Hypothesis, ...], tried: _Tried) -> Search | None:
    """The search with one or two effects replaced by one or two that explain most without, if that is better.

    `all` accepted first, and then what is wrong about it, stands for two single places; so does a group, which goes
    where two places, or those of its members that are needed, do as well. What is tried here is added to `tried`.
    """
    opened = search.open_without(removed)
    without = score_without(search, removed, (*removed, *opened))
    margin = _margin(search, without, removed)
    least = _evidence_of(without, removed) - search.price(search.accepted) + margin
    ways = (*_some_members(search, without, removed), *_pairs(search, without, removed, opened))
    priced = [(evidence - search.price(search.accepting(new, removed).accepted), new) for evidence, new in ways]
    for new in _likely([way for way in priced if set(way[1]) != set(removed)], least):
        after = search.accepting(new, removed)
        if tried.excludes(after, new):
            continue
        fit = refit(after, {})
        tried.add(after, new, fit is None or fit.chi2 > _ASTRAY * search.fit.chi2)
        after = after if fit is None else replace(after, fit=fit)
        variance = without.scale.variance
        if fit is not None and set_evidence(after, variance) >= set_evidence(search, variance) + margin:
            named = [h.name for h in without.hypotheses]
            for h in new:
                after = renamed(after, without, named.index(h.name))
            return after
    return None


def _margin(search: Search, without: Scored, removed: tuple[Hypothesis, ...]) -> float:
    """Log evidence by which others must be better; below 0 where an effect is given up for others that are as good.

    What two explain beyond one effect may be that effect's shape.
    """
    if len(removed) > 1:
        return BETTER
    if removed[0].members or removed[0].begin:
        return -BETTER
    return BETTER + float(shape_gains(search, without, slice(1))[0])


def _some_members(search: Search, without: Scored, removed: tuple[Hypothesis, ...]) -> Iterator[_Way]:
    """Of a single group three or more of its members that are all significant: each time without that which explains
    least."""
    if len(removed) > 1 or not removed[0].members:
        return
    group, linear = removed[0], without.linear
    while len(group.members) > 3:
        smaller = [group.without(m) for m in group.members]
        scores = linear.scores_of(smaller)
        best = max(range(len(smaller)), key=lambda k: round(scores[k].statistic, _DIGITS))
        group, score = smaller[best], scores[best]
        singles = tuple(h for m in group.members for h in without.hypotheses if h.name == m.name)
        if len(singles) == len(group.members) and all(_is_needed(search, without, group, m) for m in group.members):
            evidence = log_evidence(np.array(score.statistic / without.scale.variance), np.array(score.count))
            yield float(evidence), singles


def _is_needed(search: Search, without: Scored, group: Hypothesis, member: Hypothesis) -> bool:
    """Whether a member of a group is significant beside the others."""
    beside = scored_beside(without, group.without(member), [member])
    return bool(beside.p_values[0] < search.critical)


def _likely(ways: Iterable[_Way], least: float) -> list[tuple[Hypothesis, ...]]:
    """Those with most log evidence that have enough, most first."""
    enough = sorted((way for way in ways if way[0] >= least), key=lambda way: -round(way[0], _DIGITS))
    return [effects for _, effects in enough[:_TRIALS]]


def _pairs(
    search: Search, without: Scored, removed: tuple[Hypothesis, ...], opened: tuple[Hypothesis, ...]
) -> Iterator[_Way]:
    """Single effects with most log evidence, each by itself and with the best second one beside it."""
    evidence = _eligible(without)
    if len(removed) == 1:
        evidence[[h.parameters == removed[0].parameters for h in without.hypotheses]] = -np.inf
    for k in (int(k) for k in ranked(evidence)[:RIVALS] if evidence[k] > -np.inf):
        first = without.hypotheses[k]
        yield float(evidence[k]), (first,)
        beside = scored_beside(without, first, [h for h in opened if h.name != first.name])
        more = _eligible(beside)
        more[[h.akin(first) for h in beside.hypotheses]] = -np.inf  # a group has what its members have
        more[beside.p_values >= search.critical] = -np.inf
        best = int(ranked(more)[0])
        if more[best] > 0:
            yield float(evidence[k] + more[best]), (first, beside.hypotheses[best])


def _eligible(scores: Scored) -> Array:
    """Log evidence (H,) of hypotheses, with what goes before; none far beyond its range takes another's place."""
    return np.where(scores.unusual, -np.inf, scores.log_bayes + preferences(scores))


def _evidence_of(without: Scored, removed: tuple[Hypothesis, ...]) -> float:
    """Log evidence of accepted effects, counted as that of others: the first by itself, the other beside it."""
    if len(removed) == 1:
        return float(without.log_bayes[0]) + removed[0].preference
    ways = []
    for first, second in (removed, removed[::-1]):
        beside, k = scored_beside(without, first, [second]), without.hypotheses.index(first)
        ways.append(without.log_bayes[k] + first.preference + beside.log_bayes[0] + second.preference)
    return float(max(ways))
