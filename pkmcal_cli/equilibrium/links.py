"""How links depend on unknowns: a constant part, and directions that vary with the state.

A link's inputs are delta (the vector from point i to point j) and the increments theta_i, theta_j of the rotations of
its connection points. Where the dependence is constant (a node moved along base axes, a connection point on a free
rotation) it is a template, made once. An offset vector v that rotates moves delta by theta x v, a direction that
varies with the state; the three, or one, unknowns of its rotation, or the translation along it, are the link's
*varying* inputs, X of them. Few links have any, so only these pay for them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from pkmcal_cli.base.rotation import Array, skew
from pkmcal_cli.base.sparse_map import Block, Entries, SparseMap
from pkmcal_cli.elements.element import NATURAL_LENGTH
from pkmcal_cli.mechanism.topology import Group, Index, RotationKind, Topology

_WIDTH = {RotationKind.FIXED: 0, RotationKind.FREE: 3, RotationKind.AXIS: 1}


class Rotating(NamedTuple):
    """Offset vectors on rotations with three unknowns, (F,) each: link, first local unknown, vector, varying input."""

    link: Index
    column: Index
    offset_vector: Index
    varying: Index


class Hinged(NamedTuple):
    """Offset vectors on rotations about a fixed axis (F, 3), else as Rotating."""

    link: Index
    column: Index
    offset_vector: Index
    varying: Index
    axis: Array


class Sliding(NamedTuple):
    """Travels along an axis (F, 3) of a rotation that is not the base, else as Rotating."""

    link: Index
    column: Index
    offset_vector: Index
    varying: Index
    axis: Array


class Pairs(NamedTuple):
    """Travels along offset vectors that rotate: index in Sliding, and index of the vector in Rotating or Hinged."""

    sliding: Index
    rotating: Index


@dataclass(frozen=True, kw_only=True)
class LinkMap:
    """Local unknowns of the E links of a group and how the inputs depend on them."""

    topology: Topology
    links: slice
    unknowns: Index  # (E, L) global unknowns, -1 padded
    template: Array  # (E, L, I) constant part of the transposed input Jacobian
    moving: Index  # (M,) links with varying inputs
    varying: Array  # (M, L, X) which local unknown each varying input is
    rotating: Rotating
    hinged: Hinged
    sliding: Sliding
    sliding_rotating: Pairs
    sliding_hinged: Pairs

    @property
    def shape(self) -> tuple[int, int]:
        """Number of links that have varying inputs, and how many they have."""
        return len(self.moving), self.varying.shape[2]

    @cached_property
    def directions(self) -> SparseMap:
        """Map from rotations and offset vectors to the varying directions (M, X, 3)."""
        block, entries = Block(0, (*self.shape, 3)), Entries.none()
        self.add_directions(block, entries)
        return entries.build(block.stop, self.topology.moved)

    def add_directions(self, block: Block, entries: Entries) -> None:
        """Entries of `directions` for a block of that shape."""
        rotations, offset_vectors = self.topology.moved_blocks
        number, axes = block.numbers, np.arange(3)
        row = np.searchsorted(self.moving, self.rotating.link)
        for k, unit in enumerate(np.eye(3)):  # unit x offset vector
            target = number[row, self.rotating.varying + k]
            entries.add(target[:, :, None], offset_vectors.numbers[self.rotating.offset_vector][:, None, :], skew(unit))
        row = np.searchsorted(self.moving, self.hinged.link)
        target = number[row, self.hinged.varying]
        entries.add(
            target[:, :, None], offset_vectors.numbers[self.hinged.offset_vector][:, None, :], skew(self.hinged.axis)
        )
        row = np.searchsorted(self.moving, self.sliding.link)
        target = number[row, self.sliding.varying]
        carrier = self.topology.offset_vectors.rotation[self.sliding.offset_vector]
        source = rotations.numbers[carrier[:, None, None], axes[:, None], axes]
        entries.add(target[:, :, None], source, self.sliding.axis[:, None, :])


@dataclass(kw_only=True)
class _Collector:
    """Entries collected link by link."""

    topology: Topology
    unknown_of: Index
    local: list[list[int]] = field(default_factory=list)
    fixed: list[tuple[int, int, Array]] = field(default_factory=list)  # link, column, direction
    rotating: list[tuple[int, int, int, int]] = field(default_factory=list)
    hinged: list[tuple[int, int, int, int, Array]] = field(default_factory=list)
    sliding: list[tuple[int, int, int, int, Array]] = field(default_factory=list)
    sliding_rotating: list[tuple[int, int]] = field(default_factory=list)
    sliding_hinged: list[tuple[int, int]] = field(default_factory=list)
    lengthening: list[tuple[int, int, float]] = field(default_factory=list)  # link, column, factor
    width: int = 0

    def add_link(self, e: int, link: int, connections: list[int], slides: Array) -> None:
        """Local unknowns of one link, the offset vectors by which they move it, translations (T,) that lengthen it."""
        topology = self.topology
        offset_vectors, rotations, first = topology.offset_vectors, topology.rotations, topology.rotation_dofs
        of_link = [int(a) for a in np.nonzero(offset_vectors.link == link)[0]]
        local: list[int] = []
        for r in [int(offset_vectors.rotation[a]) for a in of_link] + connections:
            dofs = np.arange(first[r], first[r] + _WIDTH[int(rotations.kind[r])])
            if len(dofs) and first[r] not in local and (self.unknown_of[dofs] >= 0).any():
                local += dofs.tolist()
        used = 0
        for a in of_link:
            rotates = int(first[offset_vectors.rotation[a]]) in local
            used = self._add_rotation(e, a, local, used) if rotates else used
            used = self._add_translations(e, a, local, used, rotates)
        for t in np.nonzero((slides != 0) & (self.unknown_of[: len(slides)] >= 0))[0]:
            local.append(int(t))
            self.lengthening.append((e, len(local) - 1, float(slides[t])))
        self.local.append(local)
        self.width = max(self.width, used)

    def _add_rotation(self, e: int, a: int, local: list[int], used: int) -> int:
        r = int(self.topology.offset_vectors.rotation[a])
        column = local.index(int(self.topology.rotation_dofs[r]))
        if self.topology.rotations.kind[r] == RotationKind.FREE:
            self.rotating.append((e, column, a, used))
            return used + 3
        self.hinged.append((e, column, a, used, self.topology.rotations.axis[r]))
        return used + 1

    def _add_translations(self, e: int, a: int, local: list[int], used: int, rotates: bool) -> int:
        rotations, r = self.topology.rotations, int(self.topology.offset_vectors.rotation[a])
        axes = self.topology.offset_vectors.translation[:, 3 * a : 3 * a + 3]
        for t in np.nonzero((axes != 0).any(1) & (self.unknown_of[: len(axes)] >= 0))[0]:
            local.append(int(t))
            if rotations.kind[r] == RotationKind.FIXED and rotations.coefficients[r, 0] < 0:
                self.fixed.append((e, len(local) - 1, rotations.reference[r] @ axes[t]))
                continue
            if rotates and rotations.kind[r] == RotationKind.FREE:
                self.sliding_rotating.append((len(self.sliding), len(self.rotating) - 1))
            elif rotates:
                self.sliding_hinged.append((len(self.sliding), len(self.hinged) - 1))
            self.sliding.append((e, len(local) - 1, a, used, axes[t]))
            used += 1
        return used


def build_links(topology: Topology, links: slice, unknown_of: Index, group: Group | None = None) -> LinkMap:
    """Build the map of a range of links: those of a group of elements, or of points."""
    triads = group is not None and group.element.uses_triads
    connections = group.rotation if group is not None and triads else None
    count = (len(topology.translation_names), links.stop - links.start)
    slides = np.zeros(count) if group is None else group.slides[:, group.owners]
    collected = _Collector(topology=topology, unknown_of=unknown_of)
    for e, link in enumerate(range(links.start, links.stop)):
        ends = [] if connections is None else [int(r) for r in connections[:, e]]
        collected.add_link(e, link, ends, slides[:, e])
    width = max((len(local) for local in collected.local), default=0)
    unknowns = np.full((len(collected.local), width), -1, dtype=np.intp)
    for e, local in enumerate(collected.local):
        unknowns[e, : len(local)] = unknown_of[local]
    moving = sorted({int(entry[0]) for entry in (*collected.rotating, *collected.hinged, *collected.sliding)})
    return LinkMap(
        topology=topology,
        links=links,
        unknowns=unknowns,
        template=_template(collected, connections, width, 3 if group is None else group.element.inputs),
        moving=np.array(moving, dtype=np.intp),
        varying=_varying(collected, moving, width),
        rotating=Rotating(*_numbers(collected.rotating)),
        hinged=Hinged(*_numbers(collected.hinged), _axes(collected.hinged)),
        sliding=Sliding(*_numbers(collected.sliding), _axes(collected.sliding)),
        sliding_rotating=_pairs(collected.sliding_rotating),
        sliding_hinged=_pairs(collected.sliding_hinged),
    )


def _template(collected: _Collector, connections: Index | None, width: int, inputs: int) -> Array:
    """Constant inputs (E, L, I): fixed directions of translations; connection point rotations, identity or the axis."""
    topology, out = collected.topology, np.zeros((len(collected.local), width, 10))
    for e, column, factor in collected.lengthening:
        out[e, column, NATURAL_LENGTH] = factor
    for e, column, direction in collected.fixed:
        out[e, column, :3] = direction
    for side, offset in ((0, 3), (1, 6)) if connections is not None else ():
        for e, dofs in enumerate(collected.local):
            r = int(connections[side, e]) if connections is not None else 0
            start = topology.rotation_dofs[r]
            if start in dofs:
                column = dofs.index(start)
                free = topology.rotations.kind[r] == RotationKind.FREE
                axes = np.eye(3) if free else topology.rotations.axis[r][None]
                out[e, column : column + len(axes), offset : offset + 3] = axes
    return np.ascontiguousarray(out[:, :, topology.inputs[topology.inputs < inputs]])


def _varying(collected: _Collector, moving: list[int], width: int) -> Array:
    out = np.zeros((len(moving), width, collected.width))
    for entries, count in ((collected.rotating, 3), (collected.hinged, 1), (collected.sliding, 1)):
        for entry in entries:
            for k in range(count):
                out[moving.index(entry[0]), entry[1] + k, entry[3] + k] = 1.0
    return out


def _numbers(entries: Sequence[tuple[Any, ...]]) -> tuple[Index, Index, Index, Index]:
    """Link, column, offset vector and varying input of each entry."""
    table = np.array([entry[:4] for entry in entries], dtype=np.intp).reshape(-1, 4)
    return table[:, 0], table[:, 1], table[:, 2], table[:, 3]


def _axes(entries: Sequence[tuple[Any, ...]]) -> Array:
    return np.array([entry[-1] for entry in entries], dtype=float).reshape(-1, 3)


def _pairs(entries: list[tuple[int, int]]) -> Pairs:
    table = np.array(entries, dtype=np.intp).reshape(-1, 2)
    return Pairs(table[:, 0], table[:, 1])
