"""Honest tables of machines with drawn parameters, by the independent simulators."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from tests.campaigns import shipped
from tests.hostile.campaigns.sheet import Array, Sheet
from tests.truth import generate

MM = 1e-3


@cache
def _campaign(machine: str) -> Any:
    return generate.campaigns()[machine]


def commanded(machine: str, rows: int) -> Array:
    """Places (n, k), mm, to which the machine was sent: those of `Sheet.shipped`."""
    places = np.asarray(_campaign(machine).poses)
    some = np.unique(np.linspace(0, len(places) - 1, min(rows, len(places))).round().astype(int))
    return np.asarray(places[some, : 3 if places.shape[1] > 2 else 2] / MM)


def measured(
    machine: str,
    seed: int,
    rows: int = 24,
    size: float = 1.0,
    noise: float = 1.0,
    changed: dict[str, float] | None = None,
) -> Sheet:
    """A machine whose parameters are off by normal errors of `size` half ranges, and some by so much more (mm), at
    drawn poses, with `noise` times the stated noise."""
    plan, rng, simulator = shipped(machine), np.random.default_rng([33, seed]), _campaign(machine).machine
    some = np.sort(rng.choice(len(plan.positions), min(rows, len(plan.positions)), replace=False))
    values = plan.model.nominal
    values[plan.index] += size * (plan.drawn(rng) - values)[plan.index]
    for name, by in (changed or {}).items():
        values[plan.model.names.index(name)] += by * MM
    given, positions = plan.model.by_name(values), plan.positions[some]
    found = simulator.forward(positions, {n: given.get(n, v) for n, v in simulator.nominal.items()})
    true = found.tcp[:, : len(plan.sigma)]
    readings = true + noise * rng.normal(size=true.shape) * plan.sigma
    names = (*(a.name for a in plan.model.actuators), *(c.name for c in plan.model.channels))
    table = np.hstack([positions, readings]) / MM
    return Sheet(names, ("mm",) * len(names), table, positions.shape[1])


def together(*sheets: Sheet) -> Sheet:
    """Rows of several tables in one."""
    return sheets[0].having(np.vstack([s.values for s in sheets]))
