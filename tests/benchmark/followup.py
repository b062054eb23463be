"""Where two effects do the same: further points chosen to tell them apart, and the diagnosis with these.

The points are chosen as `pkmcal plan --aim separate:A,B` does, out of poses that the simulator can reach; they are
measured after the campaign, in the same set-up.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.diagnosis.experiment_design import Aim, best_points, whitened_blocks
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.linear import Linear, linear_problem
from pkmcal_cli.diagnosis.run_diagnosis import Diagnosis
from pkmcal_cli.diagnosis.score import NONCENTRALITY
from tests.benchmark.cases import Case
from tests.benchmark.names import names_of
from tests.benchmark.setting import Ready, diagnosed, ready
from tests.truth.campaigns import Campaign
from tests.truth.noise_true import unit_noise
from tests.truth.shop_conditions import Conditions, conditions
from tests.truth.shop_plans import PLANS
from tests.truth.shop_truth import truth

POOL, MOST = 600, 8
LADDER = (48, 96, 192, 384)
"""Numbers of further points; the first that should tell the members apart is measured."""
ENOUGH = 1.8
"""Size in MDB by which the members should differ, judged from the first campaign's estimates."""


@dataclass(frozen=True)
class Again:
    """The diagnosis with further points; the size (in MDB) by which the truth then differs from each other member of
    the set, the least of them; the same as predicted from the first campaign; how many points."""

    diagnosis: Diagnosis
    apart: float
    predicted: float
    points: int


def again(case: Case, d: Diagnosis) -> Again:
    """The diagnosis with as many further points as should separate the members of the first finding's set."""
    first = case.measured()
    pool = extended(case, first)
    whole = ready(pool)
    known = {h.name: h for h in whole.candidates.hypotheses}
    members = [known[r.hypothesis.name] for r in d.findings[0].rivals][:MOST]
    linear = _linear(whole, d, members)
    aim = Aim("separate", tuple(h.parameters for h in members))
    blocks, planned = whitened_blocks(linear, len(whole.problem)), len(first.readings)
    order = planned + best_points(linear, blocks, planned, aim, LADDER[-1]).rows
    changes = _estimated(_linear(ready(first), d, members), linear, members)
    for points in LADDER:
        rows = np.append(np.arange(planned), np.sort(order[:points]))
        there = taken(pool, rows)
        near = _linear(ready(there), d, members)
        predicted = _differ(near, [c.reshape(len(whole.problem), -1)[rows].ravel() for c in changes], members)
        if predicted >= ENOUGH:
            break
    truths = names_of(case.drawn[0], d)
    rivals = [h for h in members if h.name not in truths]
    return Again(diagnosed(there, case.seed), _apart(case, there, near, rivals), predicted, points)


def _estimated(first: Linear, whole: Linear, members: list[Hypothesis]) -> list[Array]:
    """What each member does to all rows at the size that the first campaign gives it."""
    sizes = [first.score(first.of(h.parameters)).estimate for h in members]
    return [whole.of(h.parameters) @ size for h, size in zip(members, sizes, strict=True)]


def _differ(linear: Linear, changes: list[Array], members: list[Hypothesis]) -> float:
    """The least size of the first member's change with another member projected out, and the other way round."""
    first = [_size(linear, changes[0], other) for other in members[1:]]
    others = [_size(linear, change, members[0]) for change in changes[1:]]
    return min([*first, *others], default=0.0)


def _size(linear: Linear, change: Array, other: Hypothesis) -> float:
    rest = linear.projecting((*linear.projected, *other.parameters))
    return float(np.sqrt(max(float(change @ rest.free(change)), 0.0) / NONCENTRALITY))


def _linear(whole: Ready, d: Diagnosis, members: list[Hypothesis]) -> Linear:
    """The problem at the calibration of the first campaign."""
    others = list(dict.fromkeys(n for h in members for n in h.parameters if n not in whole.selected))
    return linear_problem(whole.problem, d.before.values, whole.selected, others, None)


def _apart(case: Case, there: Campaign, linear: Linear, rivals: list[Hypothesis]) -> float:
    """The least size of the truth's change with one rival projected out."""
    plan, rows = PLANS[case.machine], there.conditions
    geometry = plan.geometry({**plan.nominal, **there.parameters})
    plain = truth(
        plan, geometry, rows, planted=[], extra=there.scenario.extra, seed=case.seed, reference=there.conditions
    ).readings
    change = ((there.true_readings - plain) / there.sigma).ravel()
    return min((_size(linear, change, h) for h in rivals), default=0.0)


def extended(case: Case, first: Campaign) -> Campaign:
    """The campaign with a pool of further rows, measured after it in the last set-up."""
    plan, scenario = PLANS[case.machine], first.scenario
    more = conditions(plan, case.seed, POOL, replace(scenario, stream=2))
    time = more.time + more.air.length
    session = np.full(POOL, first.conditions.session.max())
    more = replace(more, time=time, session=session, temperature=np.round(more.air.at(time), 3))
    whole = joined(first.conditions, more)
    geometry = plan.geometry({**plan.nominal, **first.parameters})
    true = truth(
        plan, geometry, whole, planted=case.planted, extra=scenario.extra, seed=case.seed, reference=first.conditions
    ).readings
    rng = np.random.default_rng((case.seed, 7))
    noise = first.sigma * unit_noise(scenario.noise, POOL, len(first.sigma), rng)
    readings = np.vstack([first.readings, true[len(first.readings) :] + noise])
    bad = np.append(first.outlier, np.zeros(POOL, dtype=bool))
    return replace(first, conditions=whole, readings=readings, true_readings=true, outlier=bad)


ROWS = ("poses", "q", "time", "session", "temperature", "payload", "direction")


def joined(first: Conditions, more: Conditions) -> Conditions:
    """Circumstances of the rows of both."""
    both: dict[str, Any] = {name: np.concatenate([getattr(first, name), getattr(more, name)]) for name in ROWS}
    return replace(first, **both)


def taken(whole: Campaign, rows: Array) -> Campaign:
    """Some rows of a campaign."""
    some: dict[str, Any] = {name: getattr(whole.conditions, name)[rows] for name in ROWS}
    chosen = replace(whole.conditions, **some)
    parts: dict[str, Any] = {name: getattr(whole, name)[rows] for name in ("readings", "true_readings", "outlier")}
    return replace(whole, conditions=chosen, **parts)
