"""What is told of an accepted effect, and of effects that these data cannot show."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.diagnosis.confirm import HeldOutGain, held_out_gain
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.linear import Linear, Score
from pkmcal_cli.diagnosis.refine import Rival, credible_set, settled_evidence
from pkmcal_cli.diagnosis.residue import own_residues, own_shape
from pkmcal_cli.diagnosis.search import Scored, Search, linear_without, refit, score_without
from pkmcal_cli.diagnosis.stability import STABLE, stability

_LINEAR = 0.2  # by which the fall of chi-square may differ from the score
_KEPT = 0.01  # share of its length below which a hypothesis is absorbed by declared parameters


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One accepted effect with its credible set; `estimate` and `std` (k,) SI, nan where undetermined."""

    hypothesis: Hypothesis
    estimate: tuple[float, ...]
    std: tuple[float, ...]
    evidence: float
    p_value: float
    share: float  # of what all effects explain together, that comes back without this one
    rivals: tuple[Rival, ...]
    held_out: HeldOutGain
    stable: float  # share of resamples of the rows that name it, or one of its set; nan where it is not linear
    nonlinear: float  # likelihood ratio over score statistic; 1 where it acts in proportion to its size
    beyond: bool  # larger than twice what is plausible
    provisional: bool

    @property
    def ambiguous(self) -> bool:
        """Whether the data support several effects in its place."""
        return any(r.hypothesis != self.hypothesis for r in self.rivals)


@dataclass(frozen=True)
class Detectable:
    """What these data show of a hypothesis: minimal detectable and plausible size, SI; what absorbs it; whether it was
    tested, having a direction that can be seen within its plausible range."""

    hypothesis: Hypothesis
    parameter: str
    mdb: float
    plausible: float
    absorbed_by: tuple[str, ...]
    tested: bool


def findings_of(now: Search, last: Scored, doubt: bool, seed: int) -> tuple[Finding, ...]:
    """What is told of accepted effects, by what they gain. `last`: scored at the end; `doubt`: something is unknown."""
    if not now.accepted:
        return ()
    every = linear_without(now, now.accepted, ()).chi2 - now.fit.chi2  # what all of them explain
    found = [_finding(now, h, last, every, doubt, seed) for h in now.accepted]
    return tuple(sorted(found, key=lambda f: -f.held_out.gain))


def _finding(now: Search, hypothesis: Hypothesis, last: Scored, every: float, doubt: bool, seed: int) -> Finding:
    names = now.problem.model.names
    index = [names.index(n) for n in hypothesis.parameters]
    places = {n: k for k, n in enumerate(now.fit.selected)}
    spread = np.array([now.fit.std[places[n]] for n in hypothesis.parameters]) * np.sqrt(last.scale.variance)
    std = tuple(float(s) for s in np.sqrt(spread**2 + _by_shape(now, hypothesis, last)))
    estimate = tuple(float(v) for v in now.fit.values[index])
    nominal, ranges = now.problem.model.nominal[index], now.problem.model.ranges[index]
    beyond = bool((np.abs(np.array(estimate) - nominal) > 2 * ranges).any())
    gain = held_out_gain(now, hypothesis)
    fall = _likelihood_ratio(now, hypothesis)
    share = min(fall / every, 1.0) if every > 0 and np.isfinite(fall) else float("nan")
    without = score_without(now, [hypothesis], (hypothesis, *now.open))
    evidence = settled_evidence(now, hypothesis, without)
    rivals = credible_set(without, evidence)
    alike = [r.hypothesis for r in rivals]
    ratio = fall / max(without.scores[0].statistic, 1e-9)
    linear = abs(ratio - 1.0) < _LINEAR  # else resampled scores say nothing of refits
    stable = stability(without, evidence, now.problem, hypothesis, alike, seed) if linear else float("nan")
    return Finding(
        hypothesis=hypothesis,
        estimate=estimate,
        std=std,
        evidence=now.evidence[hypothesis.name],
        p_value=now.p_values[hypothesis.name],
        share=max(share, 0.0),
        rivals=rivals,
        held_out=gain,
        stable=stable,
        nonlinear=ratio,
        beyond=beyond,
        provisional=doubt or beyond or not gain.confirmed or stable < STABLE,
    )


def _likelihood_ratio(now: Search, hypothesis: Hypothesis) -> float:
    """Fall of chi-square by the effect, calibrated with and without it; nan where it cannot be without."""
    rest = replace(now, accepted=tuple(h for h in now.accepted if h != hypothesis))
    fit = refit(rest, {})
    return float("nan") if fit is None else fit.chi2 - now.fit.chi2


def _by_shape(now: Search, hypothesis: Hypothesis, last: Scored) -> Array:
    """Variance (k,), SI, that an effect's own shape adds to its parameters, where the data speak for one."""
    linear = linear_without(now, [hypothesis], [hypothesis]).prewhitened(last.linear.memory)
    residues = own_residues(now.problem, now.fit, [hypothesis])
    if hypothesis.name not in residues:
        return np.zeros(len(hypothesis.parameters))
    shape = own_shape(linear, last.scale, linear.of(hypothesis.parameters), linear.whitened(residues[hypothesis.name]))
    return np.asarray(np.diag(shape.covariance) * linear.scale_of(hypothesis.parameters) ** 2)


def sizes_seen(scored: Scored, now: Search) -> tuple[Detectable, ...]:
    """Minimal detectable sizes of all hypotheses that are not accepted."""
    out = []
    for h, s in zip(scored.hypotheses, scored.scores, strict=True):
        if h in now.accepted:
            continue
        scale = scored.linear.scale_of(h.parameters)
        k = s.leading
        by = absorbing(scored.linear, h, s)
        size = s.mdb * float(scale[k]) * float(np.sqrt(scored.scale.variance))
        out.append(Detectable(h, h.parameters[k], size, 2 * float(scale[k]), by, s.count > 0))
    return tuple(out)


def absorbing(linear: Linear, hypothesis: Hypothesis, score: Score) -> tuple[str, ...]:
    """Declared parameters that could move instead of a hypothesis, largest first; none where enough of it is left."""
    a, k = linear.of(linear.projected), score.leading
    if not a.shape[1] or not score.kept < _KEPT or not score.length2[k] > 0:
        return ()
    column = linear.of(hypothesis.parameters)[:, k]
    coefficients = np.linalg.lstsq(a, column, rcond=1e-9)[0]
    size = np.abs(coefficients) * np.sqrt((a**2).sum(axis=0))
    order = np.argsort(-size)[:4]
    return tuple(linear.projected[j] for j in order if size[j] > 0.2 * size.max())
