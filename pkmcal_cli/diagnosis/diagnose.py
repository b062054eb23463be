"""The whole diagnosis: what is left in the residual, traced to named effects, with what could not have been seen."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from pkmcal_cli.calibration.identify import Fit, identify
from pkmcal_cli.calibration.residual import Problem
from pkmcal_cli.diagnosis.confirm import HeldOutGain, held_out_gain
from pkmcal_cli.diagnosis.hypotheses import RELEASE, Candidates, Hypothesis
from pkmcal_cli.diagnosis.linear import Linear, Scale
from pkmcal_cli.diagnosis.local import local_effects
from pkmcal_cli.diagnosis.refine import Rival, confirmed_only, credible_set, swapped
from pkmcal_cli.diagnosis.residue import own_shape, residue_columns
from pkmcal_cli.diagnosis.rows import row_scores
from pkmcal_cli.diagnosis.search import Alpha, Scored, Search, linear_without, run_search, score_all
from pkmcal_cli.diagnosis.stand_in import stand_ins
from pkmcal_cli.diagnosis.unknown import Unknown, unknown_effects
from pkmcal_cli.prediction import settled_smoothing
from pkmcal_cli.rotation import Array

Verdict = Literal["clean", "found", "ambiguous", "unknown", "measurement_fault"]
_SAME = 0.99999  # cosine at which an effect is another name for a parameter
_ORDINARY = 0.01  # p value above which a row that was taken out is put back
_KEPT = 0.01  # share of its length below which a hypothesis is absorbed by declared parameters


@dataclass(frozen=True)
class Finding:
    """One accepted effect with its credible set; `estimate` and `std` (k,) SI, nan where undetermined."""

    hypothesis: Hypothesis
    estimate: tuple[float, ...]
    std: tuple[float, ...]
    evidence: float
    p_value: float
    share: float  # of the residual's excess over noise that it explains
    rivals: tuple[Rival, ...]
    held_out: HeldOutGain
    beyond: bool  # larger than twice what is plausible
    provisional: bool

    @property
    def ambiguous(self) -> bool:
        """Whether the data support several effects in its place."""
        return len(self.rivals) > 1


@dataclass(frozen=True)
class Invisible:
    """A hypothesis that these data cannot show: minimal detectable and plausible size, SI; what absorbs it."""

    hypothesis: Hypothesis
    parameter: str
    mdb: float
    plausible: float
    absorbed_by: tuple[str, ...]


@dataclass(frozen=True)
class Diagnosis:
    """All that `diagnose` reports."""

    verdict: Verdict
    problem: Problem  # with the bad rows taken out
    before: Fit
    search: Search
    findings: tuple[Finding, ...]
    unknown: tuple[Unknown, ...]
    invisible: tuple[Invisible, ...]
    not_testable: tuple[tuple[str, str], ...]
    scale: Scale
    same: dict[str, str]  # effects that are another name for a parameter, and its name
    p_global: float
    seed: int

    @property
    def bad_rows(self) -> tuple[int, ...]:
        """Rows that are wrong on their own."""
        return tuple(sorted(self.search.bad_rows))


def diagnose(found: Candidates, problem: Problem, selected: tuple[str, ...], alpha: float, seed: int) -> Diagnosis:
    """Diagnose a table; `problem` belongs to the candidates' model. Raises RowsFailed."""
    before = identify(problem, selected)
    model = settled_smoothing(problem.model, before.values, problem.rows)
    problem, found = replace(problem, model=model), replace(found, model=model)
    start = Search(found, problem, selected, before)
    first = score_all(start, found.hypotheses)
    same = _same_as_parameters(first)
    found = replace(found, hypotheses=tuple(h for h in found.hypotheses if h.name not in same))
    parts = Alpha(alpha)
    now = confirmed_only(restored(swapped(run_search(found, problem, before, parts, seed))))
    last, unknown = _left(now, problem, parts)
    findings = tuple(_finding(now, h, before, last, bool(unknown)) for h in now.accepted)
    findings = tuple(sorted(findings, key=lambda f: -f.held_out.gain))
    hidden = invisible(first, now)
    p = float(first.scale.p_value(np.array([first.linear.chi2]), np.array([first.linear.dof]))[0])
    verdict = _verdict(findings, unknown, now.bad_rows)
    return Diagnosis(
        verdict, now.problem, before, now, findings, unknown, hidden, found.not_testable, last.scale, same, p, seed
    )


def _left(now: Search, whole: Problem, parts: Alpha) -> tuple[Scored, tuple[Unknown, ...]]:
    """All hypotheses scored at the end of a search, and what is unknown then. `whole`: with the bad rows."""
    last = score_all(now, now.open)
    unknown = unknown_effects(last.linear, now.problem, last.scale, parts.groups, now.bad_rows)
    if unknown and now.accepted:  # unless a richer shape of what was found explains it
        extra = residue_columns(now.problem, now.fit, now.accepted)
        shaped = last.linear.projecting(last.linear.projected, extra=last.linear.whitened(extra))
        unknown = unknown_effects(shaped, now.problem, last.scale, parts.groups, now.bad_rows)
    every = replace(now.problem, measured=whole.measured)
    unknown += local_effects(every, now.fit.values, parts.groups / 8)
    return last, tuple(unknown + stand_ins(now, last.scale))


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
    measured = now.problem.measured.copy()
    rows = list(now.bad_rows)
    measured[rows] = ~np.isnan(now.problem.readings[rows]) & ~np.isnan(now.problem.sigma[rows])
    whole = replace(now, problem=replace(now.problem, measured=measured))
    again = score_all(replace(whole, fit=now.fit), ())
    scores = row_scores(again.linear, measured, again.scale)
    good = [r for r in rows if scores.p_value[r] > _ORDINARY]
    if not good:
        return now
    kept = tuple(r for r in rows if r not in good)
    measured[list(kept)] = False
    problem = replace(now.problem, measured=measured)
    return replace(now, problem=problem, bad_rows=kept, fit=identify(problem, now.selected))


def _finding(now: Search, hypothesis: Hypothesis, before: Fit, last: Scored, doubt: bool) -> Finding:
    names = now.problem.model.names
    index = [names.index(n) for n in hypothesis.parameters]
    places = {n: k for k, n in enumerate(now.fit.selected)}
    spread = np.array([now.fit.std[places[n]] for n in hypothesis.parameters])
    std = tuple(float(s) for s in np.sqrt(spread**2 + _by_shape(now, hypothesis, last.scale)))
    estimate = tuple(float(v) for v in now.fit.values[index])
    nominal, ranges = now.problem.model.nominal[index], now.problem.model.ranges[index]
    beyond = bool((np.abs(np.array(estimate) - nominal) > 2 * ranges).any())
    gain = held_out_gain(now, hypothesis)
    excess = before.chi2 - last.scale.variance * before.dof
    share = min(gain.gain * last.linear.used / excess, 1.0) if excess > 0 else 0.0
    return Finding(
        hypothesis,
        estimate,
        std,
        now.evidence[hypothesis.name],
        now.p_values[hypothesis.name],
        max(share, 0.0),
        credible_set(now, hypothesis),
        gain,
        beyond,
        doubt or beyond or not gain.confirmed,
    )


def _by_shape(now: Search, hypothesis: Hypothesis, scale: Scale) -> Array:
    """Variance (k,), SI, that an effect's own shape adds to its parameters, where the data speak for one."""
    linear = linear_without(now, [hypothesis], [hypothesis])
    residues = residue_columns(now.problem, now.fit, [hypothesis], own=True)
    if not residues.shape[1]:
        return np.zeros(len(hypothesis.parameters))
    shape = own_shape(linear, scale, linear.of(hypothesis.parameters), residues)
    return np.asarray(np.diag(shape.covariance) * linear.scale_of(hypothesis.parameters) ** 2)


def invisible(scored: Scored, now: Search) -> tuple[Invisible, ...]:
    """Hypotheses without a direction that could be seen within its plausible range."""
    out = []
    for h, s in zip(scored.hypotheses, scored.scores, strict=True):
        if s.count or h in now.accepted:
            continue
        scale = scored.linear.scale_of(h.parameters)
        lengths = (scored.linear.of(h.parameters) ** 2).sum(axis=0)
        k = int(np.argmax(lengths))
        by = absorbing(scored.linear, h, k) if s.kept < _KEPT and lengths[k] > 0 else ()
        out.append(Invisible(h, h.parameters[k], s.mdb * float(scale[k]), 2 * float(scale[k]), by))
    return tuple(out)


def absorbing(linear: Linear, hypothesis: Hypothesis, k: int) -> tuple[str, ...]:
    """Declared parameters that could move instead of a hypothesis's parameter number k, largest first."""
    a = linear.of(linear.projected)
    if not a.shape[1]:
        return ()
    column = linear.of(hypothesis.parameters)[:, k]
    coefficients = np.linalg.lstsq(a, column, rcond=1e-9)[0]
    size = np.abs(coefficients) * np.sqrt((a**2).sum(axis=0))
    order = np.argsort(-size)[:4]
    return tuple(linear.projected[j] for j in order if size[j] > 0.2 * size.max())


def _verdict(findings: tuple[Finding, ...], unknown: tuple[Unknown, ...], bad_rows: tuple[int, ...]) -> Verdict:
    if unknown or any(f.beyond for f in findings):
        return "unknown"
    if any(f.ambiguous for f in findings):
        return "ambiguous"
    if any(not f.hypothesis.measurement for f in findings):
        return "found"
    return "measurement_fault" if findings or bad_rows else "clean"
