"""The whole diagnosis: what is left in the residual, traced to named effects, with what could not have been seen."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.special import chdtrc

from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.problem import Problem, usable
from pkmcal_cli.calibration.residual import reasons
from pkmcal_cli.calibration.starts import best_of_starts
from pkmcal_cli.diagnosis.findings import Detectable, Finding, findings_of, sizes_seen
from pkmcal_cli.diagnosis.hypotheses import RELEASE, Candidates
from pkmcal_cli.diagnosis.linear import Scale
from pkmcal_cli.diagnosis.local import local_effects
from pkmcal_cli.diagnosis.noise import RangeNoise, range_noise
from pkmcal_cli.diagnosis.refine import confirmed_only, swapped
from pkmcal_cli.diagnosis.residue import residue_columns
from pkmcal_cli.diagnosis.rows import row_scores
from pkmcal_cli.diagnosis.search import Alpha, Scored, Search, recalibrated, run_search, score_all
from pkmcal_cli.diagnosis.stand_in import stand_ins
from pkmcal_cli.diagnosis.unknown import TESTS, Unknown, unknown_effects
from pkmcal_cli.prediction import settled_smoothing

Verdict = Literal["clean", "found", "ambiguous", "unknown", "measurement_fault", "sigma_too_small"]
_SAME = 0.99999  # cosine at which an effect is another name for a parameter
_TOO_MUCH = 1e-3  # chance of a residual so large, of noise as it is stated, at which nothing is called clean
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
    noise: tuple[RangeNoise, ...]  # sensors whose noise grows with distance
    detectable: tuple[Detectable, ...]  # every hypothesis that is not accepted
    not_testable: tuple[tuple[str, str], ...]
    scale: Scale
    correlation: float  # of successive rows' noise; 0 where they are independent
    same: dict[str, str]  # effects that are another name for a parameter, and its name
    p_global: float
    seed: int

    @property
    def invisible(self) -> tuple[Detectable, ...]:
        """Hypotheses that these data cannot show."""
        return tuple(d for d in self.detectable if not d.tested)

    @property
    def failed(self) -> dict[int, str]:
        """Why rows have no prediction, or have one only with errors of the drives; no test has seen them."""
        search = self.search
        return {**search.failed, **reasons(search.problem, search.fit.after)}

    @property
    def bad_rows(self) -> tuple[int, ...]:
        """Rows that are wrong on their own."""
        return tuple(sorted(self.search.bad_rows))


def diagnose(found: Candidates, problem: Problem, selected: tuple[str, ...], alpha: float, seed: int) -> Diagnosis:
    """Diagnose a table; `problem` belongs to the candidates' model. Raises RowsFailed."""
    before = _calibrated(problem, selected, seed)
    problem = problem.without(before.failed)
    model = settled_smoothing(problem.model, before.values, problem.rows)
    problem, found = replace(problem, model=model), replace(found, model=model)
    start = Search(candidates=found, problem=problem, declared=selected, fit=before)
    first = score_all(start, found.hypotheses)
    same = _same_as_parameters(first)
    found = replace(found, hypotheses=tuple(h for h in found.hypotheses if h.name not in same))
    parts = Alpha(alpha)
    now = confirmed_only(restored(swapped(run_search(found, problem, before, parts, seed))))
    last, unknown = _left(now, parts)
    findings = findings_of(now, last, bool(unknown), seed)
    p = float(Scale().p_value(np.array([first.linear.chi2]), np.array([first.linear.dof]))[0])
    noise = tuple(n for n in range_noise(last.linear, now.problem, last.scale) if n.p_value < parts.groups / TESTS)
    memory = 0.0 if last.linear.memory is None else last.linear.memory.correlation
    return Diagnosis(
        verdict=_verdict(findings, unknown, bool(now.bad_rows or noise), now.fit),
        problem=now.problem,
        before=before,
        search=now,
        findings=findings,
        unknown=unknown,
        noise=noise,
        detectable=sizes_seen(first, now),
        not_testable=found.not_testable,
        scale=last.scale,
        correlation=memory,
        same=same,
        p_global=p,
        seed=seed,
    )


def _calibrated(problem: Problem, selected: tuple[str, ...], seed: int) -> Fit:
    """The fit that is diagnosed; from further starts where that from nominal values does not converge."""
    fit = identify(problem, selected)
    if fit.status != "not_converged":
        return fit
    best, _ = best_of_starts(problem, selected, problem.model.nominal, fit, 0, seed)
    return fit if best is None else best


def _left(now: Search, parts: Alpha) -> tuple[Scored, tuple[Unknown, ...]]:
    """All hypotheses scored at the end of a search, and what is unknown then."""
    last = score_all(now, now.open)
    unknown = unknown_effects(last.linear, now.problem, last.scale, parts.groups, now.bad_rows)
    if unknown and now.accepted:  # unless a richer shape of what was found explains it
        extra = residue_columns(now.problem, now.fit, now.accepted)
        shaped = last.linear.projecting(last.linear.projected, extra=last.linear.whitened(extra))
        unknown = unknown_effects(shaped, now.problem, last.scale, parts.groups, now.bad_rows)
    every = _with_rows(now.problem, list(now.bad_rows))
    unknown += local_effects(every, now.fit.values, parts.groups / TESTS)
    return last, tuple(unknown + stand_ins(now, last))


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


def restored(now: Search) -> Search:
    """The search with rows put back that the accepted effects explain after all."""
    if not now.bad_rows:
        return now
    rows = list(now.bad_rows)
    whole = _with_rows(now.problem, rows)
    again = score_all(replace(now, problem=whole), ())
    scores = row_scores(again.linear, again.linear.on, again.scale)
    good = [r for r in rows if again.linear.on[r].any() and scores.p_value[r] > _ORDINARY]
    if not good:
        return now
    kept = tuple(r for r in rows if r not in good)
    return recalibrated(replace(now, problem=whole.without(kept), bad_rows=kept))


def _with_rows(problem: Problem, rows: list[int]) -> Problem:
    """The problem with rows that were taken out."""
    measured = problem.measured.copy()
    measured[rows] = ~np.isnan(problem.readings[rows]) & ~np.isnan(problem.sigma[rows])
    return usable(replace(problem, measured=measured))


def _verdict(findings: tuple[Finding, ...], unknown: tuple[Unknown, ...], measurement: bool, fit: Fit) -> Verdict:
    """`fit`: with all that was found, by the stated sigma."""
    if unknown:
        return "unknown"
    if any(f.ambiguous for f in findings):
        return "ambiguous"
    if any(not f.hypothesis.measurement for f in findings):
        return "found"
    if findings or measurement:
        return "measurement_fault"
    return "sigma_too_small" if fit.dof > 0 and float(chdtrc(fit.dof, fit.chi2)) < _TOO_MUCH else "clean"
