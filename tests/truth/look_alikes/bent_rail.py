"""A router's gantry whose right rail is bent, on guides that yield; the drives share the load. SI units.

The truth is a frame of fine beam elements (`tests.truth.gantry`); the bent rail moves its carriage across and turns it
by its slope, and the springs of the guide pass on a part of both. Two sessions, drives read in micrometres.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tests.truth.dimensions import MM
from tests.truth.gantry import RANGES, STROKE, Bow, Gantry
from tests.truth.pinned import Array

from .look_alike import LookAlike, counted, drawn_errors, noise, sessions, table_text, warm_day

MACHINE = Path(__file__).resolve().parents[3] / "machines" / "gantry.yaml"
SIGMA, DIGIT, COUNT = 3e-6, 0.1e-6, 1e-6
PARTS, FRESH = (33, 15), (12, 8)
BENT = (70e-6, 110e-6)
LOW, HIGH = (0.15, 0.0), (1.35, 1.6)
PIECES = (2, 4)
"""Elements on each side of the carriage, in two meshes that extrapolate to less than 10 nm."""


def bent_rail(seed: int) -> LookAlike:
    """The campaign of a seed."""
    rng = np.random.default_rng([seed, 3])
    errors = drawn_errors(seed, RANGES)
    bow = float(rng.choice([-1, 1]) * rng.uniform(*BENT))
    machine = Gantry(bow=Bow(x=bow), pieces=PIECES)
    p = {name: value + errors[name] for name, value in machine.nominal.items()}
    texts = {}
    for name, counts in (("table", PARTS), ("fresh", FRESH)):
        q = counted(machine.inverse(rng.uniform(LOW, HIGH, (sum(counts), 2))), COUNT)
        true = machine.forward(q, p).tcp
        time = np.concatenate([np.cumsum(rng.uniform(30, 60, n)) + 7200 * k for k, n in enumerate(counts)])
        warmth = warm_day(seed, time, 1.5)
        texts[name] = _table(counts, time, warmth, q, counted(true + SIGMA * noise(rng, true.shape), DIGIT))
        texts["exact"] = _table(counts, time, warmth, q, true, 9)
    return LookAlike(
        machine=MACHINE.read_text(encoding="utf-8"),
        causes=(("straight@rail2.x",),),
        declared="effects: {straight@rail2.x: {n2: {value: 0, range: 160 um}, n3: 0, n4: 0}, "
        "carriage_angle@plate2.rz: {a1: {value: 0, range: 500 urad}, a2: {value: 0, identify: false}}}\n",
        values=p | {"straight@rail2.x.n2": -2 / 3 * bow, "carriage_angle@plate2.rz.a1": 4 * bow / STROKE},
        **texts,
    )


def _table(counts: tuple[int, ...], time: Array, warmth: Array, q: Array, true: Array, digits: int = 4) -> str:
    drives = {f"{name} [mm]": q[:, k] / MM for k, name in enumerate(("Y1", "Y2", "X"))}
    channels = {f"{axis} [mm]": true[:, k] / MM for k, axis in enumerate("xyz")}
    head = {"session": sessions(counts), "time [s]": time, "T [degC]": warmth}
    return table_text(head | drives | channels, digits)
