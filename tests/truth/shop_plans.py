"""The four machines of the campaigns as plain arrays: names, workspaces, geometry. SI units."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from . import dimensions as dim
from .fast_pinned import Array
from .generate import SCISSORS_NINE

Parameters = Mapping[str, float]
PLANAR_POINT, PLANAR, SPATIAL = (0, 1), (0, 1, 5), (0, 1, 2, 3, 4, 5)


@dataclass(frozen=True)
class Geometry:
    """A machine's dimensions: for each of A drives the axes `frame` (A, 3, 3, as columns) and the foot (A, 3) of its
    guide's frame; for each of R rods the joint `offset` (R, 3) from its carriage's origin in the frame's axes, the
    `body` point (R, 3) on the platform, `length` (R,) in m and `stiffness` (R,) in N/m."""

    frame: Array
    foot: Array
    offset: Array
    body: Array
    length: Array
    stiffness: Array


@dataclass(frozen=True, kw_only=True)
class Plan:
    """A machine: names as in its machine file, and its workspace, a box `lower` to `upper` (k,) in m.

    `guide`, `frame`, `carriage`: of each drive. `along`: axis (0, 1, 2) of the frames in which the guides run.
    `carrier`: the drive of each rod. `side`: of each rod, +1 where the joint on the carriage is farther along the
    guide than the platform. `angles`: half-widths (rad) of the parameters that are angles.
    """

    name: str
    drives: tuple[str, ...]
    guide: tuple[str, ...]
    frame: tuple[str, ...]
    carriage: tuple[str, ...]
    along: int
    rods: tuple[str, ...]
    carrier: tuple[int, ...]
    side: tuple[int, ...]
    sensor: str
    channels: tuple[str, ...]
    sigma: float
    freedoms: tuple[int, ...]
    redundant: bool
    mass: float
    lower: tuple[float, ...]
    upper: tuple[float, ...]
    nominal: Parameters
    identified: tuple[str, ...]
    angles: Parameters
    geometry: Callable[[Parameters], Geometry]

    @property
    def planar(self) -> bool:
        """Whether it moves in the plane only."""
        return self.freedoms != SPATIAL


def turns(angles: Array) -> Array:
    """Rotation matrices (A, 3, 3) about z."""
    c, s, zero = np.cos(angles), np.sin(angles), np.zeros(len(angles))
    rows = [[c, -s, zero], [s, c, zero], [zero, zero, zero + 1]]
    return np.stack([np.stack(row, -1) for row in rows], -2)


def points(x: list[float], y: list[float]) -> Array:
    """Points (n, 3) in the plane z = 0."""
    return np.stack([np.array(x), np.array(y), np.zeros(len(x))], -1)


def triglide_plan(legs: int) -> Plan:
    """Three (or two) carriages on one guide along x, the platform is a point."""
    names = range(1, legs + 1)

    def geometry(p: Parameters) -> Geometry:
        return Geometry(
            frame=turns(np.full(legs, p["gamma"])),
            foot=np.zeros((legs, 3)),
            offset=points([p[f"xb{i}r"] for i in names], [p[f"yb{i}r"] for i in names]),
            body=np.zeros((legs, 3)),
            length=np.array([p[f"l{i}"] for i in names]),
            stiffness=np.array([p[f"k{i}"] for i in names]),
        )

    nominal = {n: v for n, v in dim.TRIGLIDE.items() if legs == 3 or "3" not in n}
    return Plan(
        name="triglide" if legs == 3 else "triglide-nonredundant",
        drives=tuple(f"q{i}" for i in names),
        guide=("rail",) * legs,
        frame=("base",) * legs,
        carriage=tuple(f"c{i}" for i in names),
        along=0,
        rods=tuple(f"rod{i}" for i in names),
        carrier=tuple(range(legs)),
        side=(-1, 1, 1)[:legs],
        sensor="tracker",
        channels=("x", "y"),
        sigma=10e-6,
        freedoms=PLANAR_POINT,
        redundant=legs == 3,
        mass=0.0,
        lower=(0.0, 0.16),
        upper=(0.95, 0.39),
        nominal=nominal,
        identified=tuple(n for n in nominal if n[0] in "lxy"),
        angles={"gamma": np.radians(1)},
        geometry=geometry,
    )


def scissors_plan() -> Plan:
    """Two guides along y with two carriages each, five rods, platform with x, y and turn."""
    rods, carrier = range(1, 6), (0, 1, 2, 3, 0)
    platform = np.array([[-1, 1], [-1, -1], [1, -1], [1, 1], [-1, 1]])
    joint = np.array([[1, 1], [1, -1], [-1, -1], [-1, 1], [1, -1]])

    def geometry(p: Parameters) -> Geometry:
        left, right = (-p["d1"], 0.0, 0.0), (p["d2"], 0.0, 0.0)
        a = points([p[f"xa{i}"] for i in rods], [p[f"ya{i}"] for i in rods])
        b = points([p[f"xb{i}"] for i in rods], [p[f"yb{i}"] for i in rods])
        return Geometry(
            frame=turns(np.array([p["g1"], p["g1"], p["g2"], p["g2"]])),
            foot=np.array([left, left, right, right]),
            offset=b * np.pad(joint, ((0, 0), (0, 1))),
            body=a * np.pad(platform, ((0, 0), (0, 1))),
            length=np.array([p[f"l{i}"] for i in rods]),
            stiffness=np.array([p[f"k{i}"] for i in rods]),
        )

    return Plan(
        name="scissors",
        drives=("q1", "q2", "q3", "q4"),
        guide=("left", "left", "right", "right"),
        frame=("left", "left", "right", "right"),
        carriage=("c1", "c2", "c3", "c4"),
        along=1,
        rods=tuple(f"rod{i}" for i in rods),
        carrier=carrier,
        side=(1, -1, -1, 1, 1),
        sensor="grid",
        channels=("x", "y"),
        sigma=0.5e-6,
        freedoms=PLANAR,
        redundant=True,
        mass=0.0,
        lower=(-0.203, -0.2),
        upper=(0.203, 0.2),
        nominal=dim.SCISSORS,
        identified=SCISSORS_NINE,
        angles=dim.ANGLES["scissors"],
        geometry=geometry,
    )


def delta4_plan() -> Plan:
    """Four upright columns about z, an arm of two rods on each, platform free in space, weight along -z."""
    columns = range(1, 5)
    bars = [(i, bar, side) for i in columns for bar, side in (("a", 1.0), ("b", -1.0))]
    quarter = np.radians([0.0, 90.0, 180.0, 270.0])
    half = dim.DELTA4_HALF_PAIR
    carrier = tuple(i - 1 for i, _, _ in bars)

    def geometry(p: Parameters) -> Geometry:
        on_platform = points([p[f"r{i}"] for i, _, _ in bars], [side * half for _, _, side in bars])
        return Geometry(
            frame=turns(quarter + [p[f"g{i}"] for i in columns]),
            foot=np.zeros((4, 3)),
            offset=points([p[f"R{i}"] for i, _, _ in bars], [side * half for _, _, side in bars]),
            body=np.einsum("rij,rj->ri", turns(quarter)[list(carrier)], on_platform),
            length=np.array([p[f"l{i}{bar}"] for i, bar, _ in bars]),
            stiffness=np.full(8, p["k"]),
        )

    return Plan(
        name="delta4",
        drives=("q1", "q2", "q3", "q4"),
        guide=tuple(f"rail{i}" for i in columns),
        frame=tuple(f"column{i}" for i in columns),
        carriage=tuple(f"c{i}" for i in columns),
        along=2,
        rods=tuple(f"arm{i}{bar}" for i, bar, _ in bars),
        carrier=carrier,
        side=(1,) * 8,
        sensor="tracker",
        channels=("x", "y", "z"),
        sigma=10e-6,
        freedoms=SPATIAL,
        redundant=True,
        mass=dim.DELTA4_MASS,
        lower=(-0.12, -0.12, 0.2),
        upper=(0.12, 0.12, 0.4),
        nominal=dim.DELTA4,
        identified=tuple(n for n in dim.DELTA4 if n != "k"),
        angles=dim.ANGLES["delta4"],
        geometry=geometry,
    )


PLANS = {plan.name: plan for plan in (triglide_plan(3), triglide_plan(2), scissors_plan(), delta4_plan())}
MACHINES = tuple(PLANS)


def true_parameters(plan: Plan, seed: int, size: float = 1.0) -> dict[str, float]:
    """Parameters in SI: nominal, the identified ones with a normal error of sd `size` * range / 2."""
    rng = np.random.default_rng([seed, 1])
    values = dict(plan.nominal)
    for name in plan.identified:
        width = plan.angles.get(name, 0.1 * dim.MM)
        values[name] += size * rng.normal() * width / 2
    return values


def set_values(plan: Plan, poses: Array) -> Array:
    """Drive positions (N, A) in m that lead the nominal machine, free of strain and weight and not turned, to the
    poses (N, 3) in m, to the nanometre."""
    g = plan.geometry(plan.nominal)
    carrier, along = list(plan.carrier), g.frame[:, :, plan.along]
    start = g.foot[carrier] + np.einsum("rij,rj->ri", g.frame[carrier], g.offset)
    way = poses[:, None] + g.body - start
    height = (way * along[carrier]).sum(-1)
    level = (way**2).sum(-1) - height**2
    travel = height + np.array(plan.side) * np.sqrt(g.length**2 - level)
    rods_of = [[r for r in range(len(carrier)) if carrier[r] == a] for a in range(len(plan.drives))]
    return np.round(np.stack([travel[:, rods].mean(1) for rods in rods_of], -1), 9)
