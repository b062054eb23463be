"""Points as sums of arms, ports, and links between ports, while a layout is being built."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.elements import Element
from pkmcal_cli.mechanism.coefficients import Formula
from pkmcal_cli.mechanism.topology import GROUND

Number = float | Formula


@dataclass(frozen=True)
class Point:
    """A sum of arms: offsets (sign, number) and travels (number, axis) by the rotation that carries them."""

    offsets: tuple[tuple[int, float, int], ...] = ()  # (rotation, sign, offset)
    travels: tuple[tuple[int, int, tuple[float, float, float]], ...] = ()  # (rotation, travel, axis)

    def __add__(self, other: Point) -> Point:
        return Point(self.offsets + other.offsets, self.travels + other.travels)


@dataclass(frozen=True)
class Port:
    """A point and the rotation of the body that it belongs to."""

    point: Point
    rotation: int


@dataclass(frozen=True)
class Rail:
    """A guide: origin and frame rotation, unit vector along it in the frame's axes."""

    origin: Point
    rotation: int
    along: Array


@dataclass(frozen=True, kw_only=True)
class Link:
    """What a link carries: an element between two ports, with its numbers."""

    element: Element | None
    name: str
    ports: tuple[Port, Port]
    triads: tuple[Array, Array]
    rest: tuple[Number, ...]
    stiffness: tuple[Number, ...]
    prestress: tuple[Number, ...]
    rigid: tuple[bool, ...]
    rope: bool


def arms_of(link: Link) -> list[tuple[int, list[tuple[float, int]], list[tuple[int, Array]]]]:
    """Arms of port j minus port i by rotation; what both share cancels."""
    offsets: dict[tuple[int, int], float] = {}
    travels: dict[tuple[int, int], Array] = {}
    for factor, port in ((-1.0, link.ports[0]), (1.0, link.ports[1])):
        for r, sign, index in port.point.offsets:
            offsets[r, index] = offsets.get((r, index), 0.0) + factor * sign
        for r, t, axis in port.point.travels:
            travels[r, t] = travels.get((r, t), np.zeros(3)) + factor * np.array(axis)
    rotations = sorted({r for r, _ in offsets} | {r for r, _ in travels}) or [GROUND]
    out = []
    for r in rotations:
        mine = [(sign, index) for (q, index), sign in offsets.items() if q == r and sign] or [(0.0, 0)]
        moved = [(t, axis) for (q, t), axis in travels.items() if q == r and axis.any()]
        if mine != [(0.0, 0)] or moved or len(rotations) == 1:
            out.append((r, mine, moved))
    return out or [(GROUND, [(0.0, 0)], [])]
