"""A delta whose rails lean by milliradians: 285 heights of its tool to 14 um. SI units.

The plate is probed in 57 points, and again on gauge blocks at four more levels: on the plate alone the joints travel
too little, and what six leans do to its heights is what rods, stops and turns do too. Closed form: three spheres about
the carriages' joints, which run along straight lines that are not vertical. Steppers go to whole steps. One session of
three quarters of an hour, in which the printer warms a little.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from tests.truth import dimensions as dim
from tests.truth.pinned import Array
from tests.truth.spatial import spheres

from .look_alike import LookAlike, counted, drawn_errors, noise, table_text, warm_day

MACHINE = Path(__file__).with_name("leaning-delta.yaml")
SIGMA, STEP, DIGIT = 14e-6, 12.5e-6, 1e-6
LEAN = 1.5e-3
"""Standard deviation of each of the six leans, rad: 0.75 mm over half a metre."""
PITCH, POINTS, FRESH = 0.022, 57, 60
LEVELS = np.arange(5) * 0.045
ROWS = POINTS * len(LEVELS)
MIDDLE = 0.31
"""Reading at which the leaning rails are where the vertical ones would be."""
TOWERS = (1, 2, 3)


def joints(q: Array, p: Mapping[str, float], leans: Array) -> Array:
    """Places (N, 3, 3) of the carriages' joints at readings (N, 3); `leans` (3, 2): outwards and to the left, rad."""
    angles = np.add(dim.DELTA_PRINTER_TOWERS, (p["turn1"], p["turn2"], 0.0))
    out = np.stack([np.cos(angles), np.sin(angles), 0 * angles], 1)
    left = np.stack([-out[:, 1], out[:, 0], 0 * angles], 1)
    travel = q + np.array([p["stop1"], p["stop2"], p["stop3"]])
    over = (q - MIDDLE)[:, :, None] * (leans[:, :1] * out + leans[:, 1:] * left)
    up = np.array([0.0, 0.0, 1.0])
    found: Array = p["radius"] * out + travel[:, :, None] * up + over
    return found


def heights(q: Array, p: Mapping[str, float], leans: Array) -> Array:
    """Heights (N,) of the nozzle at readings (N, 3)."""
    rods = np.full(3, p["rod"])
    return np.array([spheres(row, rods, -1)[2] for row in joints(q, p, leans)])


def set_values(places: Array) -> Array:
    """Readings (N, 3) of the nominal machine whose nozzle is at places (N, 3), in whole steps."""
    p = dim.DELTA_PRINTER
    towers = p["radius"] * np.stack([np.cos(dim.DELTA_PRINTER_TOWERS), np.sin(dim.DELTA_PRINTER_TOWERS)], 1)
    level = places[:, None, :2] - towers
    return counted(places[:, 2:] + np.sqrt(p["rod"] ** 2 - (level**2).sum(2)), STEP)


def plates() -> Array:
    """The points (285, 3) of a square grid that are nearest to the middle, row by row, level by level."""
    lines = np.arange(-6, 7) * PITCH
    grid = np.stack(np.meshgrid(lines, lines, indexing="ij"), -1).reshape(-1, 2)
    near = grid[np.sort(np.argsort(np.hypot(*grid.T), kind="stable")[:POINTS])]
    return np.column_stack([np.tile(near, (len(LEVELS), 1)), np.repeat(LEVELS, POINTS)])


def leaning_delta(seed: int) -> LookAlike:
    """The campaign of a seed."""
    rng = np.random.default_rng([seed, 3])
    errors = drawn_errors(seed, dim.DELTA_PRINTER_RANGES)
    p = {name: value + errors[name] for name, value in dim.DELTA_PRINTER.items()}
    leans = LEAN * rng.normal(size=(3, 2))
    time = np.cumsum(rng.uniform(8, 11, ROWS))
    warmth = warm_day(seed, time, 1.5)
    late = rng.uniform(0, time[-1], FRESH)
    q, other = set_values(plates()), set_values(anywhere(rng))
    read, exact = heights(q, p, leans), heights(other, p, leans)
    late_warmth = np.interp(late, time, warmth)
    names = [f"guide_angle@rail{i}.{axis}" for i in TOWERS for axis in "xy"]
    entries = ", ".join(f"{name}: {{g: {{value: 0, range: 4 mrad}}, over: [150, 470]}}" for name in names)
    return LookAlike(
        machine=MACHINE.read_text(encoding="utf-8"),
        table=_table(q, counted(read + SIGMA * noise(rng, (ROWS,)), DIGIT), time, warmth),
        causes=(("guide_angle@*",),),
        declared=f"effects: {{{entries}}}\n",
        fresh=_table(other, counted(exact + SIGMA * noise(rng, (FRESH,)), DIGIT), late, late_warmth),
        exact=_table(other, exact, late, late_warmth, 9),
        values=p | dict(zip((f"{name}.g" for name in names), leans.ravel().tolist(), strict=True)),
    )


def anywhere(rng: np.random.Generator) -> Array:
    """Other places (60, 3) of the same volume."""
    radius, turn = 0.09 * np.sqrt(rng.uniform(size=FRESH)), rng.uniform(0, 2 * np.pi, FRESH)
    return np.column_stack([radius * np.cos(turn), radius * np.sin(turn), rng.uniform(0, LEVELS[-1], FRESH)])


def _table(q: Array, read: Array, time: Array, warmth: Array, digits: int = 4) -> str:
    columns: dict[str, Array] = {f"q{i} [mm]": q[:, i - 1] / dim.MM for i in TOWERS}
    return table_text({"time [s]": time, "T [degC]": warmth, **columns, "z [mm]": read / dim.MM}, digits)
