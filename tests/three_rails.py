"""A plate on three rods with carriages on three rails along x, homed anew in each session, by its few lines.

What a tracker reads of the tool, and where the tool truly is at set values. Lengths in mm, angles in rad.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pkmcal_cli.base.rotation import Array

Truth = dict[str, Array]
SIGMA, TURN = 10e-3, 1e-4
MACHINE = """\
units: {length: mm, angle: rad, force: N}
space: planar
ranges: {length: 0.2}
parameters:
  "l{i}": {each: {i: [1, 2, 3]}, nominal: 620}
  "z{i}": {each: {i: [1, 2, 3]}, nominal: 0, range: 1, per: session}
  "h{i}": {each: {i: [1, 2, 3], v: [0, 0, 1000]}, nominal: "{v}"}
  tx: 30
  ty: -20
  "p{i}": {each: {i: [1, 2, 3], v: [-60, 60, 60]}, nominal: "{v}", range: 0.1, identify: false}
guides: {"rail{i}": {each: {i: [1, 2, 3]}, at: [0, "h{i}"], along: x}}
bodies:
  "c{i}": {each: {i: [1, 2, 3], a: [877, 123, 123]}, guide: "rail{i}", at: "{a}", points: {"C{i}": [0, 0]}}
  plate: {at: [500, 500], points: {P1: [p1, -60], P2: [p2, -60], P3: [p3, 60], T: [tx, ty]}}
bars: {"rod{i}": {each: {i: [1, 2, 3]}, between: ["C{i}", "P{i}"], length: "l{i}"}}
actuators: {"q{i}": {each: {i: [1, 2, 3]}, moves: "c{i}", zero: "z{i}", limits: [-250, 1250]}}
sensors:
  tracker: {at: T, reads: [x, y, rz], sigma: {position: 10 um, orientation: 100 urad}, frame: machine}
tool_point: T
"""
NOMINAL: Truth = {
    "l": np.full(3, 620.0),
    "h": np.array([0.0, 0.0, 1000.0]),
    "t": np.array([30.0, -20.0]),
    "p": np.array([-60.0, 60.0, 60.0]),
}
SIGMAS = {"l": 0.1, "h": 0.1, "t": 0.1, "p": 0.05}
"""Half the ranges."""
SESSIONS = ("mon", "tue", "wed")
_HEIGHTS, _SIDES = np.array([-60.0, -60.0, 60.0]), np.array([1.0, -1.0, -1.0])


def drawn(rng: np.random.Generator) -> tuple[Truth, dict[str, Array]]:
    """A true machine as its ranges say, what is not identified too; zeros (3,) of its sessions."""
    truth = {name: NOMINAL[name] + sigma * rng.normal(size=NOMINAL[name].shape) for name, sigma in SIGMAS.items()}
    return truth, {session: 0.5 * rng.normal(size=3) for session in SESSIONS}


def places(rng: np.random.Generator, count: int) -> Array:
    """Poses (n, 3) of the tool."""
    low, high = [400.0, 400.0, -0.26], [600.0, 600.0, 0.26]
    return rng.uniform(low, high, (count, 3))


def carriages(poses: Array, truth: Truth) -> Array:
    """Where along their rails (n, 3) the carriages are."""
    c, s = np.cos(poses[:, 2])[:, None], np.sin(poses[:, 2])[:, None]
    along, up = truth["p"] - truth["t"][0], _HEIGHTS - truth["t"][1]
    x, y = poses[:, :1] + c * along - s * up, poses[:, 1:2] + s * along + c * up
    return np.asarray(x + _SIDES * np.sqrt(truth["l"] ** 2 - (y - truth["h"]) ** 2))


def tool(at: Array, truth: Truth, guess: Array) -> Array:
    """Poses (n, 3) of the tool with the carriages there (n, 3), by Newton's method."""
    poses, small = guess.copy(), (1e-4, 1e-4, 1e-6)
    for _ in range(8):
        ends = [
            (carriages(poses + d, truth) - carriages(poses - d, truth)) / (2 * e)
            for d, e in zip(np.diag(small), small, strict=True)
        ]
        off = at - carriages(poses, truth)
        poses = poses + np.linalg.solve(np.stack(ends, axis=2), off[..., None])[..., 0]
    assert np.abs(at - carriages(poses, truth)).max() < 1e-9
    return poses


def measure(truth: Truth, zeros: dict[str, Array], rng: np.random.Generator, file: Path, rows: int = 12) -> None:
    """A table of some rows of each session."""
    lines = ["session,q1,q2,q3,x,y,rz"]
    for session, zero in zeros.items():
        poses = places(rng, rows)
        readings = np.round(carriages(poses, NOMINAL), 4)
        seen = tool(readings + zero, truth, poses) + rng.normal(size=poses.shape) * [SIGMA, SIGMA, TURN]
        lines += [f"{session}," + ",".join(f"{v:.7f}" for v in row) for row in np.hstack([readings, seen]).tolist()]
    file.write_text("\n".join([*lines, ""]), encoding="utf-8")
