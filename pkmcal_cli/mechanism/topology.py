"""The compiled machine as index arrays: coordinates, offset vectors, links, elements. It never changes.

Coordinates are *translations* (lengths along an axis carried by a rotation; the position of a free node is three
translations along the base axes) and *rotations*. A point is a sum of *offset vectors*, x = sum R_r (o + s a) with
translations s: each is constant in the triad of one rotation r but for the translations along it. So points of bodies,
carriages on guides, pinned member ends and rigid telescopes need no unknowns of their own, and no constraint either. A
*link* is the vector between the points of two connection points. An element sees one link, or several: a rope over
pulleys is a path of links.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.base.sparse_map import Block, Entries, SparseMap
from pkmcal_cli.elements import Element
from pkmcal_cli.mechanism.coefficients import CoefficientTable

Index = NDArray[np.intp]
GROUND = 0  # rotation number of the base


class RotationKind:
    """How a rotation moves; a frame as what carries it does. Plain integers, as of RowStatus."""

    FIXED: Final = 0  # not, but for its prescribed rotation vector
    FREE: Final = 1  # three unknowns
    AXIS: Final = 2  # one unknown: about an axis fixed to the base


@dataclass(frozen=True, kw_only=True)
class Rotations:
    """The B rotations: kind, axis of those with one freedom, reference orientation, coefficients if prescribed.

    `reference` is the assembled reference configuration; orientations are read against `filed`, the reference
    configuration as the machine file has it. A *frame* is turned by coefficients against its carrier, the base or
    another rotation before it, and moves with it: R = R_carrier exp(vector) reference.
    """

    kind: Index  # (B,) of a frame: that of its carrier
    axis: Array  # (B, 3) unit vector in base axes
    reference: Array  # (B, 3, 3) orientation at the assembled reference configuration; of a frame: as carried
    filed: Array  # (B, 3, 3) orientation in the file's configuration
    coefficients: Index  # (B, 3) of the rotation vector of a frame, or the angle in column 0 (AXIS, driven); -1: none
    carrier: Index  # (B,) rotation that carries a frame; -1: it is none
    names: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class OffsetVectors:
    """Vectors that add up to links, ordered by link."""

    link: Index  # (A,)
    rotation: Index  # (A,)
    start: Index  # (links,) first offset vector of each link
    offset: Index  # (A, P) which offset vectors, padded with the zero offset 0
    sign: Array  # (A, P)
    translation: Array  # (T, A * 3): translation values to offset vectors, in their triads
    offset_coefficients: Index  # (O, 3) coefficients of the offset vectors


@dataclass(frozen=True, kw_only=True)
class Group:
    """K links that carry E elements of one kind: one each, or paths of several.

    The strain of a path is the sum of its links' lengths by their weights, less its rest value.
    """

    element: Element
    names: tuple[str, ...]  # (E,)
    links: slice
    rotation: Index  # (2, K) rotations of the connection points i and j
    triads: Array  # (2, K, 3, 3) the element's triads at rest, in the coordinates of the connection point's rotation
    sizes: slice  # coefficients, (K, p)
    path: Index | None  # (K,) element of each link, ascending; None: one link each
    weights: Array  # (K,)
    rest: slice  # coefficients, (E, m)
    stiffness: slice  # coefficients, (E, P)
    prestress: slice  # coefficients, (E, m)
    rigid: NDArray[np.bool_]  # (E, m) constraint instead of stiffness
    rope: NDArray[np.bool_]  # (E,) carries no compression
    springs: NDArray[np.bool_]  # (E, m) strains that act with loads only: springs that hold nothing in place
    slides: Array  # (T, E) what translations add to natural lengths; zero but where the element slides

    @property
    def shape(self) -> tuple[int, int]:
        """Number of elements and of strains of each."""
        return len(self.names), len(self.element.strains)

    @property
    def gaps(self) -> NDArray[np.bool_]:
        """Which strains (E, m) are distances between parts that belong together."""
        return self.element.gaps & ~self.springs

    @cached_property
    def owners(self) -> Index:
        """Element of each link, (K,)."""
        return np.arange(len(self.names)) if self.path is None else self.path

    @cached_property
    def summing(self) -> Array:
        """From lengths of links to those of paths, (E, K)."""
        return np.equal.outer(np.arange(len(self.names)), self.owners) * self.weights


class DriveKind(Enum):
    """What a drive commands."""

    TRAVEL = 0
    ROTATION = 1
    STRAIN = 2


@dataclass(frozen=True, kw_only=True)
class Drive:
    """Where an actuator enters: the coefficient that its position sets, and how it is released or force-controlled."""

    name: str
    kind: DriveKind
    coefficient: int  # set to zero + law(reading)
    target: tuple[int, ...]  # (translation,), (rotation,) or (group, element, strain)
    force_coefficient: int  # constant drive force; prestress of the strain, or force on the coordinate
    force_sign: float  # coefficient value = force_sign * force
    redundant: bool
    force_controlled: bool
    rigid: bool


@dataclass(frozen=True, kw_only=True)
class Topology:
    """Index arrays of one machine."""

    planar: bool
    coefficients: CoefficientTable
    translation_coefficients: Index  # (T,) prescribed value of each translation; -1 where it can only be free
    translation_reference: Array  # (T,)
    translation_free: NDArray[np.bool_]  # (T,) free unless a drive commands it
    translation_names: tuple[str, ...]
    rotations: Rotations
    offset_vectors: OffsetVectors
    groups: tuple[Group, ...]
    aims: tuple[Group, ...]  # constraints that put points at poses; act in inverse positions only
    points: Index  # links from the base to the points that sensors read
    force_dofs: Index  # (W,) coordinates on which constant forces act, numbered as in `dof`
    force_coefficients: Index  # (W,)
    drives: tuple[Drive, ...]
    parked: tuple[int, ...] = field(default=())  # coordinates of free motions that carry no load

    @cached_property
    def rotation_dofs(self) -> Index:
        """First coordinate of each rotation, that of its carrier for a frame, -1 for FIXED; translations come first."""
        width = self._widths
        start = np.where(width > 0, len(self.translation_coefficients) + np.cumsum(width) - width, -1)
        for r in self.frames:
            start[r] = start[self.rotations.carrier[r]]
        return start

    @cached_property
    def _widths(self) -> Index:
        """Coordinates of each rotation, none of a frame."""
        return np.where(self.rotations.carrier < 0, np.array([0, 3, 1])[self.rotations.kind], 0)

    @cached_property
    def n_dof(self) -> int:
        """Travels plus rotational coordinates."""
        return int(len(self.translation_coefficients) + self._widths.sum())

    @cached_property
    def inputs(self) -> Index:
        """Element inputs that can be non-zero: all ten, or x, y, the rotations about z and the natural length."""
        return np.array([0, 1, 5, 8, 9]) if self.planar else np.arange(10)

    def moves_length(self, drive: Drive) -> bool:
        """Whether a drive's position is a length, not an angle."""
        if drive.kind is DriveKind.STRAIN:
            group, _, strain = drive.target
            return self.groups[group].element.strains[strain] in ("elongation", "x", "y", "z")
        return drive.kind is DriveKind.TRAVEL

    @cached_property
    def width(self) -> int:
        """Dimensions of the space."""
        return 2 if self.planar else 3

    @cached_property
    def carried_offset_vectors(self) -> Index:
        """Arms that another rotation than the base carries."""
        return np.nonzero(self.offset_vectors.rotation != GROUND)[0]

    @cached_property
    def frames(self) -> Index:
        """Rotations that coefficients turn against their carriers, carriers before what they carry."""
        return np.nonzero(self.rotations.carrier >= 0)[0]

    @cached_property
    def free_rotations(self) -> tuple[Index, Index]:
        """Rotations with three coordinates (F,), and which these are (F, 3)."""
        free = np.nonzero(self.rotations.kind == RotationKind.FREE)[0]
        return free, self.rotation_dofs[free, None] + np.arange(3)

    @cached_property
    def axial_rotations(self) -> tuple[Index, Index, Array]:
        """Rotations about an axis (F,), their coordinates (F,) and axes (F, 3)."""
        axial = np.nonzero(self.rotations.kind == RotationKind.AXIS)[0]
        return axial, self.rotation_dofs[axial], self.rotations.axis[axial]

    @cached_property
    def moved_blocks(self) -> tuple[Block, Block]:
        """Rotations (B, 3, 3) and offset vectors (A, 3): the stacked array out of which links and triads are made."""
        rotations = Block(0, (len(self.rotations.kind), 3, 3))
        return rotations, Block(rotations.stop, (len(self.offset_vectors.link), 3))

    @cached_property
    def offset_vector_block(self) -> Block:
        """Arms (A, 3) alone."""
        return Block(0, (len(self.offset_vectors.link), 3))

    @cached_property
    def link_block(self) -> Block:
        """Links (links, 3) alone."""
        return Block(0, (len(self.offset_vectors.start), 3))

    @cached_property
    def moved(self) -> int:
        """Length of the stacked array of rotations and offset vectors."""
        return self.moved_blocks[1].stop

    @cached_property
    def offset_map(self) -> SparseMap:
        """From coefficients (S) to the constant part of the offset vectors (A, 3) in their triads."""
        offset_vectors, out, entries = self.offset_vectors, self.offset_vector_block, Entries.none()
        for p in range(offset_vectors.offset.shape[1]):
            entries.add(
                out.numbers,
                offset_vectors.offset_coefficients[offset_vectors.offset[:, p]],
                offset_vectors.sign[:, p, None],
            )
        return entries.build(out.stop, len(self.coefficients.constants))

    @cached_property
    def translation_map(self) -> SparseMap:
        """From translations (T) to their part of the offset vectors (A, 3) in their triads."""
        out, entries = self.offset_vector_block, Entries.none()
        axes = self.offset_vectors.translation.reshape(len(self.translation_coefficients), *out.shape)
        entries.add(out.numbers, np.arange(len(axes))[:, None, None], axes)
        return entries.build(out.stop, len(axes))

    @cached_property
    def link_map(self) -> SparseMap:
        """From offset vectors (A, 3) to links (links, 3)."""
        offset_vectors, links, entries = self.offset_vector_block, self.link_block, Entries.none()
        entries.add(links.numbers[self.offset_vectors.link], offset_vectors.numbers, 1.0)
        return entries.build(links.stop, offset_vectors.stop)
