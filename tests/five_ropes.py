"""A point on five ropes, with weight: its machine file, the true machine, and the least tensions that hold it."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from tests.truth import pinned
from tests.truth.pinned import Array, DeadForce, Rods

ANCHORS = np.array([[0, 0, 2.0], [3, 0, 2], [3, 3, 2], [0, 3, 2], [1.5, 1.5, 0]])
PAYLOAD, ROPE_EA, HOME = 4.0, 20e3, np.array([1.5, 1.5, 1.0])
LEAST, MOST = 5.0, 100.0


def rope_text(t_min: float = LEAST, limit: float = MOST) -> str:
    """Five ropes, two redundant, wound by drives that count metres of line paid out since the point was at home."""
    ground = "".join(f"  A{i}: [x{i}, y{i}, z{i}]\n" for i in range(1, 6))
    numbers = "".join(
        f"  x{i}: {1e3 * x:g}\n  y{i}: {1e3 * y:g}\n  z{i}: {1e3 * z:g}\n" for i, (x, y, z) in enumerate(ANCHORS, 1)
    )
    ropes = "".join(f"  r{i}: {{between: [A{i}, tcp], length: l{i}, EA: 20 kN, t_min: {t_min}}}\n" for i in range(1, 6))
    lengths = "".join(f"  l{i}: {1e3 * v:.12g}\n" for i, v in enumerate(np.linalg.norm(ANCHORS - HOME, axis=1), 1))
    drives = "".join(
        f"  q{i}: {{winds: r{i}, force_limit: {limit}{', redundant: true' * (i > 3)}}}\n" for i in range(1, 6)
    )
    return (
        "units: {length: mm, angle: deg, force: N}\nspace: spatial\ngravity: [0, 0, -9.81]\nranges: {length: 2}\n"
        f"parameters:\n{numbers}{lengths}ground:\n{ground}nodes: {{tcp: {{at: [1500, 1500, 1000], mass: {PAYLOAD}}}}}\n"
        f"ropes:\n{ropes}actuators:\n{drives}"
        "sensors: {t: {at: tcp, reads: [x, y, z], sigma: 0.02, frame: machine}}\n"
    )


@dataclass(frozen=True)
class FiveRopes:
    """The true machine: anchors and line lengths off by some mm."""

    anchors: Array
    lengths: Array

    @classmethod
    def drawn(cls, seed: int) -> FiveRopes:
        """Anchors and lengths off by up to 1 mm."""
        rng = np.random.default_rng(seed)
        home = np.linalg.norm(ANCHORS - HOME, axis=1)
        return cls(ANCHORS + 1e-3 * rng.uniform(-1, 1, (5, 3)), home + 1e-3 * rng.uniform(-1, 1, 5))

    def parameters(self) -> str:
        """A parameter file with the true values."""
        named = {f"{axis}{i}": v for i, a in enumerate(self.anchors, 1) for axis, v in zip("xyz", a, strict=True)}
        named |= {f"l{i}": v for i, v in enumerate(self.lengths, 1)}
        return "parameters:\n" + "".join(f"  {n}: {1e3 * float(v)!r}\n" for n, v in named.items())

    def found(self, q: Array) -> pinned.Equilibrium:
        """Equilibrium at set values (5,) in m."""
        length = self.lengths + q
        rods = Rods.of(
            body=np.zeros((5, 3)), base=self.anchors, drive=[-1] * 5, length=length, stiffness=ROPE_EA / length,
            rope=[True] * 5,
        )  # fmt: skip
        weight = DeadForce(np.array([0, 0, -PAYLOAD * 9.81]), np.zeros(3))
        return pinned.minimise(rods, pinned.State.at(HOME, np.zeros(0)), pinned.SPATIAL_POINT, (weight,))

    def directions(self, place: Array) -> Array:
        """Unit vectors (3, 5) along which ropes pull a point at a place."""
        way = self.anchors - place
        return np.asarray((way / np.linalg.norm(way, axis=1, keepdims=True)).T)

    def least_forces(self, place: Array, low: float) -> Array:
        """Tensions (5,) of least sum of squares, none below a limit, that hold the weight at a place.

        Every set of ropes that may be at the limit is tried; the others share the rest by least squares.
        """
        balance, weight = self.directions(place), np.array([0, 0, PAYLOAD * 9.81])
        tried = []
        for at_limit in product((False, True), repeat=5):
            tension, free = np.full(5, low), ~np.array(at_limit)
            rest = weight - balance[:, ~free] @ tension[~free]
            tension[free] = np.linalg.pinv(balance[:, free]) @ rest
            if np.abs(balance @ tension - weight).max() < 1e-9 and tension.min() >= low - 1e-9:
                tried.append(tension)
        return min(tried, key=lambda t: float(t @ t))
