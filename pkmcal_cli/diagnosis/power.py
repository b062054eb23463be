"""Campaigns as a plan would give them, with one effect each or none, diagnosed: how often what is found."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.base.stages import Observer, unobserved
from pkmcal_cli.calibration.error_budget import held_parameters
from pkmcal_cli.calibration.identify import RowsFailed
from pkmcal_cli.calibration.problem import Problem, usable
from pkmcal_cli.diagnosis.experiment_design import Plan, Visibility
from pkmcal_cli.diagnosis.hypotheses import RELEASE
from pkmcal_cli.diagnosis.run_diagnosis import Diagnosis, diagnose
from pkmcal_cli.prediction import Request, predict

_OUTCOMES = ("named", "in_set", "other", "missed", "lost")


@dataclass(frozen=True, kw_only=True)
class Rates:
    """Of campaigns with an effect of this size (SI, of its leading number), or with none: in how many it is named and
    nothing else, one of several names, not named but something else is, and nothing is; `lost`: not predicted."""

    effect: Visibility | None
    size: float
    named: int = 0
    in_set: int = 0
    other: int = 0
    missed: int = 0
    lost: int = 0

    @property
    def count(self) -> int:
        """Campaigns that were diagnosed."""
        return self.named + self.in_set + self.other + self.missed


@dataclass(frozen=True)
class Campaigns:
    """How campaigns are drawn and diagnosed: parameters (P,) about `values` by their ranges, noise as it is stated."""

    plan: Plan
    values: Array
    selected: tuple[str, ...]
    alpha: float
    seed: int

    @property
    def held(self) -> tuple[str, ...]:
        """Parameters that are not identified, and are off nominal by their ranges all the same."""
        tried = {n for h in self.plan.candidates.hypotheses if h.effect != RELEASE for n in h.parameters}
        return tuple(n for n in held_parameters(self.plan.problem, self.selected, ()) if n not in tried)

    def outcome(self, effect: Visibility | None, number: int) -> str:
        """What becomes of a campaign with an effect of the size detected in 80 %, of either sign; None: none."""
        return _outcome(self._diagnosis(effect, _size(effect), number), effect)

    def _diagnosis(self, effect: Visibility | None, size: float, number: int) -> Diagnosis | None:
        """Of one campaign; None where it cannot be predicted."""
        plan = self.plan
        stream = 0 if effect is None else 1 + [v.hypothesis for v in plan.visibilities].index(effect.hypothesis)
        rng = np.random.default_rng([self.seed, 23, number, stream])
        problem = measured(plan.problem, self._drawn(effect, size, rng), rng)
        if problem is None:
            return None
        try:
            return diagnose(plan.candidates, problem, self.selected, self.alpha, self.seed)
        except (RowsFailed, np.linalg.LinAlgError):
            return None

    def _drawn(self, effect: Visibility | None, size: float, rng: np.random.Generator) -> Array:
        """True parameters (P,)."""
        model = self.plan.problem.model
        index = [model.names.index(n) for n in (*self.selected, *self.held)]
        values = self.values.copy()
        low, high = np.array([model.parameters[k].bounds for k in index]).reshape(-1, 2).T
        values[index] = np.clip(values[index] + 0.5 * model.ranges[index] * rng.normal(size=len(index)), low, high)
        if effect is not None:
            k = model.names.index(effect.parameter)
            least, most = model.parameters[k].bounds
            signs = [s for s in (-1.0, 1.0) if least <= self.values[k] + s * size <= most] or [1.0]
            values[k] = self.values[k] + signs[int(rng.integers(len(signs)))] * size
        return values


@dataclass(frozen=True)
class PowerWork:
    """So many campaigns of each effect, one after the other; None: without any."""

    campaigns: Campaigns
    effects: tuple[Visibility | None, ...]
    count: int

    def __len__(self) -> int:
        return self.count * len(self.effects)

    def __call__(self, number: int, observe: Observer = unobserved) -> str:
        """What becomes of a campaign, as `Rates` counts it."""
        effect, campaign = divmod(number, self.count)
        return self.campaigns.outcome(self.effects[effect], campaign)

    def fits(self, result: Any) -> bool:
        """Whether this could be what becomes of a campaign."""
        return result in _OUTCOMES

    def rates(self, outcomes: Mapping[int, str]) -> tuple[Rates, ...]:
        """Counted, by effect."""
        out = []
        for k, effect in enumerate(self.effects):
            counted = Counter(outcomes[number] for number in range(k * self.count, (k + 1) * self.count))
            out.append(Rates(effect=effect, size=_size(effect), **counted))
        return tuple(out)


def _size(effect: Visibility | None) -> float:
    return 0.0 if effect is None else effect.detected


def measured(problem: Problem, values: Array, rng: np.random.Generator) -> Problem | None:
    """A campaign of a plan at true parameters (P,), with noise; None where half of its rows cannot be predicted."""
    driven = problem.moved(np.nan_to_num(problem.reading_sigma) * rng.normal(size=problem.rows.readings.shape))
    prediction = predict(problem.model, values, driven, Request())
    if 2 * prediction.solved.sum() < len(problem):
        return None
    readings = prediction.values + np.nan_to_num(problem.sigma) * rng.normal(size=problem.sigma.shape)
    return usable(replace(problem, readings=readings, measured=problem.measured & np.isfinite(readings)))


def chosen(visibilities: Sequence[Visibility], names: Sequence[str]) -> list[Visibility]:
    """Effects by their names; without any, of each kind the place that needs the largest size that is plausible."""
    if names:
        return [v for v in visibilities if v.hypothesis.name in names]
    hardest: dict[str, Visibility] = {}
    for v in visibilities:
        kind = v.hypothesis.effect
        if v.status == "invisible" or kind == RELEASE or not v.detected < v.plausible:
            continue
        if kind not in hardest or v.detected / v.plausible > hardest[kind].detected / hardest[kind].plausible:
            hardest[kind] = v
    return list(hardest.values())


def _outcome(d: Diagnosis | None, effect: Visibility | None) -> str:
    """What became of a campaign, as `Rates` counts it."""
    if d is None:
        return "lost"
    others = len(d.findings) + len(d.unknown) + len(d.bad_rows)
    if effect is None:
        return "other" if others else "missed"
    name = d.same.get(effect.hypothesis.name, effect.hypothesis.name)
    finding = next((f for f in d.findings if f.hypothesis.name == name), None)
    if finding is not None and not finding.ambiguous and others == 1:
        return "named"
    if finding is not None or any(r.hypothesis.name == name for f in d.findings for r in f.rivals):
        return "in_set"
    return "other" if others else "missed"
