"""Tables of the shipped machines as the independent simulators measure them, for commands that read files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pkmcal_cli.base.rotation import Array
from tests.campaigns import shipped
from tests.truth import generate

MM = 1e-3


def true_values(machine: str, seed: int, **changed: float) -> Array:
    """Parameter values (P,), SI, drawn from the prior; some of them changed by so much."""
    plan = shipped(machine)
    values = plan.drawn(np.random.default_rng([31, seed]))
    for name, by in changed.items():
        values[plan.model.names.index(name)] += by
    return values


def write_table(file: Path, machine: str, values: Array, seed: int, rows: int, turn: float | None = None) -> str:
    """A table of rows at poses that are drawn, noise as stated, in mm; turn: of an instrument elsewhere, rad."""
    plan, rng = shipped(machine), np.random.default_rng([32, seed])
    simulator = generate.campaigns()[machine].machine
    some = np.sort(rng.choice(len(plan.positions), rows, replace=False))
    given, positions = plan.model.by_name(values), plan.positions[some]
    truth = simulator.forward(positions, {n: given.get(n, v) for n, v in simulator.nominal.items()})
    readings = truth.tcp[:, : len(plan.sigma)]
    if turn is not None:
        cos, sin = np.cos(turn), np.sin(turn)
        readings = readings @ np.array([[cos, sin], [-sin, cos]]) + [0.4, -0.7]
    readings = readings + rng.normal(size=readings.shape) * plan.sigma
    names = [*(a.name for a in plan.model.actuators), *(c.name for c in plan.model.channels)]
    lines = [",".join(f"{n} [mm]" for n in names)]
    lines += [",".join(f"{v / MM:.7f}" for v in row) for row in np.hstack([positions, readings])]
    file.write_text("\n".join(lines) + "\n")
    return str(file)
