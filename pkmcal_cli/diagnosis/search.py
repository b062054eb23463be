"""Detection, identification, adaptation: calibrate, score, accept the best, refit, until nothing is left."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identify import RowsFailed, identify
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.diagnosis.groups import group_columns
from pkmcal_cli.diagnosis.hypotheses import Candidates, Hypothesis
from pkmcal_cli.diagnosis.linear import Linear, Scale, Score, linear_problem, log_evidence
from pkmcal_cli.diagnosis.noise import independent, noise_scale
from pkmcal_cli.diagnosis.residue import own_residues, own_shape, residue_columns
from pkmcal_cli.diagnosis.rows import MOST, RowScores, row_scores
from pkmcal_cli.diagnosis.threshold import critical_p, effective_tests, smallest_p

MOST_EFFECTS = 5
_STEPS = 20  # of a fit with effects; those that take more turn on the sign of forces
_FAR_OUT = 0.01  # factor on p values of rows where more than noise is left, of which nobody knows the tails
_NEAR_BEST = 30.0  # log evidence that a free shape can make up for
_CONTENDERS, _CLOSE = 4, 8.0  # hypotheses within so much log evidence of the best are fitted before one is accepted


@dataclass(frozen=True)
class Alpha:
    """False-alarm rate of the whole diagnosis, and its parts."""

    total: float

    @property
    def catalogue(self) -> float:
        """For the effects of the catalogue."""
        return 0.6 * self.total

    @property
    def groups(self) -> float:
        """For what depends on pose, time ... and is in no catalogue."""
        return 0.2 * self.total

    @property
    def rows(self) -> float:
        """For single bad rows."""
        return 0.2 * self.total


@dataclass(frozen=True, kw_only=True)
class Scored:
    """All hypotheses scored at one solution; `p_values`, `log_bayes` (H,)."""

    linear: Linear
    scale: Scale
    hypotheses: tuple[Hypothesis, ...]
    scores: tuple[Score, ...]
    p_values: Array
    log_bayes: Array
    rows: RowScores


@dataclass(frozen=True, kw_only=True)
class Search:
    """Where the search has come to: the problem without the rows taken out or left out, its fit, what was accepted."""

    candidates: Candidates
    problem: Problem
    declared: tuple[str, ...]
    fit: Fit
    accepted: tuple[Hypothesis, ...] = ()
    refused: frozenset[str] = frozenset()
    bad_rows: tuple[int, ...] = ()
    failed: Mapping[int, str] = field(default_factory=dict)  # why rows that nothing predicts are left out
    p_values: dict[str, float] = field(default_factory=dict)
    evidence: dict[str, float] = field(default_factory=dict)
    critical: float = 0.0
    tests: float = 0.0

    @property
    def selected(self) -> tuple[str, ...]:
        """Parameters that are identified: the declared and those of accepted effects."""
        extra = {name for h in self.accepted for name in h.parameters}
        every = set(self.declared) | extra
        return tuple(n for n in self.problem.model.names if n in every)

    @property
    def open(self) -> tuple[Hypothesis, ...]:
        """Hypotheses that are not accepted."""
        names = {h.name for h in self.accepted}
        return tuple(h for h in self.candidates.hypotheses if h.name not in names)


def run_search(found: Candidates, problem: Problem, fit: Fit, alpha: Alpha, seed: int) -> Search:
    """Accept effects and take out rows until nothing significant is left. `problem`: of the candidates' model."""
    now = Search(candidates=found, problem=problem, declared=fit.selected, fit=fit, failed=fit.failed)
    scored = score_all(now, now.open)
    draws = smallest_p(scored.linear, [scored.linear.of(h.parameters) for h in scored.hypotheses], scored.scores, seed)
    now = replace(now, critical=critical_p(draws, alpha.catalogue), tests=effective_tests(draws))
    while (after := _advanced(now, score_all(now, now.open), alpha)) is not None:
        now = after
    return now


def score_all(now: Search, hypotheses: Sequence[Hypothesis]) -> Scored:
    """Scores of hypotheses at the present solution."""
    return scored(_linear(now, now.fit.values, now.selected, hypotheses), now.problem, hypotheses)


def score_without(now: Search, removed: Sequence[Hypothesis], hypotheses: Sequence[Hypothesis]) -> Scored:
    """Scores of hypotheses where some accepted effects have null value, and so have their parameters' influences.

    The others stay where the fit has put them: what they would do instead is projected out.
    """
    return scored(linear_without(now, removed, hypotheses), now.problem, hypotheses)


def linear_without(now: Search, removed: Sequence[Hypothesis], hypotheses: Sequence[Hypothesis]) -> Linear:
    """The problem linearised where some accepted effects have null value, the other accepted ones projected out."""
    gone = {n for h in removed for n in h.parameters}
    values, model = now.fit.values.copy(), now.problem.model
    for name in gone:
        if not name.endswith(".lag"):  # it only shapes what the others do
            k = model.names.index(name)
            values[k] = model.parameters[k].nominal
    kept = tuple(n for n in now.selected if n not in gone)
    return _linear(now, values, kept, hypotheses)


def _linear(now: Search, values: Array, projected: tuple[str, ...], hypotheses: Sequence[Hypothesis]) -> Linear:
    others = [n for h in hypotheses for n in h.parameters if n not in projected]
    return linear_problem(now.problem, _same_lag(now, values, hypotheses), projected, others, now.fit.after.state)


def _same_lag(now: Search, values: Array, hypotheses: Sequence[Hypothesis]) -> Array:
    """The values (P,), but that rivals have the lag of the accepted thermal effects, or they would be behind."""
    names, values = now.problem.model.names, values.copy()
    lags = [now.fit.values[names.index(n)] for h in now.accepted for n in h.parameters if n.endswith(".lag")]
    if lags:
        accepted = {h.name for h in now.accepted}
        rivals = [n for h in hypotheses if h.name not in accepted for n in h.parameters if n.endswith(".lag")]
        values[[names.index(n) for n in rivals]] = max(lags)
    return values


def scored(linear: Linear, problem: Problem, hypotheses: Sequence[Hypothesis]) -> Scored:
    """Scores, p values and evidence of hypotheses."""
    plain, linear = linear, independent(linear, problem)
    scale = noise_scale(linear, problem, group_columns(problem))
    scores = tuple(linear.score(linear.of(h.parameters)) for h in hypotheses)
    statistic = np.array([s.statistic for s in scores])
    count = np.array([s.count for s in scores])
    p = scale.p_value(statistic, np.maximum(count, 1))
    p[count == 0] = 1.0
    evidence = log_evidence(statistic / scale.variance, count)
    return Scored(
        linear=linear,
        scale=scale,
        hypotheses=tuple(hypotheses),
        scores=scores,
        p_values=p,
        log_bayes=evidence,
        rows=row_scores(plain, plain.on, scale),
    )


def shape_gains(now: Search, found: Scored) -> Array:
    """Evidence (H,) gained where the shape of an effect may deviate from its formula; of those near the best."""
    out, evidence = np.zeros(len(found.hypotheses)), found.log_bayes
    near = [int(k) for k in np.nonzero(evidence > evidence.max(initial=0.0) - _NEAR_BEST)[0] if found.scores[k].count]
    residues = own_residues(now.problem, now.fit, [found.hypotheses[k] for k in near])
    for k in near:
        hypothesis, score = found.hypotheses[k], found.scores[k]
        if hypothesis.name in residues:
            columns = found.linear.of(hypothesis.parameters) @ score.basis
            free = found.linear.whitened(residues[hypothesis.name])
            out[k] = own_shape(found.linear, found.scale, columns, free).evidence
    return out


def _advanced(now: Search, scored: Scored, alpha: Alpha) -> Search | None:
    """One acceptance: rows where they have more evidence, else the best effect; None where nothing is left."""
    rows = _bad_rows(now, scored, alpha)
    evidence = np.where(scored.p_values < now.critical, scored.log_bayes, -np.inf)
    evidence[[h.name in now.refused for h in scored.hypotheses]] = -np.inf
    best = int(np.argmax(evidence)) if len(evidence) else -1
    most = float(evidence[best]) if best >= 0 else -np.inf
    if len(rows) and float(scored.rows.log_bayes(scored.linear.used)[rows].max()) > most:
        return _without_rows(now, rows)
    if most <= 0.0 or len(now.accepted) >= MOST_EFFECTS:
        return None
    return _best_of(now, scored, evidence)


def _best_of(now: Search, scored: Scored, evidence: Array) -> Search:
    """The contender that is best once it has been fitted: scores are linear, and a refit may turn them round."""
    shape = shape_gains(now, scored)
    evidence = evidence + shape
    order = np.argsort(-evidence, kind="stable")[:_CONTENDERS]
    trials = []
    for k in (int(k) for k in order if evidence[k] > max(evidence[order[0]] - _CLOSE, 0.0)):
        if _is_residue(now, scored, k):
            now = replace(now, refused=now.refused | {scored.hypotheses[k].name})
            continue
        after = _accepted(now, scored, k)
        if after is None:
            now = replace(now, refused=now.refused | {scored.hypotheses[k].name})
            continue
        gain = np.array((now.fit.chi2 - after.fit.chi2) / scored.scale.variance)
        trials.append((float(shape[k] + log_evidence(gain, np.array(scored.scores[k].count))), after))
    if not trials:
        return now
    return replace(max(trials, key=lambda trial: trial[0])[1], refused=frozenset())  # beside it others may be right


def _is_residue(now: Search, scored: Scored, best: int) -> bool:
    """Whether a hypothesis is significant only as long as accepted effects have no free shape.

    A richer shape of the same place is no residue: it has a name.
    """
    hypothesis = scored.hypotheses[best]
    others = [h for h in now.accepted if h.at != hypothesis.at]
    extra = residue_columns(now.problem, now.fit, others)
    if not extra.shape[1]:
        return False
    free = scored.linear.projecting(scored.linear.projected, extra=scored.linear.whitened(extra))
    score = free.score(free.of(hypothesis.parameters))
    if not score.count:
        return True
    p = scored.scale.p_value(np.array([score.statistic]), np.array([score.count]))[0]
    return bool(p > now.critical) and score.statistic < 0.5 * scored.scores[best].statistic


def _bad_rows(now: Search, scored: Scored, alpha: Alpha) -> NDArray[np.intp]:
    """Rows to take out now: significant ones, of the size of the worst; none beyond the largest share."""
    room = max(int(MOST * len(now.problem)), 1) - len(now.bad_rows)
    p = scored.rows.p_value
    sure = _FAR_OUT if scored.scale.doubted else 1.0
    chosen = np.nonzero(p < sure * alpha.rows / len(p))[0]
    if not len(chosen) or room <= 0:
        return np.zeros(0, dtype=np.intp)
    size = scored.rows.statistic[chosen]
    order = np.argsort(-size)
    chosen = chosen[order][size[order] > 0.25 * size.max()]
    return np.asarray(chosen[:room])


def _without_rows(now: Search, rows: NDArray[np.intp]) -> Search:
    """The same without some rows, calibrated again."""
    bad = tuple(int(r) for r in rows)
    return recalibrated(replace(now, problem=now.problem.without(bad), bad_rows=(*now.bad_rows, *bad)))


def recalibrated(now: Search) -> Search:
    """The same with a fit of its problem; rows that this does not predict are left out. Raises RowsFailed."""
    fit = identify(now.problem, now.selected)
    return replace(now, problem=now.problem.without(fit.failed), fit=fit, failed={**now.failed, **fit.failed})


def _accepted(now: Search, scored: Scored, best: int) -> Search | None:
    """The same with one more effect; None if a fit with it fails or is not better."""
    hypothesis, score = scored.hypotheses[best], scored.scores[best]
    after = replace(now, accepted=(*now.accepted, hypothesis))
    fit = refit(after, {hypothesis: score.estimate * scored.linear.scale_of(hypothesis.parameters)})
    if fit is None or not now.fit.chi2 - fit.chi2 > 0.25 * score.statistic:
        return None
    p, evidence = dict(now.p_values), dict(now.evidence)
    p[hypothesis.name], evidence[hypothesis.name] = float(scored.p_values[best]), float(scored.log_bayes[best])
    return replace(after, fit=fit, p_values=p, evidence=evidence)


def refit(now: Search, starts: Mapping[Hypothesis, Array]) -> Fit | None:
    """A calibration with the accepted effects; None where it does not settle, or does not predict all rows.

    It begins at nominal values, so that what the data do not determine stays there, but for effects with estimates
    (k,), SI.
    """
    start = now.problem.model.nominal
    for hypothesis, estimate in starts.items():
        for name, value in zip(hypothesis.parameters, estimate, strict=True):
            k = now.problem.model.names.index(name)
            start[k] = np.clip(start[k] + value, *now.problem.model.parameters[k].bounds)
    try:
        fit = identify(now.problem, now.selected, start, _STEPS)
    except RowsFailed:
        return None
    return fit if fit.settled and not fit.failed else None
