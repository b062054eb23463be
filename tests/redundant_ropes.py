"""Machines whose redundant drives hold ropes: a point in a plane, a platform on eight ropes; statics of their own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls
from scipy.spatial.transform import Rotation

from tests.truth.pinned import Array

_STIFF = 1e5  # weight of the balance of forces against that of least forces
PLANAR = """
units: {{length: mm, angle: deg, force: N}}
space: planar
ranges: {{length: 2}}
parameters: {{x2: 2000, y3: 1500}}
ground: {{A1: [0, 0], A2: [x2, 0], A3: [2000, y3], A4: [0, 1500]}}
nodes: {{load: {{at: [1000, 750]}}}}
ropes: {{"r{{i}}": {{each: {{i: [1, 2, 3, 4]}}, between: ["A{{i}}", load], EA: {ea} N, t_min: {least}}}}}
actuators:
  "q{{i}}": {{each: {{i: [1, 2]}}, winds: "r{{i}}", zero: home}}
  "q{{j}}": {{each: {{j: [3, 4]}}, winds: "r{{j}}", zero: home, redundant: true}}
sensors: {{camera: {{at: load, reads: [x, y], sigma: 0.1, frame: machine}}}}
tool_point: load
"""
SPATIAL = """
units: {{length: mm, angle: deg, force: N}}
space: spatial
gravity: [0, 0, -9.81]
ranges: {{length: 2}}
parameters: {{x1: -2000, z7: 0}}
ground:
{ground}
bodies:
  platform:
    at: [0, 0, 1200]
    mass: {mass}
    points: {points}
ropes:
  "r{{i}}": {{each: {{i: [1, 2, 3, 4, 5, 6, 7, 8]}}, between: ["A{{i}}", "B{{i}}"], EA: {ea} N, t_min: {least}}}
actuators:
  "q{{i}}": {{each: {{i: [1, 2, 3, 4, 5, 6]}}, winds: "r{{i}}", zero: home}}
  "q{{j}}": {{each: {{j: [7, 8]}}, winds: "r{{j}}", zero: home, redundant: true}}
sensors:
  tracker: {{at: platform, reads: [x, y, z, rx, ry, rz], sigma: {{position: 0.1, orientation: 0.01}}, frame: machine}}
tool_point: platform
workspace: {{box: {{x: [-500, 500], y: [-400, 400], z: [800, 1600]}}}}
"""
SUSPENDED = """
units: {{length: mm, angle: deg, force: N}}
space: spatial
gravity: [0, 0, -9.81]
ranges: {{length: 2}}
parameters: {{x1: -2000}}
ground: {{A1: [x1, -1500, 2500], A2: [2000, -1500, 2500], A3: [2000, 1500, 2500], A4: [-2000, 1500, 2500]}}
nodes: {{load: {{at: [0, 0, 1000], mass: 10}}}}
ropes: {{"r{{i}}": {{each: {{i: [1, 2, 3, 4]}}, between: ["A{{i}}", load], EA: 50 kN, t_min: {least}}}}}
actuators:
  "q{{i}}": {{each: {{i: [1, 2, 3]}}, winds: "r{{i}}", zero: home}}
  q4: {{winds: r4, zero: home, redundant: true}}
sensors: {{camera: {{at: load, reads: [x, y, z], sigma: 0.1, frame: machine}}}}
tool_point: load
"""


@dataclass(frozen=True)
class Ropes:
    """Anchors (R, d) on the ground, points (R, d) of the platform, which is drawn at `home` (d,); m, N."""

    anchors: Array
    points: Array
    home: Array
    weight: float
    ea: float

    def tensions(self, readings: Array, place: Array, turned: Array | None = None) -> Array:
        """Tensions (R,) at readings (R,), m, where the platform is at a place (d,) and turned by a vector (3,)."""
        drawn = np.linalg.norm(self.anchors - self.home - self.points, axis=1)
        long = np.linalg.norm(self.anchors - place - self._turned(turned), axis=1)
        return np.asarray(self.ea * (long / (drawn + readings) - 1.0))

    def wrench(self, tensions: Array, place: Array, turned: Array | None = None) -> Array:
        """Force, and moment in space, (k,) that the ropes and the weight leave, N and N m."""
        balance, load = self._balance(place, turned)
        return np.asarray(balance @ tensions - load)

    def least(self, least: float, place: Array, turned: Array | None = None) -> Array:
        """Tensions (R,) of least sum of squares that balance the weight, none below a least one."""
        balance, load = self._balance(place, turned)
        many = np.full(len(self.anchors), least)
        matrix = np.vstack([_STIFF * balance, np.eye(len(many))])
        return np.asarray(nnls(matrix, np.concatenate([_STIFF * (load - balance @ many), -many]))[0] + many)

    def _balance(self, place: Array, turned: Array | None) -> tuple[Array, Array]:
        points = self._turned(turned)
        along = self.anchors - place - points
        along /= np.linalg.norm(along, axis=1)[:, None]
        if len(self.home) == 2:
            return along.T, np.array([0.0, self.weight])
        return np.vstack([along.T, np.cross(points, along).T]), np.array([0.0, 0.0, self.weight, 0.0, 0.0, 0.0])

    def _turned(self, turned: Array | None) -> Array:
        return self.points if turned is None else Rotation.from_rotvec(turned).apply(self.points)


def planar(ea: float, least: float) -> tuple[Ropes, str]:
    """A point on four ropes in a level plane, without weight; and its machine file."""
    anchors = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.5], [0.0, 1.5]])
    return Ropes(anchors, np.zeros((4, 2)), np.array([1.0, 0.75]), 0.0, ea), PLANAR.format(ea=ea, least=least)


def spatial(ea: float, least: float, mass: float = 12.0, *, crossed: bool = False) -> tuple[Ropes, str]:
    """A platform on eight ropes; `crossed`: six of them alone do not hold it everywhere."""
    corners = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
    anchors = np.array([[2.0 * x, 1.5 * y, z] for z in (2.5, 0.0) for x, y in corners])
    upper = [[0.15 * x, -0.1 * y, -0.12] for x, y in corners]
    lower = [[0.15 * x, -0.1 * y, 0.12] if crossed else [0.1 * x, 0.15 * y, 0.12] for x, y in corners]
    points = np.array([*upper, *lower])
    named = [[f"{1e3 * c:g}" for c in a] for a in anchors]
    named[0][0], named[6][2] = "x1", "z7"
    ground = "\n".join(f"  A{i}: [{', '.join(a)}]" for i, a in enumerate(named, 1))
    held = ", ".join(f"B{i}: [{', '.join(f'{1e3 * c:g}' for c in b)}]" for i, b in enumerate(points, 1))
    text = SPATIAL.format(ground=ground, points="{" + held + "}", mass=mass, ea=ea, least=least)
    return Ropes(anchors, points, np.array([0.0, 0.0, 1.2]), 9.81 * mass, ea), text


def suspended(least: float) -> tuple[Ropes, str]:
    """A point of 10 kg that hangs on four ropes; and its machine file."""
    anchors = np.array([[2.0 * x, 1.5 * y, 2.5] for x, y in [(-1, -1), (1, -1), (1, 1), (-1, 1)]])
    true = Ropes(anchors, np.zeros((4, 3)), np.array([0.0, 0.0, 1.0]), 98.1, 50e3)
    return true, SUSPENDED.format(least=least)
