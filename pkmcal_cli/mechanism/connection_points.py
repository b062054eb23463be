"""Points as sums of offset vectors, connection points, and links between them, while a topology is being built.

A link is the difference of two such sums; what both share (the platform's own translation, say) cancels here, once,
instead of in every iteration.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.elements import Element
from pkmcal_cli.mechanism.coefficients import Formula
from pkmcal_cli.mechanism.topology import GROUND, OffsetVectors

Number = float | Formula


@dataclass(frozen=True)
class Point:
    """A sum of offset vectors: offsets (sign, number), translations (number, axis), by what carries them."""

    offsets: tuple[tuple[int, float, int], ...] = ()  # (rotation, sign, offset)
    translations: tuple[tuple[int, int, tuple[float, float, float]], ...] = ()  # (rotation, translation, axis)

    def __add__(self, other: Point) -> Point:
        return Point(self.offsets + other.offsets, self.translations + other.translations)


@dataclass(frozen=True)
class ConnectionPoint:
    """A point and the rotation of the body that it belongs to."""

    point: Point
    rotation: int


Ends = tuple[ConnectionPoint, ConnectionPoint]


@dataclass(frozen=True, kw_only=True)
class Rail:
    """A guide: origin and frame rotation, unit vector along it at nominal in the frame's axes.

    `tilted`: the rotation that carries this vector; `tilt`: how far parameters turn it, rotation vector in base axes.
    """

    origin: Point
    rotation: int
    along: Array
    tilted: int
    tilt: tuple[Number, Number, Number] | None


@dataclass(frozen=True, kw_only=True)
class Link:
    """The vector between two connection points, with triads at rest and sizes; `weight`: in the sum of a path."""

    connections: tuple[ConnectionPoint, ConnectionPoint]
    triads: tuple[Array, Array] = (np.eye(3), np.eye(3))
    sizes: tuple[Number, ...] = ()
    weight: float = 1.0


@dataclass(frozen=True, kw_only=True)
class Member:
    """An element on the links that it sees, with its numbers; `path`: its strain is a sum over them."""

    element: Element
    name: str
    links: tuple[Link, ...]
    rest: tuple[Number, ...]
    stiffness: tuple[Number, ...]
    prestress: tuple[Number, ...]
    rigid: tuple[bool, ...]
    rope: bool
    path: bool = False
    springs: tuple[bool, ...] = ()  # strains that only push and pull, and hold nothing in place; none if empty
    slides: tuple[tuple[int, float], ...] = ()  # translations that add to the natural length, with factors


def springs_of(members: Sequence[Member]) -> NDArray[np.bool_]:
    """Which strains of members (E, m) are springs."""
    return np.array([member.springs or (False,) * len(member.element.strains) for member in members], dtype=bool)


def slides_of(members: Sequence[Member], translations: int) -> Array:
    """What each translation adds to the natural lengths of members, (translations, E)."""
    out = np.zeros((translations, len(members)))
    for e, member in enumerate(members):
        for translation, factor in member.slides:
            out[translation, e] += factor
    return out


def offset_vectors_of(
    links: Sequence[Link], offsets: Sequence[tuple[int, int, int]], translations: int
) -> OffsetVectors:
    """The offset vectors of links, in order; offsets: coefficients of the constant ones; translations: how many."""
    rows: list[tuple[int, int, list[tuple[float, int]], list[tuple[int, Array]]]] = []
    start = []
    for number, link in enumerate(links):
        start.append(len(rows))
        rows += [(number, r, placed, moved) for r, placed, moved in _of_link(link)]
    width = max(len(row[2]) for row in rows)
    offset = np.zeros((len(rows), width), dtype=np.intp)
    sign = np.zeros((len(rows), width))
    translation = np.zeros((translations, len(rows) * 3))
    for a, (_, _, placed, moved) in enumerate(rows):
        for p, (factor, index) in enumerate(placed):
            offset[a, p], sign[a, p] = index, factor
        for t, axis in moved:
            translation[t, 3 * a : 3 * a + 3] += axis
    return OffsetVectors(
        link=np.array([row[0] for row in rows], dtype=np.intp),
        rotation=np.array([row[1] for row in rows], dtype=np.intp),
        start=np.array(start, dtype=np.intp),
        offset=offset,
        sign=sign,
        translation=translation,
        offset_coefficients=np.array(offsets, dtype=np.intp),
    )


def _of_link(link: Link) -> list[tuple[int, list[tuple[float, int]], list[tuple[int, Array]]]]:
    """Arms of point j minus point i by rotation; what both share cancels."""
    offsets: dict[tuple[int, int], float] = {}
    translations: dict[tuple[int, int], Array] = {}
    for factor, connection in ((-1.0, link.connections[0]), (1.0, link.connections[1])):
        for r, sign, index in connection.point.offsets:
            offsets[r, index] = offsets.get((r, index), 0.0) + factor * sign
        for r, t, axis in connection.point.translations:
            translations[r, t] = translations.get((r, t), np.zeros(3)) + factor * np.array(axis)
    rotations = sorted({r for r, _ in offsets} | {r for r, _ in translations}) or [GROUND]
    out = []
    for r in rotations:
        constant = [(sign, index) for (q, index), sign in offsets.items() if q == r and sign] or [(0.0, 0)]
        moved = [(t, axis) for (q, t), axis in translations.items() if q == r and axis.any()]
        if constant != [(0.0, 0)] or moved or len(rotations) == 1:
            out.append((r, constant, moved))
    return out or [(GROUND, [(0.0, 0)], [])]
