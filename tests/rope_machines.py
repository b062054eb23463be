"""Machines with ropes over several points and over pulleys, and how long their ropes are at a pose."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.rotation import Array, exp
from tests.rope_lengths import Circle, planar_length, swivel_length

Lengths = Callable[[Array], Array]
"""Lengths (ropes) as the drives set them, at the coordinates of a pose."""

# --- a planar platform: anchors with pulleys, two ropes that end on drums -------------------------------------------
PLATFORM = """
    units: {length: mm, angle: deg, force: N}
    space: planar
    ranges: {length: 1, force: 1000}
    parameters: {EA: 20 kN, r1: 25, r3: 35, x1: -900, y3: -500, b: 60}
    gravity: [0, -9.80665]
    ground: {W1: [-700, -600], A1: [x1, 500], W2: [900, -700], A2: [800, 600], D3: [-800, y3], D4: [900, -500]}
    bodies: {p: {at: [20, 30], turn: 5, mass: 2, points: {B1: [-b, 40], B2: [b, 40], B3: [-60, -40], B4: [60, -40]}}}
    ropes:
      l1: {between: [W1, A1, B1], EA: EA, pulleys: {A1: {radius: r1, side: right}}}
      l2: {between: [W2, A2, B2], EA: EA, pulleys: {A2: {radius: 30, side: left}}}
      l3: {between: [B3, D3], EA: EA, pulleys: {D3: {radius: r3, side: left}}}
      l4: {between: [D4, B4], EA: EA, pulleys: {D4: {radius: 20, side: left}}}
    actuators: {q1: {winds: l1}, q2: {winds: l2}, q3: {winds: l3}, q4: {winds: l4, redundant: true}}
    sensors: {t: {at: p, reads: [x, y, rz], sigma: {position: 10 um, orientation: 10 urad}, frame: machine}}
"""
PLATFORM_HOME = np.array([0.02, 0.03, np.deg2rad(5)])


def point(x: float, y: float) -> Circle:
    return np.array([x, y]), 0.0, "left"


def circle(x: float, y: float, radius: float, side: str) -> Circle:
    return np.array([x, y]), radius, side


def platform_circles(pose: Array) -> list[list[Circle]]:
    c, s = np.cos(pose[2]), np.sin(pose[2])
    on = [
        pose[:2] + np.array([[c, -s], [s, c]]) @ b
        for b in 1e-3 * np.array([[-60, 40], [60, 40], [-60, -40], [60, -40]])
    ]
    b1, b2, b3, b4 = ((place, 0.0, "left") for place in on)
    return [
        [point(-0.7, -0.6), circle(-0.9, 0.5, 0.025, "right"), b1],
        [point(0.9, -0.7), circle(0.8, 0.6, 0.03, "left"), b2],
        [b3, circle(-0.8, -0.5, 0.035, "left")],
        [circle(0.9, -0.5, 0.02, "left"), b4],
    ]


def platform_lengths(pose: Array) -> Array:
    every = zip(platform_circles(pose), platform_circles(PLATFORM_HOME), strict=True)
    return np.array([planar_length(*pair) for pair in every])


# --- a point on three cables over four anchors, without and with pulleys --------------------------------------------
ANCHORS = {"A1": (0.0, 0.9), "A2": (1.2, 0.9), "A3": (0.0, 0.0), "A4": (1.2, 0.0)}
CABLES = """
    units: {length: mm, angle: deg, force: N}
    space: planar
    gravity: [0, -9.80665]
    ranges: {length: 3, force: 500}
    parameters:
      {x2: 1200, x3: 0, y4: 0, EA: 20 kN, R1: {nominal: 25, range: 0.02}, R2: {nominal: 35, range: 0.02}}
    ground: {A1: [0, 900], A2: [x2, 900], A3: [x3, 0], A4: [1200, y4]}
    nodes: {P: {at: [500, 450], mass: 4}}
    ropes:
      cable1: {between: [A1, P, A2], EA: EA}
      cable2: {between: [A1, P, A3, P], EA: EA}
      cable3: {between: [A2, P, A4, P], EA: EA}
    actuators:
      q1: {winds: cable1, radius: R1}
      q2: {winds: cable2, radius: R2}
      q3: {winds: cable3, radius: R2, redundant: true}
    sensors: {camera: {at: P, reads: [x, y], sigma: 0.05, frame: machine}}
"""
WEIGHTED = (
    CABLES[: CABLES.index("    ropes:")]
    + """
    ropes:
      m: {between: [A1, P]}
      k: {between: [A3, P], EA: EA}
      n: {between: [P, A2], EA: EA}
      h: {between: [P, A4]}
      across: {between: [A1, P, A2], EA: EA}
    actuators:
      q1: {winds: across, radius: R1}
      q2: {winds: {m: 1, k: 2}, radius: R2}
      q3: {winds: {n: 1, h: 2}, radius: R2, redundant: true}
    sensors: {camera: {at: P, reads: [x, y], sigma: 0.05, frame: machine}}
"""
)
ROLLED = """
    units: {length: mm, angle: deg, force: N}
    space: planar
    gravity: [0, -9.80665]
    ranges: {length: 1, force: 500}
    parameters: {x2: 1200, rP: 15, r3: 25, EA: 20 kN}
    ground: {W: [-50, 0], A1: [0, 900], A2: [x2, 900], A3: [0, 0], A4: [1200, 0]}
    nodes: {P: {at: [500, 450], mass: 4}}
    ropes:
      cable1: {between: [A1, P, A2], EA: EA, pulleys: {P: {radius: rP, side: left}, A2: {radius: 12, side: right}}}
      cable2:
        {between: [W, A1, P, A3, P], EA: EA, pulleys: {A1: {radius: 20, side: right}, A3: {radius: r3, side: left}}}
      cable3: {between: [A2, P, A4, P], EA: EA, pulleys: {A4: {radius: 18, side: left}}}
    actuators:
      q1: {winds: cable1}
      q2: {winds: cable2}
      q3: {winds: cable3, redundant: true}
    sensors: {camera: {at: P, reads: [x, y], sigma: 0.05, frame: machine}}
"""


def cable_lengths(place: Array) -> Array:
    m, n, k, h = (float(np.hypot(*(place - np.array(ANCHORS[name])))) for name in ("A1", "A2", "A3", "A4"))
    return np.array([m + n, m + 2 * k, n + 2 * h])


def rolled_circles(place: Array) -> list[list[Circle]]:
    bare = (place, 0.0, "left")
    return [
        [point(0, 0.9), (place, 0.015, "left"), circle(1.2, 0.9, 0.012, "right")],
        [point(-0.05, 0), circle(0, 0.9, 0.02, "right"), bare, circle(0, 0, 0.025, "left"), bare],
        [point(1.2, 0.9), bare, circle(1.2, 0, 0.018, "left"), bare],
    ]


def rolled_lengths(place: Array) -> Array:
    every = zip(rolled_circles(place), rolled_circles(np.array([0.5, 0.45])), strict=True)
    return np.array([planar_length(*pair) for pair in every])


# --- eight ropes over swivelling pulleys, a platform in space -------------------------------------------------------
CORNERS = np.array([[x, y, z] for z in (2.0, 0.0) for x, y in ((-1.5, -1), (1.5, -1), (1.5, 1), (-1.5, 1))])
ON_BODY = np.array([[x, y, z] for z in (-0.15, 0.15) for x, y in ((-0.2, -0.1), (0.2, -0.1), (0.2, 0.1), (-0.2, 0.1))])
RADIUS = 0.025


def spatial(stiffness: bool = True, redundant: str = "redundant: true") -> str:
    """Ropes come up to the upper pulleys and down to the lower ones, every other one written from the platform."""
    numbers = {"EA": "50 kN"} if stiffness else {}
    numbers |= {"r": "25", "x1": "-1500", "b": "200"}
    lines = ["units: {length: mm, angle: deg, force: N}", "space: spatial", "gravity: [0, 0, -9.80665]"]
    lines += [
        "ranges: {length: 1, force: 1000}",
        f"parameters: {{{', '.join(f'{n}: {v}' for n, v in numbers.items())}}}",
    ]
    lines += ["ground:"]
    for k, (x, y, z) in enumerate(1e3 * CORNERS, start=1):
        first = "x1" if k == 1 else f"{x:.0f}"
        lines += [f"  A{k}: [{first}, {y:.0f}, {z:.0f}]", f"  W{k}: [{x:.0f}, {y:.0f}, 1000]"]
    named = []
    for k, (x, y, z) in enumerate(1e3 * ON_BODY, start=1):
        named += [f"P{k}: [{'b' if k == 2 else f'{x:.0f}'}, {y:.0f}, {z:.0f}]"]
    lines += [f"bodies: {{p: {{at: [50, -30, 1000], mass: 5, points: {{{', '.join(named)}}}}}}}", "ropes:"]
    for k in range(1, 9):
        way = [f"W{k}", f"A{k}", f"P{k}"] if k % 2 else [f"P{k}", f"A{k}", f"W{k}"]
        own = "EA: EA, " if stiffness else ""
        pulley = f"{{radius: r, axis: {'z' if k < 5 else '-z'}}}"
        lines += [f"  l{k}: {{between: [{', '.join(way)}], {own}pulleys: {{A{k}: {pulley}}}}}"]
    lines += ["actuators:"]
    lines += [f"  q{k}: {{winds: l{k}{', ' + redundant if k > 6 else ''}}}" for k in range(1, 9)]
    lines += ["sensors: {t: {at: p, reads: [x, y, z, rx, ry, rz], frame: machine,"]
    lines += ["  sigma: {position: 10 um, orientation: 10 urad}}}"]
    return "\n".join(lines) + "\n"


def spatial_lengths(pose: Array) -> Array:
    ends = pose[:3] + ON_BODY @ exp(pose[3:]).T
    axes = np.array([[0, 0, 1.0]] * 4 + [[0, 0, -1.0]] * 4)
    every = zip(CORNERS, axes, ends, strict=True)
    return np.array([1.0 + swivel_length(corner, axis, RADIUS, end) for corner, axis, end in every])


# --- all of them ----------------------------------------------------------------------------------------------------
@dataclass(frozen=True, kw_only=True)
class RopeMachine:
    """A machine, what its drives read (SI) at a pose with its ropes unstressed, and poses about it.

    columns: the TCP's coordinates, of x ... rz, that a pose has; drawn: the pose of the file; centre, way: a box.
    """

    text: str
    readings: Lengths
    columns: list[int]
    drawn: Array
    centre: Array
    way: Array
    mass: float

    def poses(self, count: int, seed: int, share: float = 1.0) -> Array:
        """Poses (count, f) in a share of the box."""
        rng = np.random.default_rng(seed)
        return np.asarray(self.centre + share * rng.uniform(-1, 1, (count, len(self.centre))) * self.way)

    def aimed(self, poses: Array) -> Array:
        """The same as rows (n, 6); rotations count from the file's configuration."""
        turned = np.where(np.array(self.columns) > 2, self.drawn, 0.0)
        out = np.full((len(poses), 6), np.nan)
        out[:, self.columns] = poses - turned
        return out


def _point_machine(text: str, readings: Lengths) -> RopeMachine:
    return RopeMachine(
        text=text, readings=readings, columns=[0, 1], drawn=np.array([0.5, 0.45]), centre=np.array([0.6, 0.45]),
        way=np.array([0.4, 0.3]), mass=4,
    )  # fmt: skip


MACHINES = {
    "platform": RopeMachine(
        text=PLATFORM, readings=platform_lengths, columns=[0, 1, 5], drawn=PLATFORM_HOME, centre=PLATFORM_HOME,
        way=np.array([0.25, 0.25, 0.3]), mass=2,
    ),
    "cables": _point_machine(CABLES, lambda place: cable_lengths(place) / [0.025, 0.035, 0.035]),
    "weighted": _point_machine(WEIGHTED, lambda place: cable_lengths(place) / [0.025, 0.035, 0.035]),
    "rolled": _point_machine(ROLLED, rolled_lengths),
    "spatial": RopeMachine(
        text=spatial(), readings=spatial_lengths, columns=list(range(6)), drawn=np.array([0.05, -0.03, 1.0, 0, 0, 0]),
        centre=np.array([0, 0, 1.0, 0, 0, 0]), way=np.array([0.5, 0.4, 0.4, 0.4, 0.4, 0.4]), mass=5,
    ),
}  # fmt: skip
