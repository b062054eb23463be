"""The compiled machine as index arrays: coordinates, arms, links between ports, elements. It never changes.

Coordinates are *travels* (lengths along an axis carried by a rotation; the position of a free node is three travels
along the base axes) and *rotations*. A point is a sum of *arms*: vectors, each constant in one rotation's triad but
for the travels along it. So points of bodies, carriages on guides, pinned member ends and rigid telescopes need no
unknowns of their own, and no constraint either. A *link* is the vector between the points of two ports.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.base.sparse_map import Block, Entries, SparseMap
from pkmcal_cli.elements import Element
from pkmcal_cli.mechanism.coefficients import SlotTable

Index = NDArray[np.intp]
GROUND = 0  # rotation number of the base


class Turn(IntEnum):
    """How a rotation moves."""

    FIXED = 0  # prescribed rotation vector (frames; zero for the base)
    FREE = 1  # three unknowns
    AXIS = 2  # one unknown: about an axis fixed to the base


@dataclass(frozen=True)
class Rotations:
    """The B rotations: kind, axis of those with one freedom, drawn orientation, and slots of what is prescribed.

    `drawn` is the assembled drawing; orientations are read against `filed`, the drawing as the machine file has it.
    """

    kind: Index  # (B,)
    axis: Array  # (B, 3) unit vector in base axes
    drawn: Array  # (B, 3, 3) orientation at the assembled drawing
    filed: Array  # (B, 3, 3) orientation in the file's drawing
    slots: Index  # (B, 3) rotation vector slots (FIXED), or the angle in column 0 (AXIS, when driven); -1: none
    names: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Arms:
    """Vectors that add up to links, ordered by link."""

    link: Index  # (A,)
    rotation: Index  # (A,)
    start: Index  # (links,) first arm of each link
    offset: Index  # (A, P) which offset vectors, padded with the zero offset 0
    sign: Array  # (A, P)
    travel: Array  # (T, A * 3): travel values to arm vectors, in the arm's triad
    offset_slots: Index  # (O, 3) slots of the offset vectors


@dataclass(frozen=True, kw_only=True)
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


@dataclass(frozen=True, kw_only=True)
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


@dataclass(frozen=True, kw_only=True)
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

    @cached_property
    def rotation_dofs(self) -> Index:
        """First coordinate of each rotation, -1 for FIXED; travels come first."""
        width = np.array([0, 3, 1])[self.rotations.kind]
        start = len(self.travel_slots) + np.cumsum(width) - width
        return np.where(width > 0, start, -1)

    @cached_property
    def n_dof(self) -> int:
        """Travels plus rotational coordinates."""
        return int(len(self.travel_slots) + np.array([0, 3, 1])[self.rotations.kind].sum())

    @cached_property
    def inputs(self) -> Index:
        """Element inputs that can be non-zero: all nine, or x, y and the rotations about z."""
        return np.array([0, 1, 5, 8]) if self.planar else np.arange(9)

    @property
    def width(self) -> int:
        """Dimensions of the space."""
        return 2 if self.planar else 3

    @cached_property
    def carried_arms(self) -> Index:
        """Arms that another rotation than the base carries."""
        return np.nonzero(self.arms.rotation != GROUND)[0]

    @cached_property
    def frames(self) -> Index:
        """Rotations that slots prescribe by a rotation vector."""
        return np.nonzero((self.rotations.kind == Turn.FIXED) & (self.rotations.slots[:, 0] >= 0))[0]

    @property
    def moved_blocks(self) -> tuple[Block, Block]:
        """Rotations (B, 3, 3) and arms (A, 3): the stacked array out of which links and triads are made."""
        rotations = Block(0, (len(self.rotations.kind), 3, 3))
        return rotations, Block(rotations.stop, (len(self.arms.link), 3))

    @property
    def arm_block(self) -> Block:
        """Arms (A, 3) alone."""
        return Block(0, (len(self.arms.link), 3))

    @property
    def link_block(self) -> Block:
        """Links (links, 3) alone."""
        return Block(0, (len(self.arms.start), 3))

    @cached_property
    def moved(self) -> int:
        """Length of the stacked array of rotations and arms."""
        return self.moved_blocks[1].stop

    @cached_property
    def offset_map(self) -> SparseMap:
        """From slots (S) to the constant part of the arms (A, 3) in the arms' triads."""
        arms, out, entries = self.arms, self.arm_block, Entries.none()
        for p in range(arms.offset.shape[1]):
            entries.add(out.numbers, arms.offset_slots[arms.offset[:, p]], arms.sign[:, p, None])
        return entries.build(out.stop, len(self.slots.constants))

    @cached_property
    def travel_map(self) -> SparseMap:
        """From travels (T) to their part of the arms (A, 3) in the arms' triads."""
        out, entries = self.arm_block, Entries.none()
        axes = self.arms.travel.reshape(len(self.travel_slots), *out.shape)
        entries.add(out.numbers, np.arange(len(axes))[:, None, None], axes)
        return entries.build(out.stop, len(axes))

    @cached_property
    def link_map(self) -> SparseMap:
        """From arms (A, 3) to links (links, 3)."""
        arms, links, entries = self.arm_block, self.link_block, Entries.none()
        entries.add(links.numbers[self.arms.link], arms.numbers, 1.0)
        return entries.build(links.stop, arms.stop)
