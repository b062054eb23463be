"""The planar machines as energies: Triglide, Biglide, Scissors. All SI (m, N, rad, N/m)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from . import dimensions, pinned
from .pinned import Array, Rods
from .pinned_machine import Machine, Parameters


def turned(angle: float, points: ArrayLike) -> Array:
    """Points (..., 2) turned by an angle in rad."""
    c, s = np.cos(angle), np.sin(angle)
    moved: Array = np.asarray(points, float) @ np.array([[c, s], [-s, c]])
    return moved


def circles(a: Array, b: Array, ra: float, rb: float, side: float) -> Array:
    """Intersection (2,) of circles about a and b; `side` +1: to the left of the way from a to b."""
    base = np.hypot(*(b - a))
    along = (ra**2 - rb**2 + base**2) / (2 * base)
    across = side * np.sqrt(max(ra**2 - along**2, 0.0))
    x, y = (b - a) / base
    place: Array = a + along * np.array([x, y]) + across * np.array([-y, x])
    return place


# Triglide (planar point, three carriers on one guide, turned by gamma about the origin) ---------------------


def triglide(legs: int = 3) -> Machine:
    """Redundant Triglide (three legs), or its non-redundant part (two)."""
    names = range(1, legs + 1)
    nominal = {n: v for n, v in dimensions.TRIGLIDE.items() if legs == 3 or "3" not in n}

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
            [x - bx + side[i] * np.sqrt(p[f"l{i + 1}"] ** 2 - (y - by) ** 2) for i, (bx, by) in enumerate(offsets(p))]
        )

    return Machine(
        name="triglide" if legs == 3 else "triglide-nonredundant",
        drives=tuple(f"q{i}" for i in names),
        redundant=("q3",) if legs == 3 else (),
        freedoms=pinned.PLANAR_POINT,
        channels=("x", "y"),
        nominal=nominal,
        ranges=dimensions.half_widths(nominal, dimensions.ANGLES["triglide"]),
        rods=rods,
        guess=guess,
        inverse_row=inverse,
    )


# Biglide with a telescopic redundant leg --------------------------------------------------------------------


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
        nominal=dimensions.BIGLIDE,
        ranges=dimensions.half_widths(dimensions.BIGLIDE),
        rods=rods,
        guess=guess,
        inverse_row=inverse,
    )


# Scissors Kinematics ----------------------------------------------------------------------------------------

_RODS = range(1, 6)
_A_SIGNS = ((-1, 1), (-1, -1), (1, -1), (1, 1), (-1, 1))
_B_SIGNS = ((1, 1), (1, -1), (-1, -1), (-1, 1), (1, -1))
_CARRIER = (0, 1, 2, 3, 0)
_LEFT = (True, True, False, False, True)


def scissors() -> Machine:
    """Four carriers on two guides along y, five rods, platform with pose x, y, phi."""

    def platform(p: Parameters) -> Array:
        return np.array([[sx * p[f"xa{i}"], sy * p[f"ya{i}"]] for i, (sx, sy) in zip(_RODS, _A_SIGNS, strict=True)])

    def guides(p: Parameters) -> tuple[Array, Array, Array]:
        """Feet (5, 2), angles (5,) and joint offsets in the carrier (5, 2) of each rod's guide."""
        feet = np.array([[-p["d1"] if left else p["d2"], 0.0] for left in _LEFT])
        angles = np.array([p["g1"] if left else p["g2"] for left in _LEFT])
        joints = np.array([[sx * p[f"xb{i}"], sy * p[f"yb{i}"]] for i, (sx, sy) in zip(_RODS, _B_SIGNS, strict=True)])
        return feet, angles, joints

    def rods(p: Parameters) -> Rods:
        feet, angles, joints = guides(p)
        return Rods.of(
            body=platform(p),
            base=[f + turned(g, b) for f, g, b in zip(feet, angles, joints, strict=True)],
            along=[turned(g, [0, 1]) for g in angles],
            drive=_CARRIER,
            length=[p[f"l{i}"] for i in _RODS],
            stiffness=[p[f"k{i}"] for i in _RODS],
        )

    def guess(q: Array, p: Parameters) -> Array:
        feet, angles, joints = guides(p)
        centres = [feet[r] + turned(angles[r], joints[r] + [0, q[_CARRIER[r]]]) - platform(p)[r] for r in (0, 3)]
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
        nominal=dimensions.SCISSORS,
        ranges=dimensions.half_widths(dimensions.SCISSORS, dimensions.ANGLES["scissors"]),
        rods=rods,
        guess=guess,
        inverse_row=inverse,
    )
