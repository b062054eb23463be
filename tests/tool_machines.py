"""Machines whose tool point moves in coordinates of many kinds, and the closed form of the head."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.optimize import fsolve

from pkmcal_cli.base.rotation import Array, exp

HEAD = (Path(__file__).parent / "data" / "head.yaml").read_text()
BASE, PLATFORM, TOOL = 0.3, 0.2, 0.1
LEG = np.hypot(0.1, 0.48)

CRANK = """
units: {length: mm, angle: deg, force: N}
space: planar
ranges: {length: 0.1}
parameters: {r: 200, e: 40}
guides: {rail: {along: x}}
bodies:
  slide: {guide: rail, at: 100, points: {P: [0, 0]}}
  arm: {at: [100, 0], turn: 30, points: {tip: [r, e]}}
joints: {hub: {between: [P, arm], type: revolute}}
actuators: {q: {moves: slide}, a: {turns: arm}}
sensors: {camera: {at: tip, reads: [x, y, rz], sigma: {position: 10 um, orientation: 0.01}, frame: machine}}
"""
"""A carriage and a crank on it: x = q + r cos a - e sin a, y = r sin a + e cos a, rz = a - 30 deg."""

ROCKER = """
units: {length: mm, angle: deg, force: N}
space: planar
ranges: {length: 0.1}
parameters: {a: 100, b: 250, c: 180}
ground: {O: [0, 0], Q: [240, 0]}
bodies:
  crank: {at: [0, 0], turn: 60, points: {A: [a, 0]}}
  rocker: {at: [240, 0], turn: 95, points: {B: [c, 0], mark: [c/2, 40]}}
joints: {j1: {between: [O, crank], type: revolute}, j2: {between: [Q, rocker], type: revolute}}
bars: {coupler: {between: [A, B], length: b}}
actuators: {q: {turns: crank}}
tool_point: mark
"""
"""A four-bar linkage: one degree of freedom."""


GIMBAL = """
units: {length: mm, angle: rad}
space: spatial
bodies:
  outer: {at: [0, 0, 0], points: {O1: [0, 0, 0]}}
  middle: {at: [0, 0, 0], points: {O2: [0, 0, 0]}}
  inner: {at: [0, 0, 0], points: {tip: [0, 0, 10]}}
ground: {O: [0, 0, 0]}
joints:
  jz: {between: [O, outer], type: revolute, axis: z}
  jy: {between: [O1, middle], type: revolute, axis: y}
  jx: {between: [O2, inner], type: revolute, axis: x}
actuators: {qz: {turns: outer}, qy: {turns: middle}, qx: {turns: inner}}
tool_point: tip
"""


def head_poses(z: Array, rx: Array, ry: Array) -> tuple[Array, Array]:
    """Poses (N, 6) of the head's tool and its drive positions (N, 3): each ball joint stays in the plane of its leg."""
    poses, drives = [], []
    angles = np.radians([0, 120, 240])
    out = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    across = np.stack([-np.sin(angles), np.cos(angles), 0 * angles], axis=1)

    def joints(unknown: Array, row: int) -> tuple[Array, Array]:
        pose = np.array([unknown[0], unknown[1], z[row], rx[row], ry[row], unknown[2]])
        return pose, pose[:3] + (PLATFORM * out - [0, 0, TOOL]) @ exp(pose[3:]).T

    for row in range(len(z)):
        found = fsolve(lambda u, row=row: (joints(u, row)[1] * across).sum(axis=1), np.zeros(3), xtol=1e-13)
        pose, points = joints(found, row)
        radial = (points * out).sum(axis=1)
        poses.append(pose)
        drives.append(points[:, 2] - np.sqrt(LEG**2 - (BASE - radial) ** 2))
    return np.array(poses), np.array(drives)


def drawn_head_poses(count: int = 20) -> tuple[Array, Array]:
    rng = np.random.default_rng(0)
    return head_poses(rng.uniform(0.5, 0.7, count), *rng.uniform(-0.35, 0.35, (2, count)))
