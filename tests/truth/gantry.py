"""A router's gantry: two rails, a cross beam that bends, a carriage on it that carries the spindle. SI units.

The left carriage stands on a rigid rail, the right one on springs; both are driven along their rails by springs (rack
and pinion). The beam, a steel tube, is welded to both. On it runs the carriage, at the beam's natural length that its
drive sets, and turns with the beam's section there. Its weight bends and twists the beam with x; drives that are out of
step skew it. The right rail may be bowed: its carriage is moved across and turned by its slope.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from .dimensions import ANGLES, MM
from .frame import Array, Frame, Section, rotation

WIDTH, HEIGHT, STROKE = 1.5, 0.3, 1.8
"""Distance of the rails, height of the beam above them, travel along them, m."""
NOSE, CENTRE, SIDE_CENTRE = (0.0, -0.12, -0.25), (0.0, -0.08, -0.06), (0.0, 0.0, 0.12)
"""Tool and centre of mass of the carriage; centre of mass of a side plate."""
CARRIAGE, SIDE, GRAVITY = 20.0, 10.0, 9.81
E, G, DENSITY = 210e9, 210e9 / 2.6, 7850.0
OUTER, WALL = 0.1, 0.005
DRIVE = 50e6
GUIDE = {"x": 40e6, "z": 200e6, "rx": 50e3, "ry": 20e3, "rz": 5e3}
"""Springs of the right carriage on its rail, N/m and N m/rad."""
BOWED = 90e-6
"""Of the right rail of the bowed machine, outward (x); the springs pass on a part."""
SCALES = ("sx", "sy1", "sy2")

NOMINAL = {
    **dict.fromkeys(("x0", "y1", "y2", "zl", "zr"), 0.0),
    **dict.fromkeys(SCALES, 1.0),
    **dict.fromkeys(ANGLES["gantry"], 0.0),
}
RANGES = {
    **dict.fromkeys(("x0", "y1", "y2", "zl", "zr"), 0.2 * MM),
    **dict.fromkeys(SCALES, 2e-4),
    **ANGLES["gantry"],
}


def tube(outer: float, wall: float) -> dict[str, float]:
    """Area, second moment and torsion constant (Bredt) of a square tube."""
    inner, mean = outer - 2 * wall, outer - wall
    return {"A": outer**2 - inner**2, "I": (outer**4 - inner**4) / 12, "J": mean**3 * wall}


@dataclass(frozen=True)
class Bow:
    """A rail that is an arc: its middle off the line through its ends, across (x) and up (z), m.

    Its mean line is where the straight rail is.
    """

    x: float = 0.0
    z: float = 0.0

    def at(self, travel: float) -> tuple[Array, Array]:
        """Displacement (3,) and rotation vector (3,) of a carriage that follows the rail along y."""
        u = 2 * travel / STROKE - 1
        shape, slope = 1 / 3 - u**2, -4 * u / STROKE
        return np.array([self.x * shape, 0.0, self.z * shape]), np.array([self.z * slope, 0.0, -self.x * slope])


@dataclass(frozen=True)
class Placed:
    """Places of the tool, `tcp` (N, 3), m."""

    tcp: Array


@dataclass(frozen=True, kw_only=True)
class Gantry:
    """The machine; `bow` of the right rail, `gravity` in m/s^2.

    pieces: elements on each side of the carriage in two meshes, extrapolated as the error falls with their square.
    """

    bow: Bow = Bow()
    gravity: float = GRAVITY
    pieces: tuple[int, int] = (8, 16)
    name: str = "gantry"
    drives: tuple[str, ...] = ("Y1", "Y2", "X")
    channels: tuple[str, ...] = ("x", "y", "z")
    nominal: Mapping[str, float] = field(default_factory=lambda: dict(NOMINAL))
    ranges: Mapping[str, float] = field(default_factory=lambda: dict(RANGES))

    @property
    def section(self) -> Section:
        """The beam's."""
        of = tube(OUTER, WALL)
        weight = np.array([0.0, 0.0, -DENSITY * of["A"] * self.gravity])
        return Section(ea=E * of["A"], eiy=E * of["I"], eiz=E * of["I"], gj=G * of["J"], weight=weight)

    def inverse(self, tcp: ArrayLike) -> Array:
        """Readings (N, 3) of the nominal machine without strain for places (N, 2) of the tool, x and y in m."""
        x, y = np.atleast_2d(np.asarray(tcp, dtype=float)).T
        return np.column_stack([y - NOSE[1], y - NOSE[1], x - NOSE[0]])

    def forward(self, q: ArrayLike, parameters: Mapping[str, float] | None = None) -> Placed:
        """Places of the tool at readings (N, 3)."""
        p = {**self.nominal, **(parameters or {})}
        rows = np.atleast_2d(np.asarray(q, dtype=float))
        coarse, fine = (np.array([self.tool(row, p, n) for row in rows]) for n in self.pieces)
        return Placed(fine + (fine - coarse) / ((self.pieces[1] / self.pieces[0]) ** 2 - 1))

    def tool(self, q: Array, p: Mapping[str, float], pieces: int) -> Array:
        """Place (3,) of the tool with a number of elements on each side of the carriage."""
        frame, carriage = self.frame(q, p, pieces)
        frame.solve()
        return frame.at(carriage, np.array(NOSE))

    def frame(self, q: Array, p: Mapping[str, float], pieces: int) -> tuple[Frame, int]:
        """The machine where nothing moved yet, and the number of its carriage."""
        frame, nothing = Frame(), np.zeros((6, 0))
        travels = [p["y1"] + p["sy1"] * q[0], p["y2"] + p["sy2"] * q[1]]
        turns = [rotation(np.array([p["al"], p["bl"], p["cl"]])), rotation(np.array([p["ar"], 0.0, p["cl"] + p["cr"]]))]
        origins = [np.array([0.0, 0.0, p["zl"]]), np.array([WIDTH, 0.0, p["zr"]])]
        along = np.array([0.0, 1.0, 0.0])
        left, right = (o + r @ (t * along) for o, r, t in zip(origins, turns, travels, strict=True))
        frame.body(left, turns[0], nothing)
        frame.body(left, turns[0], np.r_[turns[0] @ along, 0, 0, 0])
        frame.spring(0, 1, [0, DRIVE, 0, 0, 0, 0])
        across, slope = self.bow.at(travels[1])
        frame.body(right + turns[1] @ across, turns[1] @ rotation(slope), nothing)
        frame.body(right, turns[1])
        frame.spring(2, 3, [GUIDE["x"], DRIVE, GUIDE["z"], GUIDE["rx"], GUIDE["ry"], GUIDE["rz"]])
        x = p["x0"] + p["sx"] * q[2]
        top = np.array([0.0, 0.0, HEIGHT])
        carriage = frame.body(left + top + [x, 0.0, 0.0])
        frame.beam(1, carriage, (top, np.zeros(3)), x, self.section, pieces)
        frame.beam(carriage, 3, (np.zeros(3), top), WIDTH - x, self.section, pieces)
        for body, mass, centre in ((1, SIDE, SIDE_CENTRE), (3, SIDE, SIDE_CENTRE), (carriage, CARRIAGE, CENTRE)):
            frame.forces.append((body, np.array(centre), np.array([0.0, 0.0, -mass * self.gravity])))
        return frame, carriage
