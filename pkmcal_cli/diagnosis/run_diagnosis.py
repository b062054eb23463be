"""The whole diagnosis: what is left in the residual, traced to named effects, with what could not have been seen."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.problem import Problem, usable
from pkmcal_cli.calibration.residual import reasons
from pkmcal_cli.calibration.starts import best_of_starts
from pkmcal_cli.diagnosis.alpha import Alpha
from pkmcal_cli.diagnosis.far_causes import with_far_causes
from pkmcal_cli.diagnosis.findings import Finding, findings_of, sizes_seen
from pkmcal_cli.diagnosis.gross_rows import gross_rows
from pkmcal_cli.diagnosis.hypotheses import RELEASE, Candidates, Hypothesis
from pkmcal_cli.diagnosis.linear import Linear, Scale
from pkmcal_cli.diagnosis.local import local_effects
from pkmcal_cli.diagnosis.model_discrepancy import discrepancy_columns
from pkmcal_cli.diagnosis.noise_growth import NoiseGrowth, noise_growth, weighted
from pkmcal_cli.diagnosis.noise_tests import chance_of_noise
from pkmcal_cli.diagnosis.outlying_rows import row_scores
from pkmcal_cli.diagnosis.refine import confirmed_only, rivals_of, swapped
from pkmcal_cli.diagnosis.refuted import refuted_causes
from pkmcal_cli.diagnosis.scoring import Scored, Search, recalibrated, score_all
from pkmcal_cli.diagnosis.search import run_search
from pkmcal_cli.diagnosis.unknown import TESTS, Unknown, unknown_effects
from pkmcal_cli.diagnosis.unmodelled import unmodelled_alternatives
from pkmcal_cli.diagnosis.visible_sizes import VisibleSizes
from pkmcal_cli.prediction import fixed_smoothing

Verdict = Literal["clean", "found", "ambiguous", "unknown", "measurement_fault", "sigma_too_small"]
_SAME = 0.99999  # cosine at which an effect is another name for a parameter
_TOO_MUCH = 1e-3  # chance of a residual so large, of noise as it is stated, at which nothing is called clean
_KINSHIP = 0.9  # share of what rows are off by that an effect explains if it is the cause
_SOON = 15  # steps in which fits converge, unless something is wrong
_SUSPECT = 0.05  # chance that any row is as far off, at which one is told
_ORDINARY = 0.01  # p value above which a row that was taken out is put back


@dataclass(frozen=True, kw_only=True)
class Diagnosis:
    """All that `diagnose` reports."""

    verdict: Verdict
    problem: Problem  # with the bad rows taken out
    before: Fit
    search: Search
    findings: tuple[Finding, ...]
    unknown: tuple[Unknown, ...]
    noise: tuple[NoiseGrowth, ...]  # by which rows were counted
    first: Scored  # all hypotheses, with nothing accepted
    not_testable: tuple[tuple[str, str], ...]
    scale: Scale
    correlation: float  # of successive rows' noise; 0 where they are independent
    same: dict[str, str]  # effects that are another name for a parameter, and its name
    suspected: dict[int, float]  # rows that are used but may be wrong, and the chance that any good one is as far off
    p_global: float
    seed: int

    @cached_property
    def detectable(self) -> tuple[VisibleSizes, ...]:
        """How large every hypothesis that is not accepted would have to be."""
        return sizes_seen(self.first, self.search, self.seed)

    @property
    def invisible(self) -> tuple[VisibleSizes, ...]:
        """Hypotheses that these data cannot show."""
        return tuple(d for d in self.detectable if not d.tested)

    @property
    def failed(self) -> dict[int, str]:
        """Why rows have no prediction, or have one only with errors of the drives; no test has seen them."""
        search = self.search
        return {**search.failed, **reasons(search.problem, search.fit.after)}

    def not_told_from(self, hypothesis: Hypothesis) -> tuple[Hypothesis, ...]:
        """An accepted effect, first, and those that explain all rows as well."""
        rivals = [r.hypothesis for f in self.findings if f.hypothesis == hypothesis for r in f.rivals]
        return (hypothesis, *(r for r in rivals if r != hypothesis))

    @property
    def bad_rows(self) -> tuple[int, ...]:
        """Rows that are wrong on their own."""
        return tuple(sorted(self.search.bad_rows))


def diagnose(candidates: Candidates, problem: Problem, selected: tuple[str, ...], alpha: float, seed: int) -> Diagnosis:
    """Diagnose a table; `problem` belongs to the candidates' model. Raises RowsFailed.

    Where noise grows over the workspace, once more with rows that count by it.
    """
    first = _diagnosis(candidates, problem, selected, alpha, seed)
    if not first.noise:
        return first
    again = _diagnosis(candidates, weighted(problem, first.noise), selected, alpha, seed)
    return replace(again, noise=first.noise)


def _diagnosis(
    candidates: Candidates, problem: Problem, selected: tuple[str, ...], alpha: float, seed: int
) -> Diagnosis:
    """The diagnosis with sigma as it is."""
    begun = _begun(candidates, problem, selected, alpha, seed)
    parts, first, search = Alpha(alpha), begun.first, _ended(begun, alpha, seed)
    candidates = search.candidates
    last, unknown, growth = _left(search, parts)
    findings = findings_of(search, last, bool(unknown), seed)
    whole = first.linear if not begun.start.bad_rows else score_all(begun.every, ()).linear
    return Diagnosis(
        verdict=_verdict(findings, unknown, bool(search.bad_rows), last.linear),
        problem=replace(search.problem, model=begun.start.problem.model),
        before=begun.every.fit,
        search=search,
        findings=findings,
        unknown=unknown,
        noise=() if unknown else growth,
        first=first,
        not_testable=candidates.not_testable,
        scale=last.scale,
        correlation=0.0 if last.linear.memory is None else last.linear.memory.correlation,
        same=begun.same,
        suspected=_suspected(last),
        p_global=chance_of_noise(whole),
        seed=seed,
    )


def named(
    candidates: Candidates, problem: Problem, selected: tuple[str, ...], alpha: float, seed: int
) -> tuple[tuple[Hypothesis, ...], ...]:
    """What a diagnosis of a table names, each effect with those that explain the table as well; nothing else of it.

    Raises RowsFailed.
    """
    search = _ended(_begun(candidates, problem, selected, alpha, seed), alpha, seed)
    rivals = {h: [r.hypothesis for r in rivals_of(search, h)] for h in search.accepted}
    return tuple((h, *(r for r in others if r != h)) for h, others in rivals.items())


@dataclass(frozen=True, kw_only=True)
class _Begun:
    """A search before anything is accepted: `every` row, `start` without gross ones; all hypotheses scored there."""

    every: Search
    start: Search
    first: Scored
    same: dict[str, str]


def _begun(candidates: Candidates, problem: Problem, selected: tuple[str, ...], alpha: float, seed: int) -> _Begun:
    before = _calibrated(problem, selected, Alpha(alpha), seed)
    problem = problem.without(before.failed)
    model = fixed_smoothing(problem.model, before.values, problem.rows)
    problem, candidates = replace(problem, model=model), replace(candidates, model=model)
    every = Search(candidates=candidates, problem=problem, declared=selected, fit=before, failed=before.failed)
    start = _without_gross_rows(every, Alpha(alpha), seed)
    first = score_all(start, [h.whole for h in candidates.hypotheses])
    same = _same_as_parameters(first)
    candidates = replace(candidates, hypotheses=tuple(h for h in candidates.hypotheses if h.name not in same))
    return _Begun(every=every, start=replace(start, candidates=candidates), first=first, same=same)


def _ended(begun: _Begun, alpha: float, seed: int) -> Search:
    return confirmed_only(restored(swapped(run_search(with_far_causes(begun.start), Alpha(alpha), seed))))


def _calibrated(problem: Problem, selected: tuple[str, ...], parts: Alpha, seed: int) -> Fit:
    """The fit that is diagnosed. Where that from nominal values does not soon converge: that of the others, if some
    rows are gross at nominal values; where it does not at all, from further starts."""
    fit = identify(problem, selected, iterations=_SOON)
    if fit.status != "not_converged":
        return fit
    _, others = gross_rows(problem, selected, parts.rows, seed)
    if others is not None and others.status == "converged":
        return others
    fit = identify(problem, selected)
    if fit.status != "not_converged":
        return fit
    best, _ = best_of_starts(problem, selected, problem.model.nominal, fit, 0, seed)
    return fit if best is None else best


def _without_gross_rows(search: Search, parts: Alpha, seed: int) -> Search:
    """The search without rows that are beyond all noise, unless one effect explains nearly all that they are off by."""
    rows, fit = gross_rows(search.problem, search.declared, parts.rows, seed)
    if fit is None:
        return search
    whole = score_all(replace(search, fit=fit), search.candidates.hypotheses)
    off = whole.linear.chi2 - fit.chi2
    values = int(search.problem.measured[list(rows)].sum())
    few = [s.statistic for s in whole.scores if 2 * s.count <= values]  # as many numbers explain any rows
    if max(few, default=0.0) > _KINSHIP * off:
        return search
    failed = {**search.failed, **fit.failed}
    return replace(search, problem=search.problem.without((*rows, *fit.failed)), fit=fit, bad_rows=rows, failed=failed)


def _left(search: Search, parts: Alpha) -> tuple[Scored, tuple[Unknown, ...], tuple[NoiseGrowth, ...]]:
    """All hypotheses scored at the end of a search, what is unknown then, and noise that grows."""
    last, least = score_all(search, search.open), parts.groups / TESTS
    unknown = unknown_effects(last.linear, search.problem, last.scale, parts.groups, search.bad_rows)
    if unknown and search.accepted:  # unless a richer shape of what was found explains it
        extra = discrepancy_columns(search.problem, search.fit, search.accepted)
        shaped = last.linear.projecting(last.linear.projected, extra=last.linear.whitened(extra))
        unknown = unknown_effects(shaped, search.problem, last.scale, parts.groups, search.bad_rows)
    growth = noise_growth(last.linear, search.problem, last.scale, least)
    every = weighted(_with_rows(search.problem, list(search.bad_rows)), growth)  # else its far end is a local effect
    unknown += local_effects(every, search.fit.values, least)
    return last, tuple(unknown + unmodelled_alternatives(search, last) + refuted_causes(search, last)), growth


def _same_as_parameters(first: Scored) -> dict[str, str]:
    """Effects whose signature is that of a parameter that is held, by name; they are reported under the parameter."""
    free = {}
    for h, s in zip(first.hypotheses, first.scores, strict=True):
        if s.count == 1 and len(h.parameters) == 1:
            column = first.linear.free(first.linear.of(h.parameters))[:, 0]
            free[h.name] = (h, column / np.sqrt(column @ column))
    releases = [(name, column) for name, (h, column) in free.items() if h.effect == RELEASE]
    return {
        name: other
        for name, (h, column) in free.items()
        if h.effect != RELEASE
        for other, theirs in releases
        if abs(float(column @ theirs)) > _SAME
    }


def restored(search: Search) -> Search:
    """The search with rows put back that the accepted effects explain after all, each judged by the good ones."""
    if not search.bad_rows:
        return search
    scale = score_all(search, ()).scale
    good = []
    for row in search.bad_rows:
        again = score_all(replace(search, problem=_with_rows(search.problem, [row])), ())
        scores = row_scores(again.linear, again.linear.on, scale)
        if again.linear.on[row].any() and scores.p_value[row] > _ORDINARY:
            good.append(row)
    if not good:
        return search
    whole = _with_rows(search.problem, list(search.bad_rows))
    kept = tuple(r for r in search.bad_rows if r not in good)
    return recalibrated(replace(search, problem=whole.without(kept), bad_rows=kept))


def _suspected(last: Scored) -> dict[int, float]:
    """Rows that may be wrong, the worst first; `last`: scored with all that was found."""
    chance = np.minimum(last.rows.p_value * len(last.rows.p_value), 1.0)
    return {int(k): float(chance[k]) for k in np.argsort(chance, kind="stable") if chance[k] < _SUSPECT}


def _with_rows(problem: Problem, rows: list[int]) -> Problem:
    """The problem with rows that were taken out."""
    measured = problem.measured.copy()
    measured[rows] = ~np.isnan(problem.readings[rows]) & ~np.isnan(problem.sigma[rows])
    return usable(replace(problem, measured=measured))


def _verdict(findings: tuple[Finding, ...], unknown: tuple[Unknown, ...], measurement: bool, last: Linear) -> Verdict:
    """`last`: the problem where all that was found is fitted."""
    if unknown:
        return "unknown"
    if any(f.ambiguous for f in findings):
        return "ambiguous"
    if any(not f.hypothesis.measurement for f in findings):
        return "found"
    if findings or measurement:
        return "measurement_fault"
    return "sigma_too_small" if chance_of_noise(last) < _TOO_MUCH else "clean"
