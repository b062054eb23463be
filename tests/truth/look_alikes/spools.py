"""Four lines on spools in four sessions: motors without an index, two wrong radii, and line that builds up. SI units.

Nothing is minimised: where the point is held, the three lower lines balance the pull of the fourth, which gives their
tensions, their natural lengths, and the angles at which spirals of line have paid them out. Angles are read in whole
degrees of the motor; the point is read to a tenth of a millimetre.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from tests.truth import dimensions as dim
from tests.truth.pinned import Array

from .look_alike import LookAlike, counted, drawn_errors, noise, sessions, table_text, warm_day

MACHINE = Path(__file__).with_name("spools.yaml")
LINES = dim.HANGPRINTER_LINES
PULL = 0.1
"""N, of line D."""
FOLDS = np.array([2.0, 2.0, 2.0, 4.0])
RADIUS = 0.075
GEAR = 20 / 255
"""RotationVector of the spool per turn of the motor."""
ANCHORED = tuple(f"{line}{axis}" for line in LINES for axis in "xyz")
SIGMA, LINE_SIGMA, DIGIT, DEGREE = 0.3e-3, 0.5e-3, 0.1e-3, np.pi / 180
ROWS, FRESH = (31, 14, 24, 19), (10, 10, 10, 10)
HOMED = 8e-3
"""Standard deviation in m of what is out of a line at reading 0, besides its way to the origin."""
LOW, HIGH, TOP = np.array([-0.42, -0.42, 0.02]), np.array([0.42, 0.42, 1.45]), 2.4


def natural_lengths(places: Array, anchors: Array, ea: float) -> Array:
    """Unstrained lines (N, 4) that hold the point at places (N, 3) under D's pull."""
    way = anchors - places[:, None]
    reach = np.linalg.norm(way, axis=2)
    unit = way / reach[:, :, None]
    lower = np.linalg.solve(unit[:, :3].transpose(0, 2, 1), -PULL * unit[:, 3, :, None])[:, :, 0]
    assert (lower > 0).all()
    tension = np.column_stack([lower, np.full(len(places), PULL)])
    out: Array = reach / (1 + tension / ea)
    return out


def motors(out: Array, radius: Array, turn: float) -> Array:
    """Motor angles (N, 4) in rad that pay out line (N, 4) from spools whose radius changes by `turn` (m/rad).

    A spiral: R = R0 + turn a with the angle a of the spool, so that R0 a + turn a^2 / 2 is paid out. The line is as
    thick on every spool, whatever its radius.
    """
    angle = (np.sqrt(radius**2 + 2 * turn * out * FOLDS) - radius) / turn
    found: Array = angle / GEAR
    return found


def spools(seed: int) -> LookAlike:
    """The campaign of a seed."""
    rng = np.random.default_rng([seed, 3])
    errors = drawn_errors(seed, dict.fromkeys(ANCHORED, 0.05))
    p = {name: dim.HANGPRINTER[name] + error for name, error in errors.items()}
    p |= {"R_low": RADIUS * (1 + rng.uniform(0.006, 0.014)), "R_high": RADIUS * (1 + rng.uniform(0.006, 0.014))}
    growth = -rng.uniform(4e-4, 1.2e-3)  # of the drawn radius, per line
    anchors = np.array([[p[f"{line}{axis}"] for axis in "xyz"] for line in LINES])
    zeros = np.linalg.norm(anchors, axis=1) + HOMED * rng.normal(size=(len(ROWS), 4))
    times = [np.cumsum(rng.uniform(40, 80, n)) + 86400 * k for k, n in enumerate(ROWS)]
    day = np.concatenate([warm_day(10 * seed + k, t, 2.0) for k, t in enumerate(times)])
    texts = {}
    for name, counts in (("table", ROWS), ("fresh", FRESH)):
        places = rng.uniform(LOW, HIGH, size=(sum(counts), 3))
        places[:, :2] *= 1 - places[:, 2:] / TOP
        out = natural_lengths(places, anchors, dim.HANGPRINTER["EA"]) - np.repeat(zeros, counts, axis=0)
        angles = [motors(out + LINE_SIGMA * k * noise(rng, out.shape), _radii(p), growth * RADIUS) for k in (0, 1)]
        read = counted(places + SIGMA * noise(rng, places.shape), DIGIT)
        warmth = day if counts == ROWS else np.repeat(day[np.cumsum(ROWS) - 1], counts)
        time = np.concatenate(times) if counts == ROWS else np.repeat([t[-1] for t in times], counts)
        texts[name] = _table(counts, time, warmth, counted(angles[1], DEGREE), read)
        texts["exact"] = _table(counts, time, warmth, angles[0], places, 9)
    own = {f"z{line}[s{k + 1}]": float(zeros[k, i]) for k in range(len(ROWS)) for i, line in enumerate(LINES)}
    return LookAlike(
        machine=MACHINE.read_text(encoding="utf-8"),
        causes=(("release R_low",), ("release R_high",), ("buildup@*",)),
        declared="parameters: {R_low: {identify: true}, R_high: {identify: true}}\n"
        "effects: {buildup@all: {b: {value: 0, range: 2000 um/m}}}\n",
        values=p | own | {"buildup@all.b": growth},
        **texts,
    )


def _radii(p: Mapping[str, float]) -> Array:
    return np.array([p["R_low"]] * 3 + [p["R_high"]])


def _table(counts: tuple[int, ...], time: Array, warmth: Array, angles: Array, places: Array, digits: int = 3) -> str:
    motor = {f"{line} [deg]": angles[:, i] / DEGREE for i, line in enumerate(LINES)}
    read = {f"{axis} [mm]": places[:, i] / dim.MM for i, axis in enumerate("xyz")}
    head = {"session": sessions(counts), "time [s]": time, "T [degC]": warmth}
    return table_text(head | motor | read, digits)
