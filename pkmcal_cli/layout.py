"""The compiled machine as index arrays: coordinates, arms, links between ports, elements. It never changes.

Coordinates are *travels* (lengths along an axis carried by a rotation; the position of a free node is three travels
along the base axes) and *rotations*. A point is a sum of *arms*: vectors, each constant in one rotation's triad but
for the travels along it. So points of bodies, carriages on guides, pinned member ends and rigid telescopes need no
unknowns of their own, and no constraint either. A *link* is the vector between the points of two ports.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from .elements import Element
from .rotation import Array
from .slots import SlotTable

Index = NDArray[np.intp]
GROUND = 0  # rotation number of the base


class Turn(IntEnum):
    """How a rotation moves."""

    FIXED = 0  # prescribed rotation vector (frames; zero for the base)
    FREE = 1  # three unknowns
    AXIS = 2  # one unknown: about an axis fixed to the base


@dataclass(frozen=True)
class Rotations:
    """The B rotations: kind, axis of those with one freedom, drawn orientation, and slots of what is prescribed."""

    kind: Index  # (B,)
    axis: Array  # (B, 3) unit vector in base axes
    drawn: Array  # (B, 3, 3) orientation at the drawing
    slots: (
        Index  # (B, 3) rotation vector slots (FIXED), or the angle in column 0 (AXIS, when driven); -1: none
    )
    names: tuple[str, ...]


@dataclass(frozen=True)
class Arms:
    """Vectors that add up to links, ordered by link."""

    link: Index  # (A,)
    rotation: Index  # (A,)
    start: Index  # (links,) first arm of each link
    offset: Index  # (A, P) which offset vectors, padded with the zero offset 0
    sign: Array  # (A, P)
    travel: Array  # (T, A * 3): travel values to arm vectors, in the arm's triad
    offset_slots: Index  # (O, 3) slots of the offset vectors


@dataclass(frozen=True)
class Group:
    """Links that carry elements of one kind."""

    element: Element
    names: tuple[str, ...]  # (E,)
    links: slice
    rotation: Index  # (2, E) rotations of the ports i and j
    triads: Array  # (2, E, 3, 3) the element's triads at rest, in the coordinates of the port's rotation
    rest: slice  # slots, (E, m)
    stiffness: slice  # slots, (E, P)
    prestress: slice  # slots, (E, m)
    rigid: NDArray[np.bool_]  # (E, m) constraint instead of stiffness
    rope: NDArray[np.bool_]  # (E,) carries no compression

    @property
    def shape(self) -> tuple[int, int]:
        """Number of elements and of strains of each."""
        return len(self.names), len(self.element.strains)


class DriveKind(IntEnum):
    """What a drive commands."""

    TRAVEL = 0
    ROTATION = 1
    STRAIN = 2


@dataclass(frozen=True)
class Drive:
    """Where an actuator enters: the slot that its position sets, and how it is released or force-controlled."""

    name: str
    kind: DriveKind
    slot: int  # set to zero + law(reading)
    target: tuple[int, ...]  # (travel,), (rotation,) or (group, element, strain)
    force_slot: int  # constant drive force; prestress of the strain, or force on the coordinate
    force_sign: float  # slot value = force_sign * force
    redundant: bool
    force_controlled: bool
    rigid: bool


@dataclass(frozen=True)
class Layout:
    """Index arrays of one machine."""

    planar: bool
    slots: SlotTable
    travel_slots: Index  # (T,) prescribed value of each travel; -1 where it can only be free
    travel_drawn: Array  # (T,)
    travel_free: NDArray[np.bool_]  # (T,) free unless a drive commands it
    travel_names: tuple[str, ...]
    rotations: Rotations
    arms: Arms
    groups: tuple[Group, ...]
    aims: tuple[Group, ...]  # constraints that put the TCP at a pose; act in inverse positions only
    points: Index  # links from the base to the points that sensors read
    force_dofs: Index  # (W,) coordinates on which constant forces act, numbered as in `dof`
    force_slots: Index  # (W,)
    drives: tuple[Drive, ...]
    held: tuple[int, ...] = field(default=())  # coordinates of free motions that carry no load

    @property
    def rotation_dofs(self) -> Index:
        """First coordinate of each rotation, -1 for FIXED; travels come first."""
        width = np.array([0, 3, 1])[self.rotations.kind]
        start = len(self.travel_slots) + np.cumsum(width) - width
        return np.where(width > 0, start, -1)

    @property
    def n_dof(self) -> int:
        """Travels plus rotational coordinates."""
        return int(len(self.travel_slots) + np.array([0, 3, 1])[self.rotations.kind].sum())

    @property
    def inputs(self) -> Index:
        """Element inputs that can be non-zero: all nine, or x, y and the rotations about z."""
        return np.array([0, 1, 5, 8]) if self.planar else np.arange(9)
