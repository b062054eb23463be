"""The shipped machines of pinned rods as energies: constants, set values, poses. All SI (m, N, rad, N/m).

Every machine has `forward(q, parameters, ...)` and `inverse(tcp)`; parameter names are those of the machine
files. `NOMINAL` holds every number of the machines once, `RANGE` the half-widths of the planted errors.
Dimensions: Ecorchard, Neugebauer, Maurine (2010), Tables 1 and 2, for triglide and scissors.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from . import pinned
from .pinned import Array, DeadForce, Rods, State

Parameters = Mapping[str, float]
MM = 1e-3
KN_PER_MM = 1e6
GRAVITY = 9.81


@dataclass(frozen=True)
class Forward:
    """Poses of N rows: `tcp` (N, channels) in m and rad, `travel` (N, drives) in m, `energy` (N,) in J (elastic),
    `tension` (N, rods) in N, positive when pulled."""

    tcp: Array
    travel: Array
    energy: Array
    tension: Array


@dataclass(frozen=True)
class Machine:
    """A machine of pinned rods.

    `rods(p)`: its rods for parameters p. `guess(q, p)`: platform position (3,) near the solution, without turn.
    `inverse_row(tcp, p)`: drive positions without strain for one pose. `redundant`: drives outside the
    non-redundant substructure. `weight`: force (3,) in N on the platform's origin.
    """

    name: str
    drives: tuple[str, ...]
    redundant: tuple[str, ...]
    freedoms: tuple[int, ...]
    channels: tuple[str, ...]
    nominal: Parameters
    ranges: Parameters
    rods: Callable[[Parameters], Rods]
    guess: Callable[[Array, Parameters], Array]
    inverse_row: Callable[[Array, Parameters], Array]
    weight: tuple[float, float, float] = (0.0, 0.0, 0.0)
    loads: tuple[DeadForce, ...] = field(init=False)

    def __post_init__(self) -> None:
        loads = (DeadForce(np.array(self.weight), np.zeros(3)),) if any(self.weight) else ()
        object.__setattr__(self, "loads", loads)

    def completed(self, parameters: Parameters | None) -> dict[str, float]:
        """Nominal values, replaced by the given ones."""
        unknown = set(parameters or {}) - set(self.nominal)
        if unknown:
            raise KeyError(f"{self.name} has no parameter {sorted(unknown)}")
        return {**self.nominal, **(parameters or {})}

    def solve(
        self,
        q: ArrayLike,
        parameters: Parameters | None = None,
        force: Mapping[str, float] | None = None,
        stiffness: Mapping[str, float] | None = None,
        loads: Sequence[DeadForce] = (),
    ) -> pinned.Equilibrium:
        """Equilibrium of one row; `q` (drives,) in m. See `forward`."""
        values = self.completed(parameters)
        travel = np.asarray(q, float)
        start = State.at(self.guess(travel, values), travel)
        column = self.drives.index
        return pinned.minimise(
            self.rods(values),
            start,
            self.freedoms,
            (*self.loads, *loads),
            {column(name): value for name, value in (force or {}).items()},
            {column(name): value for name, value in (stiffness or {}).items()},
        )

    def forward(
        self,
        q: ArrayLike,
        parameters: Parameters | None = None,
        force: Mapping[str, float] | None = None,
        stiffness: Mapping[str, float] | None = None,
        loads: Sequence[DeadForce] = (),
    ) -> Forward:
        """Poses for set values `q` (N, drives) in m, in the order of `drives`.

        `force`: drives under force control, with their constant force in N, positive where it pushes towards
        greater travel; their columns of `q` are only the start, their travel is an output. `stiffness`: drives
        that yield about their set value, in N/m. `loads`: dead forces on points of the platform.
        """
        found = [self.solve(row, parameters, force, stiffness, loads) for row in np.atleast_2d(q)]
        poses = [
            np.concatenate([e.state.position, pinned.rotation_vector(e.state.rotation)])[list(self.freedoms)]
            for e in found
        ]
        return Forward(
            np.array(poses, float),
            np.array([e.state.travel for e in found], float),
            np.array([e.energy for e in found]),
            np.array([e.tension for e in found], float),
        )

    def inverse(self, tcp: ArrayLike, parameters: Parameters | None = None) -> Array:
        """Drive positions (N, drives) in m without strain and without weight, for TCP positions (N, 2 or 3) in m
        and no turn of the platform."""
        values = self.completed(parameters)
        return np.array([self.inverse_row(np.asarray(row, float), values) for row in np.atleast_2d(tcp)])


def turned(angle: float, points: ArrayLike) -> Array:
    """Points (..., 2) turned by an angle in rad."""
    c, s = np.cos(angle), np.sin(angle)
    return np.asarray(points, float) @ np.array([[c, s], [-s, c]])


def circles(a: Array, b: Array, ra: float, rb: float, side: float) -> Array:
    """Intersection (2,) of circles about a and b; `side` +1: to the left of the way from a to b."""
    base = np.hypot(*(b - a))
    along = (ra**2 - rb**2 + base**2) / (2 * base)
    across = side * np.sqrt(max(ra**2 - along**2, 0.0))
    x, y = (b - a) / base
    return a + along * np.array([x, y]) + across * np.array([-y, x])


def scaled(values: Mapping[str, float], unit: float) -> dict[str, float]:
    """Values times a unit."""
    return {name: value * unit for name, value in values.items()}


def ranges_of(nominal: Parameters, angles: Mapping[str, float]) -> dict[str, float]:
    """Half-widths: 0.1 mm, the given ones for angles, 10 % for stiffnesses (k...)."""
    return {n: angles.get(n, 0.1 * v if n.startswith("k") else 0.1 * MM) for n, v in nominal.items()}


# Triglide (planar point, three carriers on one guide, turned by gamma about the origin) ----------------------------

_TRIGLIDE = {
    **scaled({"l1": 300, "l2": 300, "l3": 600}, MM),
    **scaled({"xb1r": 0, "yb1r": 100, "xb2r": 0, "yb2r": 100, "xb3r": 0, "yb3r": 150, "gamma": 0}, MM),
    **scaled({"k1": 50, "k2": 50, "k3": 50}, KN_PER_MM),
}


def triglide(legs: int = 3) -> Machine:
    """Redundant Triglide (three legs), or its non-redundant part (two)."""
    names = range(1, legs + 1)
    nominal = {n: v for n, v in _TRIGLIDE.items() if legs == 3 or "3" not in n}

    def offsets(p: Parameters) -> Array:
        return np.array([[p[f"xb{i}r"], p[f"yb{i}r"]] for i in names])

    def rods(p: Parameters) -> Rods:
        return Rods.of(
            body=np.zeros((legs, 2)),
            base=turned(p["gamma"], offsets(p)),
            along=turned(p["gamma"], [[1, 0]] * legs),
            drive=range(legs),
            length=[p[f"l{i}"] for i in names],
            stiffness=[p[f"k{i}"] for i in names],
        )

    def guess(q: Array, p: Parameters) -> Array:
        first, second = (turned(p["gamma"], offsets(p)[i] + [q[i], 0]) for i in (0, 1))
        return circles(first, second, p["l1"], p["l2"], +1)

    def inverse(tcp: Array, p: Parameters) -> Array:
        x, y = turned(-p["gamma"], tcp[:2])
        side = [-1, 1, 1]
        return np.array(
            [
                x - bx + side[i] * np.sqrt(p[f"l{i + 1}"] ** 2 - (y - by) ** 2)
                for i, (bx, by) in enumerate(offsets(p))
            ]
        )

    return Machine(
        name="triglide" if legs == 3 else "triglide-nonredundant",
        drives=tuple(f"q{i}" for i in names),
        redundant=("q3",) if legs == 3 else (),
        freedoms=pinned.PLANAR_POINT,
        channels=("x", "y"),
        nominal=nominal,
        ranges=ranges_of(nominal, {"gamma": np.radians(0.02)}),
        rods=rods,
        guess=guess,
        inverse_row=inverse,
    )


# Biglide with a telescopic redundant leg ---------------------------------------------------------------------------

_BIGLIDE = {
    **scaled({"l1": 300, "l2": 300, "xb1r": 0, "yb1r": 100, "xb2r": 0, "yb2r": 100}, MM),
    **scaled({"x8": 360, "y8": 650, "l3": 300}, MM),
    **scaled({"k1": 50, "k2": 50, "k3": 20}, KN_PER_MM),
}


def biglide() -> Machine:
    """Two carriers on the guide y = 0; leg 3 of length l3 + q3 from (x8, y8) to the TCP."""

    def rods(p: Parameters) -> Rods:
        return Rods.of(
            body=np.zeros((3, 2)),
            base=[[p["xb1r"], p["yb1r"]], [p["xb2r"], p["yb2r"]], [p["x8"], p["y8"]]],
            along=[[1, 0], [1, 0], [0, 0]],
            feed=[0, 0, 1],
            drive=range(3),
            length=[p["l1"], p["l2"], p["l3"]],
            stiffness=[p["k1"], p["k2"], p["k3"]],
        )

    def guess(q: Array, p: Parameters) -> Array:
        first, second = (np.array([p[f"xb{i}r"] + q[i - 1], p[f"yb{i}r"]]) for i in (1, 2))
        return circles(first, second, p["l1"], p["l2"], +1)

    def inverse(tcp: Array, p: Parameters) -> Array:
        x, y = tcp[:2]
        return np.array(
            [
                x - p["xb1r"] - np.sqrt(p["l1"] ** 2 - (y - p["yb1r"]) ** 2),
                x - p["xb2r"] + np.sqrt(p["l2"] ** 2 - (y - p["yb2r"]) ** 2),
                np.hypot(x - p["x8"], y - p["y8"]) - p["l3"],
            ]
        )

    return Machine(
        name="biglide",
        drives=("q1", "q2", "q3"),
        redundant=("q3",),
        freedoms=pinned.PLANAR_POINT,
        channels=("x", "y"),
        nominal=_BIGLIDE,
        ranges=ranges_of(_BIGLIDE, {}),
        rods=rods,
        guess=guess,
        inverse_row=inverse,
    )


# Scissors Kinematics -----------------------------------------------------------------------------------------------

_RODS = range(1, 6)
_A_SIGNS = ((-1, 1), (-1, -1), (1, -1), (1, 1), (-1, 1))
_B_SIGNS = ((1, 1), (1, -1), (-1, -1), (-1, 1), (1, -1))
_CARRIER = (0, 1, 2, 3, 0)
_LEFT = (True, True, False, False, True)
_SCISSORS = {
    **{f"l{i}": 950 * MM for i in _RODS},
    **{f"xa{i}": 520 * MM for i in _RODS},
    **{f"ya{i}": (120 if i == 5 else 280) * MM for i in _RODS},
    **{f"xb{i}": 310 * MM for i in _RODS},
    **{f"yb{i}": 80 * MM for i in _RODS},
    "d1": 1460 * MM,
    "d2": 1460 * MM,
    "g1": 0.0,
    "g2": 0.0,
    **{f"k{i}": (250 if i == 5 else 500) * KN_PER_MM for i in _RODS},
}


def scissors() -> Machine:
    """Four carriers on two guides along y, five rods, platform with pose x, y, phi."""

    def platform(p: Parameters) -> Array:
        return np.array([[sx * p[f"xa{i}"], sy * p[f"ya{i}"]] for i, (sx, sy) in zip(_RODS, _A_SIGNS)])

    def guides(p: Parameters) -> tuple[Array, Array, Array]:
        """Feet (5, 2), angles (5,) and joint offsets in the carrier (5, 2) of each rod's guide."""
        feet = np.array([[-p["d1"] if left else p["d2"], 0.0] for left in _LEFT])
        angles = np.array([p["g1"] if left else p["g2"] for left in _LEFT])
        joints = np.array([[sx * p[f"xb{i}"], sy * p[f"yb{i}"]] for i, (sx, sy) in zip(_RODS, _B_SIGNS)])
        return feet, angles, joints

    def rods(p: Parameters) -> Rods:
        feet, angles, joints = guides(p)
        return Rods.of(
            body=platform(p),
            base=[f + turned(g, b) for f, g, b in zip(feet, angles, joints)],
            along=[turned(g, [0, 1]) for g in angles],
            drive=_CARRIER,
            length=[p[f"l{i}"] for i in _RODS],
            stiffness=[p[f"k{i}"] for i in _RODS],
        )

    def guess(q: Array, p: Parameters) -> Array:
        feet, angles, joints = guides(p)
        centres = [
            feet[r] + turned(angles[r], joints[r] + [0, q[_CARRIER[r]]]) - platform(p)[r] for r in (0, 3)
        ]
        return circles(centres[0], centres[1], p["l1"], p["l4"], -1)

    def inverse(tcp: Array, p: Parameters) -> Array:
        feet, angles, joints = guides(p)
        side = [1, -1, -1, 1]
        travel = []
        for r in range(4):
            x, y = turned(-angles[r], tcp[:2] + platform(p)[r] - feet[r]) - joints[r]
            travel.append(y + side[r] * np.sqrt(p[f"l{r + 1}"] ** 2 - x**2))
        return np.array(travel)

    return Machine(
        name="scissors",
        drives=("q1", "q2", "q3", "q4"),
        redundant=("q2", "q3"),
        freedoms=pinned.PLANAR,
        channels=("x", "y"),
        nominal=_SCISSORS,
        ranges=ranges_of(_SCISSORS, {"g1": 1e-4, "g2": 1e-4}),
        rods=rods,
        guess=guess,
        inverse_row=inverse,
    )


MACHINES: dict[str, Callable[[], Any]] = {
    "triglide": triglide,
    "triglide-nonredundant": lambda: triglide(2),
    "biglide": biglide,
    "scissors": scissors,
}
