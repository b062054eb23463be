"""What is told of an accepted effect, and of effects that these data cannot show."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.base.stages import Stage
from pkmcal_cli.calibration.condensed import condensed
from pkmcal_cli.calibration.error_budget import error_budget, held_parameters
from pkmcal_cli.diagnosis.confirm import HeldOutGain, held_out_gain
from pkmcal_cli.diagnosis.detection import Detection
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.model_discrepancy import own_discrepancies, own_discrepancy
from pkmcal_cli.diagnosis.refine import Rival, RunnerUp, rivals_of, set_of
from pkmcal_cli.diagnosis.refits import refit
from pkmcal_cli.diagnosis.score import UNUSUAL
from pkmcal_cli.diagnosis.scoring import Scored, Search, linear_without
from pkmcal_cli.diagnosis.search_options import SearchOptions
from pkmcal_cli.diagnosis.selection_bias import LARGEST, SelectedSize
from pkmcal_cli.diagnosis.separable import Separable, separable
from pkmcal_cli.diagnosis.stability import STABLE, Stability, stability
from pkmcal_cli.diagnosis.trial import Procedure
from pkmcal_cli.diagnosis.visible_sizes import VisibleSizes, visible_sizes

_LINEAR = 0.2  # by which the fall of chi-square may differ from the score


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
    stable: Stability  # of resamples of the rows that name it, or one of its set; a nan where it is not linear
    nonlinear: float  # likelihood ratio over score statistic; 1 where it acts in proportion to its size
    beyond: bool  # larger than twice what is plausible
    provisional: bool
    runner_up: RunnerUp | None  # the best of those that are no rivals
    selected: SelectedSize | None  # its size where being found made it larger
    separable: Separable = field(default_factory=Separable)  # which of it and its rivals further points can tell apart
    run_away: Mapping[str, float] | None = None  # of what is far off: offsets of declared parameters without it, SI
    absorbed: bool = False  # whether these explain as much

    def compared(self, search: Search) -> Finding:
        """The same with what further points can separate."""
        if not self.ambiguous:
            return self
        rivals = [r.hypothesis for r in self.rivals]
        return replace(self, separable=separable(search, self.hypothesis, rivals))

    @property
    def ambiguous(self) -> bool:
        """Whether the data support several effects in its place; fewer or more places of a group are the same one."""
        return any(r.hypothesis != self.hypothesis and not r.hypothesis.nested(self.hypothesis) for r in self.rivals)


@dataclass(frozen=True)
class _Basis:
    """What all findings of a search are told by: scored at the `last`, fall of chi-square by `every` effect, whether
    something is in `doubt`, variances (SI, by parameter) that parameters add which are not identified."""

    last: Scored
    every: float
    doubt: bool
    by_held: Mapping[str, float]
    seed: int

    def variances(self, search: Search, hypothesis: Hypothesis) -> Array:
        """Variances (k,), SI, of an effect's numbers by noise and by parameters that are not identified; 0: known."""
        std = dict(zip(search.fit.selected, search.fit.std, strict=True))
        noise = self.last.scale.variance * search.inflation
        return np.array([noise * std.get(n, 0.0) ** 2 + self.by_held.get(n, 0.0) for n in hypothesis.parameters])


def findings_of(search: Search, last: Scored, doubt: bool, options: SearchOptions) -> tuple[Finding, ...]:
    """What is told of accepted effects, by what they gain. `last`: scored at the end; `doubt`: something is unknown."""
    if not search.accepted:
        return ()
    every = linear_without(search, search.near, ()).chi2 - search.fit.chi2  # what all of them explain
    basis, findings = _Basis(last, every, doubt, _by_held(search), options.seed), []
    for k, h in enumerate(search.near):
        options.observe(Stage("findings", k, len(search.near)))
        findings.append(_finding(search, h, basis))
    findings += [_far_finding(search, h, basis) for h in search.accepted if h.name in search.far_off]
    findings = [f.compared(search) for f in findings]
    return tuple(sorted(findings, key=lambda f: -f.held_out.gain))


def _by_held(search: Search) -> Mapping[str, float]:
    """Variances, SI, that parameters which are not identified add to those that are."""
    held = held_parameters(search.problem, search.fit.selected, ())
    budget = error_budget(search.problem, search.fit, held)
    return dict(zip(budget.names, budget.std_by_held**2, strict=True))


def _finding(search: Search, hypothesis: Hypothesis, basis: _Basis) -> Finding:
    names, last, seed = search.problem.model.names, basis.last, basis.seed
    index = [names.index(n) for n in hypothesis.parameters]
    std = tuple(float(s) for s in np.sqrt(basis.variances(search, hypothesis) + _by_shape(search, hypothesis, last)))
    estimate = tuple(float(v) for v in search.fit.values[index])
    nominal, ranges = search.problem.model.nominal[index], search.problem.model.ranges[index]
    null = search.null[index]
    part = np.array([n not in hypothesis.free for n in hypothesis.parameters])
    beyond = bool((np.abs(np.array(estimate) - nominal) > UNUSUAL * ranges)[part].any())
    gain = held_out_gain(search, hypothesis)
    fall = _likelihood_ratio(search, hypothesis)
    share = min(fall / basis.every, 1.0) if basis.every > 0 and np.isfinite(fall) else float("nan")
    near = set_of(search, hypothesis)
    without = near.without
    ratio = fall / max(without.scores[0].statistic, 1e-9)
    linear = abs(ratio - 1.0) < _LINEAR  # else resampled scores say nothing of refits
    stable, selected = Stability(float("nan")), None
    if linear:
        stable = stability(without, near.evidence, search.problem, hypothesis, near.members, seed)
        off, variance = np.array(estimate) - null, last.scale.variance
        selected = _selected(search, hypothesis, off, np.array(std), without, variance=variance, seed=seed)
    return Finding(
        hypothesis=hypothesis,
        estimate=estimate,
        std=std,
        evidence=search.evidence[hypothesis.name],
        p_value=search.p_values[hypothesis.name],
        share=max(share, 0.0),
        rivals=near.rivals,
        runner_up=near.runner_up,
        held_out=gain,
        stable=stable,
        nonlinear=ratio,
        beyond=beyond,
        provisional=basis.doubt or beyond or not gain.confirmed or stable.share < STABLE,
        selected=selected,
    )


def _far_finding(search: Search, hypothesis: Hypothesis, basis: _Basis) -> Finding:
    """What is told of an effect that is far off: nothing that is linear at its null."""
    model, fit = search.problem.model, search.fit
    gain, far_off = held_out_gain(search, hypothesis), search.far_off[hypothesis.name]
    return Finding(
        hypothesis=hypothesis,
        estimate=tuple(float(fit.values[model.names.index(n)]) for n in hypothesis.parameters),
        std=tuple(float(s) for s in _far_std(search, hypothesis, basis)),
        evidence=search.evidence[hypothesis.name],
        p_value=search.p_values[hypothesis.name],
        share=float("nan"),
        rivals=rivals_of(search, hypothesis),
        runner_up=None,
        held_out=gain,
        stable=Stability(float("nan")),
        nonlinear=float("nan"),
        beyond=False,
        provisional=basis.doubt or far_off.absorbed is not None or not gain.confirmed,
        selected=None,
        run_away=far_off.offsets,
        absorbed=far_off.absorbed is not None,
    )


def _far_std(search: Search, hypothesis: Hypothesis, basis: _Basis) -> Array:
    """Standard uncertainties (k,), SI, of an effect of any size: declared parameters are known by their ranges.

    They may stand for it, and then the data alone say nothing of it.
    """
    model, names = search.problem.model, search.fit.selected
    ranges = model.ranges[[model.names.index(n) for n in names]]
    columns = condensed(search.problem, search.fit.last).jacobian * ranges
    known = np.array([2.0 if n in search.declared else 0.0 for n in names])
    variance = basis.last.scale.variance * search.inflation
    precision = columns.T @ columns / variance + np.diag(known**2)
    size = np.sqrt(np.diag(precision))
    covariance = np.linalg.pinv(precision / np.outer(size, size), hermitian=True)
    squares = dict(zip(names, np.diag(covariance) * (ranges / size) ** 2, strict=True))
    return np.sqrt([squares.get(n, 0.0) + basis.by_held.get(n, 0.0) for n in hypothesis.parameters])


def _selected(
    search: Search, hypothesis: Hypothesis, estimate: Array, std: Array, without: Scored, variance: float, seed: int
) -> SelectedSize | None:
    """The size of an effect (k,), SI, corrected for being found, by what the procedure detects in its direction.

    `without`: scored without it, the effect first; `variance`: of the noise, in which no effect is.
    """
    score = without.scores[0]
    shown = [n not in hypothesis.free for n in hypothesis.parameters] & np.isfinite(std) & (std > 0)
    j = int(np.argmax(np.where(shown, np.abs(estimate) / np.where(shown, std, 1.0), 0.0)))  # the number that is told
    deviation = np.where(score.length2 > 0, estimate / without.linear.scale_of(hypothesis.parameters), 0.0)
    length = float(np.linalg.norm(deviation))
    size = float(np.sqrt(np.maximum(deviation @ score.whole @ deviation, 0.0) / variance))  # in std
    if not score.count or not 0 < size <= LARGEST or not abs(estimate[j]) > 0 or not shown[j]:
        return None
    detection = Detection(without.linear, search.problem, [hypothesis], seed)
    acceptance = detection.acceptance(0, deviation / length, Procedure(search.critical, without.scale))
    corrected = acceptance.corrected(size)
    return None if corrected is None else corrected.widened(size * std[j] / abs(estimate[j]))


def _likelihood_ratio(search: Search, hypothesis: Hypothesis) -> float:
    """Fall of chi-square by the effect, calibrated with and without it; nan where it cannot be without."""
    others = replace(search, accepted=tuple(h for h in search.accepted if h != hypothesis))
    fit = refit(others, {})
    return float("nan") if fit is None else fit.chi2 - search.fit.chi2


def _by_shape(search: Search, hypothesis: Hypothesis, last: Scored) -> Array:
    """Variance (k,), SI, that an effect's own discrepancy adds to its parameters, where the data speak for one."""
    linear = linear_without(search, [hypothesis], [hypothesis]).prewhitened(last.linear.memory)
    discrepancies = own_discrepancies(search.problem, search.fit, [hypothesis], search.known)
    if hypothesis.name not in discrepancies:
        return np.zeros(len(hypothesis.parameters))
    columns, free = linear.tested(hypothesis), linear.whitened(discrepancies[hypothesis.name])
    shape = own_discrepancy(linear.beside(hypothesis), last.scale, columns, free)
    return np.asarray(np.diag(shape.covariance) * linear.scale_of(hypothesis.parameters) ** 2)


def sizes_seen(scored: Scored, search: Search, seed: int) -> tuple[VisibleSizes, ...]:
    """How large hypotheses that are not accepted would have to be."""
    names, rivals = {h.name for h in search.accepted}, search.candidates.hypotheses
    with_parts = {h.name: h for h in rivals}
    hypotheses = [with_parts.get(h.name, h) for h in scored.hypotheses if h.name not in names and not h.members]
    detection = Detection(scored.linear, search.problem, hypotheses, seed, rivals)
    return visible_sizes(detection, Procedure(search.critical, scored.scale))
