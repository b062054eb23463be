"""Detection, identification, adaptation: calibrate, score, accept the best, refit, until nothing is left."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.base.stages import Stage
from pkmcal_cli.diagnosis.alikeness import cosines
from pkmcal_cli.diagnosis.alpha import Alpha
from pkmcal_cli.diagnosis.beyond_range import begun_beyond, improbability
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.model_discrepancy import discrepancy_columns
from pkmcal_cli.diagnosis.outlying_rows import MOST
from pkmcal_cli.diagnosis.refits import recalibrated, refit
from pkmcal_cli.diagnosis.score import log_evidence
from pkmcal_cli.diagnosis.scoring import (
    Scored,
    Search,
    linear_without,
    score_all,
    score_without,
    scored_by,
    shape_gains,
)
from pkmcal_cli.diagnosis.search_options import SearchOptions
from pkmcal_cli.diagnosis.threshold import critical_p, effective_tests, smallest_p

MOST_EFFECTS = 5
ODD_ROW = 0.01  # p value that an effect must keep without the row that speaks most for it
BETTER = 0.5  # log evidence by which another set of effects must be better
_BRANCHES = 4  # ends of a search that are followed
_DIGITS = 6  # of a log evidence; the rest is rounding, which must not decide between names of one thing
_UNDECIDED, _SAME = 1.0, 0.999  # log evidence between two that are both followed; cosine of those that are the same
_CONTENDERS, _CLOSE = 4, 8.0  # hypotheses within so much log evidence of the best are fitted before one is accepted


def run_search(search: Search, options: SearchOptions) -> Search:
    """Accept effects and take out rows until nothing significant is left."""
    options.observe(Stage("search"))
    scored = score_all(search, search.open)
    every = [part for h in search.open for part in h.nested_parts]
    columns = [scored.linear.tested(h) for h in every]
    draws = smallest_p(scored.linear, columns, scored.linear.scores_of(every), options.seed)
    search = replace(search, critical=critical_p(draws, options.parts.catalogue), tests=effective_tests(draws))
    return _followed(search, options, scored.scale.variance)


def _followed(search: Search, options: SearchOptions, variance: float) -> Search:
    """The end of the search that has most evidence: what cannot be decided at a step is followed both ways."""
    begun, seen, ends = [search], {search.state}, list[Search]()
    while begun:
        search = begun.pop(0)
        options.observe(Stage("search", len(seen)))
        new = [s for s in _advanced(search, score_all(search, search.open), options.parts) if s.state not in seen]
        room = max(_BRANCHES - len(begun) - len(ends), 1)
        begun += new[:room]
        seen |= {s.state for s in new}
        ends += [] if new else [search]
    return max(ends, key=lambda s: set_evidence(s, variance))


def ranked(evidence: Array) -> NDArray[np.intp]:
    """Hypotheses (H,) by their log evidence (H,), most first; of equals the first of the catalogue."""
    return np.argsort(-np.round(evidence, _DIGITS), kind="stable")


def set_evidence(search: Search, variance: float) -> float:
    """Log evidence (BIC) of accepted effects and of rows taken out, with noise of some variance, and with the price of
    choosing them; a row taken out is a free shift of its readings."""
    rows = list(search.bad_rows)
    shifts = int(np.isfinite(search.problem.readings[rows]).sum())
    count = shifts + sum(len(h.parameters) for h in search.accepted)
    likelihood = search.fit.chi2 / variance + count * float(np.log(max(search.problem.count + shifts, 1)))
    price = len(rows) * float(np.log(len(search.problem)))
    before = sum(h.preference for h in search.accepted)
    before += improbability(search.problem, search.near, search.fit.values, search.null)
    return -0.5 * likelihood - price - search.price(search.accepted) + before


def _advanced(search: Search, scored: Scored, alpha: Alpha) -> list[Search]:
    """One acceptance: rows where they have more evidence, else the best effects; none where nothing is left."""
    rows = _bad_rows(search, scored, alpha)
    evidence = np.where(scored.p_values < search.critical, scored.log_bayes, -np.inf)
    evidence[[h.name in search.refused for h in scored.hypotheses]] = -np.inf
    within_range = np.where(scored.unusual, -np.inf, evidence)
    evidence = (
        within_range if within_range.max(initial=-np.inf) > 0 else evidence
    )  # what is far beyond its range comes last
    best = int(np.argmax(evidence)) if len(evidence) else -1
    most = float(evidence[best]) if best >= 0 else -np.inf
    if len(rows) and float(scored.rows.log_bayes(scored.linear.used)[rows].max()) > most:
        return [_without_rows(search, rows)]
    if most <= 0.0 or len(search.accepted) >= MOST_EFFECTS:
        return []
    return [needed_only(s) for s in _best_of(search, scored, evidence)]


def _best_of(search: Search, scored: Scored, evidence: Array) -> list[Search]:
    """The contenders that are best once they have been fitted: scores are linear, and a refit may turn them round.

    Those that are as good as the best, unless they are the same by another name.
    """
    shape = shape_gains(search, scored) + [h.preference for h in scored.hypotheses]
    evidence = evidence + shape
    order = ranked(evidence)[:_CONTENDERS]
    trials = []
    for k in (int(k) for k in order if evidence[k] > max(evidence[order[0]] - _CLOSE, 0.0)):
        if _is_discrepancy(search, scored, k) or stands_on_one_row(scored, k):
            search = replace(search, refused=search.refused | {scored.hypotheses[k].name})
            continue
        after = _accepted(search, scored, k)
        if after is None:
            search = replace(search, refused=search.refused | {scored.hypotheses[k].name})
            continue
        gain = np.array((search.fit.chi2 - after.fit.chi2) / scored.scale.variance)
        trials.append((float(shape[k] + log_evidence(gain, np.array(scored.scores[k].count))), k, after))
    if not trials:
        return [search]
    trials.sort(key=lambda trial: (-round(trial[0], _DIGITS), trial[1]))  # of equals the first of the catalogue
    near = [k for gain, k, _ in trials if gain > trials[0][0] - _UNDECIDED]
    alike = cosines(scored.linear, scored.hypotheses, scored.scores, near[0], near)
    kept = [trial for trial, c in zip(trials, alike, strict=False) if trial[1] == near[0] or c < _SAME]
    return [replace(after, refused=frozenset()) for _, _, after in kept]  # beside it others may be right


def needed_only(search: Search) -> Search:
    """The search without effects that those accepted later have made needless."""
    for hypothesis in (h for h in search.near if h != search.accepted[-1]):
        kept = [h for h in search.accepted if h != hypothesis]
        least = search.price(search.accepted) - search.price(kept) - BETTER
        without = score_without(search, [hypothesis], [hypothesis])
        gain = float(without.log_bayes[0])
        if gain >= least or without.p_values[0] <= search.critical:
            continue
        if gain + float(shape_gains(search, without)[0]) < least:
            others = search.accepting((), [hypothesis])
            fit = refit(others, {}, search.fit.chi2)
            others = others if fit is None else replace(others, fit=fit)
            variance = without.scale.variance
            if fit is not None and set_evidence(others, variance) > set_evidence(search, variance) - BETTER:
                return needed_only(others)
    return search


def _is_discrepancy(search: Search, scored: Scored, best: int) -> bool:
    """Whether a hypothesis is significant only as long as accepted effects have no free shape, which explains more.

    A richer shape of the same place is no model discrepancy: it has a name. A group that goes beyond that place is one
    unless its other members speak for it.
    """
    hypothesis = scored.hypotheses[best]
    places = {p.at for p in hypothesis.placed}
    others = [h for h in search.accepted if not places <= {p.at for p in h.placed}]
    extra = discrepancy_columns(search.problem, search.fit, others, search.known)
    if not extra.shape[1]:
        return False
    free = scored.linear.projecting(scored.linear.projected, extra=scored.linear.whitened(extra))
    score = free.score_of(hypothesis)
    insignificant = scored.scale.p_of(score) > search.critical
    if score.count and not (insignificant and score.statistic < 0.5 * scored.scores[best].statistic):
        return False
    price = search.price([*search.accepted, hypothesis]) - search.price(search.accepted)
    return bool(_evidence_of_shapes(search, others, scored) >= scored.log_bayes[best] - price)


def _evidence_of_shapes(search: Search, effects: Sequence[Hypothesis], near: Scored) -> float:
    """Log evidence that accepted effects deviate from their formulas, all together, by the noise that is left with
    them (`near`); without bound for far-off ones."""
    if not set(effects) <= set(search.near):
        return np.inf
    gained = 0.0
    for effect in effects:
        linear = linear_without(search, [effect], [effect]).prewhitened(near.linear.memory)
        gained += float(shape_gains(search, scored_by(near.scale, linear, [effect]))[0])
    return gained


def stands_on_one_row(scored: Scored, k: int) -> bool:
    """Whether a hypothesis is nothing without the row that speaks most for it: then the row is odd, not the machine.

    Or without a reading of the bench.
    """
    linear, score = scored.linear, scored.scores[k]
    signature = linear.tested(scored.hypotheses[k]) @ score.estimate
    piece = int(np.argmax(np.bincount(linear.pieces.ravel(), signature * linear.unexplained)))
    return scored.scale.p_of(linear.without([piece]).score_of(scored.hypotheses[k])) > ODD_ROW


def _bad_rows(search: Search, scored: Scored, alpha: Alpha) -> NDArray[np.intp]:
    """Rows to take out now: significant ones, of the size of the worst; none beyond the largest share."""
    room = max(int(MOST * len(search.problem)), 1) - len(search.bad_rows)
    p = scored.rows.p_value
    chosen = np.nonzero(p < alpha.rows / len(p))[0]
    if not len(chosen) or room <= 0:
        return np.zeros(0, dtype=np.intp)
    size = scored.rows.statistic[chosen]
    order = np.argsort(-size)
    chosen = chosen[order][size[order] > 0.25 * size.max()]
    return np.asarray(chosen[:room])


def _without_rows(search: Search, rows: NDArray[np.intp]) -> Search:
    """The same without some rows, calibrated again."""
    bad = tuple(int(r) for r in rows)
    return recalibrated(replace(search, problem=search.problem.without(bad), bad_rows=(*search.bad_rows, *bad)))


def _accepted(search: Search, scored: Scored, best: int) -> Search | None:
    """The same with one more effect; None if a fit with it fails or is not better."""
    hypothesis, score = scored.hypotheses[best], scored.scores[best]
    offsets = score.estimate * scored.linear.scale_of(hypothesis.parameters)
    hypothesis = begun_beyond(hypothesis, score, offsets, search.null, search.problem)
    after = search.accepting([hypothesis])
    expected = max(search.fit.chi2 - score.statistic, float(search.fit.dof))
    fit = refit(after, {hypothesis: offsets}, expected)
    if fit is None or not search.fit.chi2 - fit.chi2 > 0.25 * score.statistic:
        return None
    name = hypothesis.name  # of which a part may have been accepted before
    p, gain = float(scored.p_values[best]), float(scored.log_bayes[best])
    p_values = search.p_values | {name: min(p, search.p_values.get(name, 1.0))}
    evidence = search.evidence | {name: gain + search.evidence.get(name, 0.0)}
    return replace(after, fit=fit, p_values=p_values, evidence=evidence)
