"""A tripod head in ten poses: one screw has a wrong pitch. SI units.

Struts are of given length and stay in the planes through their towers: six equations for the six numbers of a pose,
solved by Newton's method. Encoders count micrometres; the gauge shows micrometres and microradians.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.optimize import root

from tests.truth.pinned import Array, rotation_matrix

from .look_alike import LookAlike, counted, drawn_errors, noise, table_text, warm_day

MACHINE = Path(__file__).with_name("head.yaml")
TURNS = np.radians([0.0, 120.0, 240.0])
OUT = np.stack([np.cos(TURNS), np.sin(TURNS), 0 * TURNS], 1)
ACROSS = np.stack([-np.sin(TURNS), np.cos(TURNS), 0 * TURNS], 1)
TOWERS, BALLS, STRUT, TIP = 0.4, 0.25, 0.5, np.array([0.0, 0.0, -0.08])
SIGMA = np.array([3e-6, 10e-6, 10e-6])
DIGITS = np.array([1e-6, 1e-6, 1e-6])
COUNT = 1e-6
RANGES = {f"{k}{i}": 0.2e-3 for k in "lo" for i in (1, 2, 3)}
ROWS, FRESH = 10, 20
HEIGHTS, TILT = (-0.62, -0.50), np.radians(7)


def pose(q: Array, lengths: Array) -> Array:
    """Height of the tip and rotation vector's x and y (3,) at positions (3,) of the carriages."""
    hinges = TOWERS * OUT + q[:, None] * [0, 0, 1.0]

    def off(x: Array) -> Array:
        balls = x[:3] + BALLS * OUT @ rotation_matrix(x[3:]).astype(float).T
        reach = ((balls - hinges) ** 2).sum(1)
        return np.concatenate([(balls * ACROSS).sum(1), (reach - lengths**2) / STRUT])

    first = np.array([0, 0, q.mean() - 0.477, 0, 0, 0])
    x = root(off, first, tol=1e-14).x
    assert np.abs(off(x)).max() < 1e-12
    tip = x[:3] + rotation_matrix(x[3:]).astype(float) @ TIP
    return np.array([tip[2], x[3], x[4]])


def set_values(z: float, rx: float, ry: float) -> Array:
    """Positions (3,) of the nominal carriages for a height of the tip and a rotation vector's x and y."""

    def off(x: Array) -> Array:
        turn = rotation_matrix([rx, ry, x[2]]).astype(float)
        return np.asarray((([x[0], x[1], 0] + BALLS * OUT @ turn.T) * ACROSS).sum(1))

    x, y, rz = root(off, np.zeros(3), tol=1e-14).x
    turn = rotation_matrix([rx, ry, rz]).astype(float)
    centre = np.array([x, y, z]) - [0, 0, (turn @ TIP)[2]]
    balls = centre + BALLS * OUT @ turn.T
    radial = TOWERS - (balls * OUT).sum(1)
    return np.asarray(balls[:, 2] + np.sqrt(STRUT**2 - radial**2))


def head(seed: int) -> LookAlike:
    """The campaign of a seed."""
    rng = np.random.default_rng([seed, 3])
    errors = drawn_errors(seed, RANGES)
    p = {name: error + (STRUT if name[0] == "l" else 0.0) for name, error in errors.items()}
    screw = seed % 3
    scales = np.zeros(3)
    scales[screw] = rng.choice([-1, 1]) * rng.uniform(3e-4, 6e-4)
    texts = {}
    for name, rows in (("table", ROWS), ("fresh", FRESH)):
        wanted = poses(rows, rng)
        q = counted(np.array([set_values(*row) for row in wanted]), COUNT)
        at = q * (1 + scales) + [p["o1"], p["o2"], p["o3"]]
        read = np.array([pose(row, np.array([p["l1"], p["l2"], p["l3"]])) for row in at])
        time = np.cumsum(rng.uniform(200, 400, rows))
        warmth = warm_day(seed, time, 1.0)
        texts[name] = _table(q, counted(read + SIGMA * noise(rng, read.shape), DIGITS), time, warmth)
        texts["exact"] = _table(q, read, time, warmth, 12)
    cause = f"scale@q{screw + 1}"
    return LookAlike(
        machine=MACHINE.read_text(encoding="utf-8"),
        causes=((cause,),),
        declared=f"effects: {{{cause}: {{s: {{value: 0, range: 1000 um/m}}}}}}\n",
        values=p | {f"{cause}.s": float(scales[screw])},
        **texts,
    )


def poses(rows: int, rng: np.random.Generator) -> Array:
    """Heights and tilts (rows, 3) all over the workspace."""
    wanted = rng.uniform([HEIGHTS[0], -TILT, -TILT], [HEIGHTS[1], TILT, TILT], (rows, 3))
    wanted[:, 0] = np.linspace(*HEIGHTS, rows)[rng.permutation(rows)]
    return np.asarray(wanted)


def _table(q: Array, read: Array, time: Array, warmth: Array, digits: int = 6) -> str:
    drives = {f"q{i + 1} [mm]": q[:, i] * 1e3 for i in range(3)}
    channels = {"z [mm]": read[:, 0] * 1e3, "rx [mrad]": read[:, 1] * 1e3, "ry [mrad]": read[:, 2] * 1e3}
    return table_text({"time [s]": time, "T [degC]": warmth} | drives | channels, digits)
