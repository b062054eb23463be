"""Where a search has come to, all hypotheses scored there, and fits with what was accepted."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from math import comb

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.prior import Prior, joined
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.diagnosis.best_fit import BestFit
from pkmcal_cli.diagnosis.beyond_range import unheld
from pkmcal_cli.diagnosis.groups import group_columns
from pkmcal_cli.diagnosis.hypotheses import Candidates, Hypothesis, beside_unknown_sides
from pkmcal_cli.diagnosis.known_results import KnownResults
from pkmcal_cli.diagnosis.linear import Linear, linear_problem
from pkmcal_cli.diagnosis.model_discrepancy import own_discrepancies, own_discrepancy
from pkmcal_cli.diagnosis.noise_tests import independent, noise_scale, p_values_beside
from pkmcal_cli.diagnosis.outlying_rows import RowScores, row_scores
from pkmcal_cli.diagnosis.scale import Scale
from pkmcal_cli.diagnosis.score import UNUSUAL, Score, log_evidence
from pkmcal_cli.diagnosis.shown_kind import ShownKind
from pkmcal_cli.model.effect_sites import PlacedEffect

_NEAR_BEST = 30.0  # log evidence that a free shape can make up for


@dataclass(frozen=True, kw_only=True)
class Scored:
    """All hypotheses scored at one solution; `p_values`, `log_bayes` (H,)."""

    linear: Linear
    scale: Scale
    hypotheses: tuple[Hypothesis, ...]
    scores: tuple[Score, ...]
    p_values: Array
    log_bayes: Array
    plain: Linear  # before successive rows were made independent

    @cached_property
    def rows(self) -> RowScores:
        """Scores of the single rows."""
        return row_scores(self.plain, self.plain.on, self.scale)

    @property
    def unusual(self) -> NDArray[np.bool_]:
        """Which (H,) come last: what nothing could show within its range, and groups far beyond theirs."""
        pairs = zip(self.hypotheses, self.scores, strict=True)
        return np.array([s.far or (bool(h.members) and s.size > UNUSUAL) for h, s in pairs], dtype=bool)


@dataclass(frozen=True, kw_only=True)
class FarOff:
    """Of a far-off effect: offsets, SI, of declared parameters without it; rivals: those that a nonlinear fit does not
    tell from it, itself among them, by weight; absorbed: the fit without it, where parameters take up all of it."""

    offsets: Mapping[str, float]
    rivals: tuple[tuple[Hypothesis, float], ...]
    absorbed: Fit | None = None


@dataclass(frozen=True, kw_only=True)
class NamelessShape:
    """A displacement without a name that is in the fit; `evidence`: its log evidence, over that of what it replaced.

    places: where it may be, with weights; `best_fit`: what it hides in parameters; `named`: the effect that it is.
    """

    placed: PlacedEffect
    evidence: float
    places: tuple[tuple[str, float], ...]
    best_fit: BestFit
    named: Hypothesis | None = None

    @property
    def hypothesis(self) -> Hypothesis:
        """`unexplained@PLACE`, with the weights of its shape."""
        return Hypothesis(effect=self.placed.effect.keyword, at=self.placed.at, parameters=self.placed.parameters)

    @property
    def prior(self) -> Prior:
        """Weights of unit variance."""
        return Prior(self.placed.parameters, np.eye(len(self.placed.parameters)), np.zeros(len(self.placed.parameters)))

    def beside(self, problem: Problem) -> Problem:
        """A problem of a model that has it, with its prior."""
        if problem.prior is not None and set(self.prior.names) <= set(problem.prior.names):
            return problem
        return replace(problem, prior=self.prior if problem.prior is None else joined(problem.prior, self.prior))


@dataclass(frozen=True, kw_only=True)
class Search:
    """Where the search has come to: the problem without the rows taken out or left out, its fit, what was accepted."""

    candidates: Candidates
    problem: Problem
    declared: tuple[str, ...]
    fit: Fit
    accepted: tuple[Hypothesis, ...] = ()
    refused: frozenset[str] = frozenset()
    vetoed: tuple[Hypothesis, ...] = ()  # that explain what was fitted, and nothing that was not
    bad_rows: tuple[int, ...] = ()
    failed: Mapping[int, str] = field(default_factory=dict)  # why rows that nothing predicts are left out
    inflation: float = 1.0  # variances over those by the weights alone, of a robust loss
    p_values: dict[str, float] = field(default_factory=dict)
    evidence: dict[str, float] = field(default_factory=dict)
    critical: float = 0.0
    tests: float = 0.0
    far_off: Mapping[str, FarOff] = field(default_factory=dict)  # by name, among the accepted effects
    untried: tuple[str, ...] = ()  # effects that may be far off, but were too many to try
    shapes: tuple[NamelessShape, ...] = ()  # that stand for what has no name
    shown: ShownKind | None = None  # of which errors are told; None: that which stands out at a fit
    known: KnownResults = field(default_factory=KnownResults, compare=False)

    @property
    def selected(self) -> tuple[str, ...]:
        """Parameters that are identified: the declared and those of accepted effects, but for what is known of them."""
        extra = {name for h in self.accepted for name in h.unknown}
        every = set(self.declared) | extra | {name for shape in self.shapes for name in shape.placed.parameters}
        return tuple(n for n in self.problem.model.names if n in every)

    @property
    def state(self) -> tuple[frozenset[str], frozenset[int], frozenset[str]]:
        """What tells it from where it was before: effects, rows taken out, what was refused."""
        return frozenset(h.name for h in self.accepted), frozenset(self.bad_rows), self.refused

    @property
    def start(self) -> Array:
        """Values (P,), SI, that a fit of it begins with."""
        return replace(self.candidates, model=self.problem.model).begin(self.accepted)

    @property
    def unheld(self) -> Problem:
        """The problem in which accepted effects beyond their ranges are not held by them."""
        return self.unheld_by(self.selected)

    def unheld_by(self, fitted: Sequence[str]) -> Problem:
        """The same, but of accepted effects only those that are fitted."""
        beyond = [h for h in self.accepted if h.begin and set(h.unknown) <= set(fitted)]
        key = ("unheld", *(value for h in beyond for value in h.begin))
        return self.known.once((self.problem,), key, lambda: unheld(self.problem, beyond))

    @property
    def null(self) -> Array:
        """Values (P,), SI, of parameters that are not identified: effects are null, others held where fits begin."""
        return replace(self.candidates, model=self.problem.model).begin()

    def price(self, hypotheses: Sequence[Hypothesis]) -> float:
        """Log evidence that effects must have: some of many are chosen, of several of a kind one of all choices."""
        kinds = [h.effect for h in self.candidates.hypotheses]
        known = Counter(h.effect for h in hypotheses)
        ways = [max(comb(kinds.count(k), n), n) if n > 1 else 1 for k, n in known.items()]
        return float(len(known) * np.log(max(len(kinds), 1)) + np.log(ways).sum())

    def accepting(self, new: Sequence[Hypothesis], removed: Sequence[Hypothesis] = ()) -> Search:
        """The search, not fitted anew, with further effects in place of some, and of parts of the new ones."""
        rest = [h for h in self.accepted if h not in removed and not any(n.contains(h) for n in new)]
        accepted = (*rest, *new)
        return replace(self, accepted=accepted, problem=beside_unknown_sides(self.problem, self.declared, accepted))

    @property
    def near(self) -> tuple[Hypothesis, ...]:
        """Accepted effects that are not far off: those that linear tests tell something of."""
        return tuple(h for h in self.accepted if h.name not in self.far_off)

    @property
    def open(self) -> tuple[Hypothesis, ...]:
        """Hypotheses that are not accepted, and those of which parts are, with more numbers."""
        return self.open_without(())

    def open_without(self, removed: Sequence[Hypothesis]) -> tuple[Hypothesis, ...]:
        """Hypotheses that are open where some accepted ones are removed."""
        accepted = {h.name: h for h in self.accepted if h not in removed}
        more = [h.beyond(accepted[h.name]) if h.name in accepted else h for h in self.candidates.hypotheses]
        return tuple(h for h in more if h.name not in accepted or len(h.parameters) > len(accepted[h.name].parameters))


def score_all(search: Search, hypotheses: Sequence[Hypothesis]) -> Scored:
    """Scores of hypotheses at the present solution."""
    return _scored(search, _linear(search, search.fit.values, search.selected, hypotheses), hypotheses)


def score_without(search: Search, removed: Sequence[Hypothesis], hypotheses: Sequence[Hypothesis]) -> Scored:
    """Scores of hypotheses where some accepted effects have null value, and so have their parameters' influences.

    The others stay where the fit has put them: what they would do instead is projected out.
    """
    return _scored(search, linear_without(search, removed, hypotheses), hypotheses)


def _scored(search: Search, linear: Linear, hypotheses: Sequence[Hypothesis]) -> Scored:
    key = ("scored", *((h, h.parts) for h in hypotheses))  # equal hypotheses may have other parts
    compute = partial(scored, linear, search.problem, hypotheses)
    return search.known.once((linear, search.problem), key, compute, linear.columns.nbytes)


def linear_without(search: Search, removed: Sequence[Hypothesis], hypotheses: Sequence[Hypothesis]) -> Linear:
    """The problem linearised where some accepted effects have null value, the other accepted ones projected out."""
    return _linear(search, *nulled(search, removed), hypotheses)


def nulled(search: Search, removed: Sequence[Hypothesis]) -> tuple[Array, tuple[str, ...]]:
    """Values (P,), SI, of the fit where some accepted effects have null value, and what is identified without them."""
    gone = {n for h in removed for n in h.parameters}
    values, model = search.fit.values.copy(), search.problem.model
    index = [model.names.index(n) for n in gone if not n.endswith(".lag")]  # which only shapes what the others do
    values[index] = search.null[index]
    return values, tuple(n for n in search.selected if n not in gone)


def _linear(search: Search, values: Array, projected: tuple[str, ...], hypotheses: Sequence[Hypothesis]) -> Linear:
    others = tuple(dict.fromkeys(n for h in hypotheses for n in h.parameters if n not in projected))
    values, problem = _same_lag(search, values, hypotheses), search.unheld_by(projected)
    return search.known.linearised(
        problem,
        values,
        (*projected, *others),
        projected,
        lambda: linear_problem(problem, values, projected, others, search.fit.after.start, compare=False),
    )


def _same_lag(search: Search, values: Array, hypotheses: Sequence[Hypothesis]) -> Array:
    """The values (P,), but that rivals have the lag of the accepted thermal effects, or they would be behind."""
    names, values = search.problem.model.names, values.copy()
    lags = [search.fit.values[names.index(n)] for h in search.accepted for n in h.parameters if n.endswith(".lag")]
    if lags:
        accepted = {h.name for h in search.accepted}
        rivals = [n for h in hypotheses if h.name not in accepted for n in h.parameters if n.endswith(".lag")]
        values[[names.index(n) for n in rivals]] = max(lags)
    return values


def scored(linear: Linear, problem: Problem, hypotheses: Sequence[Hypothesis]) -> Scored:
    """Scores, p values and evidence of hypotheses; the best of its nested parts stands for each."""
    plain, linear, groups = linear, independent(linear, problem, hypotheses), group_columns(problem)
    done = scored_by(noise_scale(linear, problem, groups), linear, hypotheses)
    p = p_values_beside(linear, groups, done.scale, zip(done.hypotheses, done.scores, strict=True), done.p_values)
    return replace(done, plain=plain, p_values=p)


def scored_by(scale: Scale, linear: Linear, hypotheses: Sequence[Hypothesis]) -> Scored:
    """Scores, p values and evidence of hypotheses by a noise that is known, as at the end of a search."""
    best, scores, p_values, evidence = _best_parts(linear.scores_of, scale, hypotheses)
    return Scored(
        linear=linear, scale=scale, hypotheses=best, scores=scores, p_values=p_values, log_bayes=evidence, plain=linear
    )


def scored_beside(near: Scored, first: Hypothesis, hypotheses: Sequence[Hypothesis]) -> Scored:
    """Hypotheses scored where another one is accepted too, by the same noise."""
    scores_of = partial(near.linear.scores_beside, first)
    best, scores, p_values, evidence = _best_parts(scores_of, near.scale, hypotheses)
    return replace(near, hypotheses=best, scores=scores, p_values=p_values, log_bayes=evidence)


def _best_parts(
    scores_of: Callable[[Sequence[Hypothesis]], tuple[Score, ...]], scale: Scale, hypotheses: Sequence[Hypothesis]
) -> tuple[tuple[Hypothesis, ...], tuple[Score, ...], Array, Array]:
    """The part of each hypothesis with most log evidence, its score, p value and this evidence (H,), choice paid."""
    parts = [part for h in hypotheses for part in h.nested_parts]
    scores = scores_of(parts)
    count = np.array([s.count for s in scores], dtype=np.intp)
    statistic = np.array([s.statistic for s in scores])
    evidence = log_evidence(statistic / scale.variance, count) + np.array([s.tail for s in scores])
    ends = np.cumsum([len(h.nested_parts) for h in hypotheses], dtype=np.intp)
    chosen, price = [], []
    for first, end in zip([0, *ends[:-1]], ends, strict=True) if len(ends) else ():
        seen = int(np.count_nonzero(count[first:end]))
        chosen.append(first + int(np.argmax(evidence[first:end])) if seen else int(end) - 1)
        price.append(float(np.log(max(seen, 1))))
    p = scale.p_value(statistic[chosen], np.maximum(count[chosen], 1))
    p[count[chosen] == 0] = 1.0
    return tuple(parts[k] for k in chosen), tuple(scores[k] for k in chosen), p, evidence[chosen] - price


def shape_gains(search: Search, scores: Scored, among: slice = slice(None)) -> Array:
    """Evidence (H,) gained where the shape of an effect may deviate from its formula; of some, those near the best.

    Groups gain none: with free shapes at every place they would explain nearly anything.
    """
    out, evidence = np.zeros(len(scores.hypotheses)), scores.log_bayes
    close = np.arange(len(out))[among][evidence[among] > evidence.max(initial=0.0) - _NEAR_BEST]
    near = [int(k) for k in close if scores.scores[k].count and not scores.hypotheses[k].members]
    discrepancies = own_discrepancies(search.problem, search.fit, [scores.hypotheses[k] for k in near], search.known)
    for k in near:
        hypothesis, score = scores.hypotheses[k], scores.scores[k]
        if hypothesis.name in discrepancies:
            columns = scores.linear.tested(hypothesis) @ score.basis
            free = scores.linear.whitened(discrepancies[hypothesis.name])
            out[k] = own_discrepancy(scores.linear.beside(hypothesis), scores.scale, columns, free).evidence
    return out
