"""Where the parts of a machine are in a state: named points, guides and the courses of members."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.equilibrium.kinematics import State
from pkmcal_cli.mechanism.connection_points import Link, Point, Rail
from pkmcal_cli.mechanism.topology import Topology

_ALONG_PIECE = 9  # points of the curve of a piece that bends


@dataclass(frozen=True)
class Piece:
    """An element of a member: between which connection points; whether it bends."""

    element: str
    link: Link
    bends: bool


Axis = tuple[int, Array]
"""A rotation and the unit vector (3,) that it carries, in its axes."""


@dataclass(frozen=True)
class JointPlace:
    """A joint: its type, its point, its axes (two of a universal joint), and the names of the points that it joins."""

    type: str
    point: Point
    axes: tuple[Axis, ...]
    between: tuple[str, ...]


@dataclass(frozen=True)
class Layout:
    """What can be drawn of a machine: points of nodes, bodies and the base, guides, elements by member, joints."""

    points: Mapping[str, Point]
    rails: Mapping[str, Rail]
    pieces: Mapping[str, tuple[Piece, ...]]
    joints: Mapping[str, JointPlace]


@dataclass(frozen=True)
class Placed:
    """A topology at coefficients (N, S) and in a state of N rows; what it says is in base axes, m."""

    topology: Topology
    coefficients: Array
    state: State

    def position_of(self, point: Point) -> Array:
        """Place (N, 3) of a point: x = sum R_r (o + travel a)."""
        out = np.zeros((len(self.state), 3))
        numbers = self.topology.offset_vectors.offset_coefficients
        for rotation, sign, offset in point.offsets:
            out += sign * np.einsum("nij,nj->ni", self._rotation(rotation), self.coefficients[:, numbers[offset]])
        for rotation, travel, axis in point.translations:
            out += self.state.translation[:, travel, None] * (self._rotation(rotation) @ np.array(axis))
        return out

    def direction(self, rotation: int, vector: Array) -> Array:
        """A vector (3,) that a rotation carries, (N, 3)."""
        return np.asarray(self._rotation(rotation) @ vector)

    def course(self, piece: Piece) -> Array:
        """Points (N, K, 3) along an element: its ends, or the cubic curve between them where it bends."""
        first, last = piece.link.connections
        a, b = self.position_of(first.point)[:, None], self.position_of(last.point)[:, None]
        if not piece.bends:
            return np.concatenate([a, b], axis=1)
        size = np.sqrt(((b - a) ** 2).sum(axis=-1, keepdims=True))
        ways = (self.direction(c.rotation, t[:, 0]) for c, t in zip((first, last), piece.link.triads, strict=True))
        start, end = (size * way[:, None] for way in ways)
        s = np.linspace(0.0, 1.0, _ALONG_PIECE)[:, None]
        by_ends = (1 + 2 * s) * (1 - s) ** 2 * a + s**2 * (3 - 2 * s) * b
        return np.asarray(by_ends + s * (1 - s) ** 2 * start - s**2 * (1 - s) * end)

    def _rotation(self, rotation: int) -> Array:
        return np.asarray(self.state.rotation[:, rotation])
