"""The spatial machines of pinned rods and ropes as energies: linear delta with four columns, hangprinter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from . import dimensions as dim
from . import pinned
from .pinned import Array, DeadForce, Rods, State
from .pinned_machine import Forward, Machine, Parameters


def spheres(centres: Array, radii: Array, side: float) -> Array:
    """Intersection (3,) of spheres about three centres (3, 3); `side` +1: on the side of +z for centres that
    are counted counter-clockwise, -1: the other. Spheres that do not meet give the nearest point of their
    plane."""
    a, b, c = centres
    along = (b - a) / np.linalg.norm(b - a)
    across = c - a - along * (along @ (c - a))
    across /= np.linalg.norm(across)
    base, u, v = np.linalg.norm(b - a), along @ (c - a), across @ (c - a)
    x = (radii[0] ** 2 - radii[1] ** 2 + base**2) / (2 * base)
    y = (radii[0] ** 2 - radii[2] ** 2 + u**2 + v**2 - 2 * u * x) / (2 * v)
    height = np.sqrt(max(radii[0] ** 2 - x**2 - y**2, 0.0))
    place: Array = a + x * along + y * across + side * height * np.cross(along, across)
    return place


def delta4() -> Machine:
    """Linear delta: carriages travel along +z on four columns, arms are pairs of bars, platform below
    them."""
    bars = [(i, bar, side) for i in dim.DELTA4_COLUMNS for bar, side in (("a", 1), ("b", -1))]

    def column(i: int, p: Parameters) -> Array:
        """Radial and tangential unit vectors (2, 3) of a column that stands at an angle error g_i."""
        angle = dim.DELTA4_COLUMN_ANGLES[i] + p[f"g{i}"]
        c, s = np.cos(angle), np.sin(angle)
        return np.array([[c, s, 0], [-s, c, 0]])

    def rods(p: Parameters) -> Rods:
        platform = dict.fromkeys(p, 0.0)
        return Rods.of(
            body=[[p[f"r{i}"], s * dim.DELTA4_HALF_PAIR] @ column(i, platform) for i, _, s in bars],
            base=[[p[f"R{i}"], s * dim.DELTA4_HALF_PAIR] @ column(i, p) for i, _, s in bars],
            along=[[0, 0, 1]] * len(bars),
            drive=[i - 1 for i, _, _ in bars],
            length=[p[f"l{i}{bar}"] for i, bar, _ in bars],
            stiffness=[p["k"]] * len(bars),
        )

    def guess(q: Array, p: Parameters) -> Array:
        held = rods(p)
        middle = (held.base - held.body).astype(float).reshape(-1, 2, 3).mean(1)
        length = held.length.astype(float).reshape(-1, 2).mean(1)
        middle[:, 2] += q
        return spheres(middle[:3], length[:3], -1)

    def inverse(tcp: Array, p: Parameters) -> Array:
        held = rods(p)
        level = (tcp + held.body - held.base).astype(float)
        rise = np.sqrt(held.length.astype(float) ** 2 - level[:, 0] ** 2 - level[:, 1] ** 2)
        travel: Array = (level[:, 2] + rise).reshape(-1, 2).mean(1)
        return travel

    return Machine(
        name="delta4",
        drives=("q1", "q2", "q3", "q4"),
        redundant=("q4",),
        freedoms=pinned.SPATIAL,
        channels=("x", "y", "z"),
        nominal=dim.DELTA4,
        ranges=dim.half_widths(dim.DELTA4, dim.ANGLES["delta4"]) | {"k": 0.0},
        rods=rods,
        guess=guess,
        inverse_row=inverse,
        weight=(0.0, 0.0, -dim.DELTA4_MASS * dim.GRAVITY),
    )


@dataclass(frozen=True)
class Hangprinter:
    """A point held by four lines on spools, A, B, C, D; `q` is the motor angle in rad, zero at home (the
    origin).

    A line is a rope of natural length |anchor| + law, law = R * ratio * q, stiffness EA over that length; one
    of constant tension T in N is held by its motor's force, and its motor angle is the output.
    """

    drives = dim.HANGPRINTER_LINES
    nominal: Parameters = field(default_factory=lambda: dict(dim.HANGPRINTER))

    def feed(self, p: Parameters) -> Array:
        """Line (4,) in m per motor angle in rad."""
        radius = {"A": p["R_low"], "B": p["R_low"], "C": p["R_low"], "D": p["R_high"]}
        return np.array([radius[n] * dim.HANGPRINTER_RATIO[n] for n in self.drives])

    def anchors(self, p: Parameters) -> Array:
        """Anchors (4, 3) in m."""
        return np.array([[p[f"{n}{axis}"] for axis in "xyz"] for n in self.drives])

    def solve(
        self, q: ArrayLike, p: Parameters, tension: Mapping[str, float], start: ArrayLike = (0, 0, 0)
    ) -> pinned.Equilibrium:
        """Equilibrium of one row near `start` (3,) in m; see `forward`."""
        anchors = self.anchors(p)
        natural = np.linalg.norm(anchors, axis=1) + self.feed(p) * np.asarray(q, float)
        held = [n in tension for n in self.drives]
        ropes = Rods.of(
            body=np.zeros((4, 3)),
            base=anchors,
            drive=[-1] * 4,
            length=natural,
            stiffness=np.where(held, 0, p["EA"] / natural),
            tension=[tension.get(n, 0.0) for n in self.drives],
            rope=[not h for h in held],
        )
        weight = DeadForce(np.array([0, 0, -p["mass"] * dim.GRAVITY]), np.zeros(3))
        return pinned.minimise(ropes, State.at(start, np.zeros(0)), pinned.SPATIAL_POINT, (weight,))

    def forward(
        self, q: ArrayLike, parameters: Parameters | None = None, tension: Mapping[str, float] | None = None
    ) -> Forward:
        """Poses for motor angles `q` (N, 4) in rad; lines named in `tension` hold that constant tension in N
        and get their motor angle as output (`travel`). Tension 0 in the result: a slack line."""
        p, held = {**self.nominal, **(parameters or {})}, dict(tension or {})
        anchors, feed, rows = self.anchors(p), self.feed(p), []
        for row in np.atleast_2d(np.asarray(q, float)):
            # the way from home keeps to the side of the anchors' plane on which home is
            place = np.zeros(3)
            for share in np.linspace(0.1, 1, 10):
                found = self.solve(share * row, p, held, place)
                place = found.state.position.astype(float)
            travel = row.copy()
            for n, pull in held.items():
                i = self.drives.index(n)
                natural = np.linalg.norm(place - anchors[i]) / (1 + pull / p["EA"])
                travel[i] = (natural - np.linalg.norm(anchors[i])) / feed[i]
            rows.append((place, travel, found.energy, found.tension.astype(float)))
        places, travels, energies, tensions = (np.array(part) for part in zip(*rows, strict=True))
        return Forward(places, travels, energies, tensions, -feed * tensions)
