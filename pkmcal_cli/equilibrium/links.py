"""How links depend on unknowns: a constant part, and directions that turn with the state.

A link's inputs are delta (the vector from port i to port j) and the increments theta_i, theta_j of the ports'
rotations. Where the dependence is constant (a node moved along base axes, a port on a free rotation) it is a template.
An arm that turns moves delta in a direction that varies with the state; the three, or one, unknowns of its rotation,
or the travel along it, are the link's *varying* inputs, X of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from pkmcal_cli.base.rotation import Array, skew
from pkmcal_cli.base.sparse_map import Block, Entries, SparseMap
from pkmcal_cli.mechanism.topology import Index, Layout, Turn

_WIDTH = {Turn.FIXED: 0, Turn.FREE: 3, Turn.AXIS: 1}


class Turning(NamedTuple):
    """Arms on rotations with three unknowns: link, first local unknown, arm; first varying input; each (F,)."""

    link: Index
    column: Index
    arm: Index
    varying: Index


class Hinged(NamedTuple):
    """Arms on rotations about a fixed axis (F, 3), else as Turning."""

    link: Index
    column: Index
    arm: Index
    varying: Index
    axis: Array


class Sliding(NamedTuple):
    """Travels along an axis (F, 3) of a rotation that is not the base, else as Turning."""

    link: Index
    column: Index
    arm: Index
    varying: Index
    axis: Array


class Pairs(NamedTuple):
    """Travels along arms that turn: number among the Sliding, and of the arm's rotation among Turning or Hinged."""

    sliding: Index
    turning: Index


@dataclass(frozen=True, kw_only=True)
class LinkMap:
    """Local unknowns of the E links of a group and how the inputs depend on them."""

    layout: Layout
    links: slice
    unknowns: Index  # (E, L) global unknowns, -1 padded
    template: Array  # (E, L, I) constant part of the transposed input Jacobian
    moving: Index  # (M,) links with varying inputs
    varying: Array  # (M, L, X) which local unknown each varying input is
    turning: Turning
    hinged: Hinged
    sliding: Sliding
    sliding_turning: Pairs
    sliding_hinged: Pairs

    @property
    def shape(self) -> tuple[int, int]:
        """Number of links that have varying inputs, and how many they have."""
        return len(self.moving), self.varying.shape[2]

    @cached_property
    def directions(self) -> SparseMap:
        """Map from rotations and arms to the varying directions (M, X, 3)."""
        block, entries = Block(0, (*self.shape, 3)), Entries.none()
        self.add_directions(block, entries)
        return entries.build(block.stop, self.layout.moved)

    def add_directions(self, block: Block, entries: Entries) -> None:
        """Entries of `directions` for a block of that shape."""
        rotations, arms = self.layout.moved_blocks
        number, axes = block.numbers, np.arange(3)
        row = np.searchsorted(self.moving, self.turning.link)
        for k, unit in enumerate(np.eye(3)):  # unit x arm
            target = number[row, self.turning.varying + k]
            entries.add(target[:, :, None], arms.numbers[self.turning.arm][:, None, :], skew(unit))
        row = np.searchsorted(self.moving, self.hinged.link)
        target = number[row, self.hinged.varying]
        entries.add(target[:, :, None], arms.numbers[self.hinged.arm][:, None, :], skew(self.hinged.axis))
        row = np.searchsorted(self.moving, self.sliding.link)
        target = number[row, self.sliding.varying]
        carrier = self.layout.arms.rotation[self.sliding.arm]
        source = rotations.numbers[carrier[:, None, None], axes[:, None], axes]
        entries.add(target[:, :, None], source, self.sliding.axis[:, None, :])


@dataclass(kw_only=True)
class _Collector:
    """Entries collected link by link."""

    layout: Layout
    place: Index
    local: list[list[int]] = field(default_factory=list)
    fixed: list[tuple[int, int, Array]] = field(default_factory=list)  # link, column, direction
    turning: list[tuple[int, int, int, int]] = field(default_factory=list)
    hinged: list[tuple[int, int, int, int, Array]] = field(default_factory=list)
    sliding: list[tuple[int, int, int, int, Array]] = field(default_factory=list)
    sliding_turning: list[tuple[int, int]] = field(default_factory=list)
    sliding_hinged: list[tuple[int, int]] = field(default_factory=list)
    width: int = 0

    def add_link(self, e: int, link: int, ports: list[int]) -> None:
        """Local unknowns of one link and the arms by which they move it."""
        arms, rotations, first = self.layout.arms, self.layout.rotations, self.layout.rotation_dofs
        mine = [int(a) for a in np.nonzero(arms.link == link)[0]]
        local: list[int] = []
        for r in [int(arms.rotation[a]) for a in mine] + ports:
            dofs = np.arange(first[r], first[r] + _WIDTH[Turn(rotations.kind[r])])
            if len(dofs) and first[r] not in local and (self.place[dofs] >= 0).any():
                local += dofs.tolist()
        used = 0
        for a in mine:
            turns = int(first[arms.rotation[a]]) in local
            used = self._add_rotation(e, a, local, used) if turns else used
            used = self._add_travels(e, a, local, used, turns)
        self.local.append(local)
        self.width = max(self.width, used)

    def _add_rotation(self, e: int, a: int, local: list[int], used: int) -> int:
        r = int(self.layout.arms.rotation[a])
        column = local.index(int(self.layout.rotation_dofs[r]))
        if self.layout.rotations.kind[r] == Turn.FREE:
            self.turning.append((e, column, a, used))
            return used + 3
        self.hinged.append((e, column, a, used, self.layout.rotations.axis[r]))
        return used + 1

    def _add_travels(self, e: int, a: int, local: list[int], used: int, turns: bool) -> int:
        rotations, r = self.layout.rotations, int(self.layout.arms.rotation[a])
        axes = self.layout.arms.travel[:, 3 * a : 3 * a + 3]
        for t in np.nonzero((axes != 0).any(1) & (self.place[: len(axes)] >= 0))[0]:
            local.append(int(t))
            if rotations.kind[r] == Turn.FIXED and rotations.slots[r, 0] < 0:
                self.fixed.append((e, len(local) - 1, rotations.drawn[r] @ axes[t]))
                continue
            if turns and rotations.kind[r] == Turn.FREE:
                self.sliding_turning.append((len(self.sliding), len(self.turning) - 1))
            elif turns:
                self.sliding_hinged.append((len(self.sliding), len(self.hinged) - 1))
            self.sliding.append((e, len(local) - 1, a, used, axes[t]))
            used += 1
        return used


def build_links(layout: Layout, links: slice, ports: Index | None, place: Index) -> LinkMap:
    """The map of a range of links; `ports` (2, E): rotations of the end triads, None where they do not matter."""
    found = _Collector(layout=layout, place=place)
    for e, link in enumerate(range(links.start, links.stop)):
        found.add_link(e, link, [] if ports is None else [int(r) for r in ports[:, e]])
    width = max((len(local) for local in found.local), default=0)
    unknowns = np.full((len(found.local), width), -1, dtype=np.intp)
    for e, local in enumerate(found.local):
        unknowns[e, : len(local)] = place[local]
    moving = sorted({int(entry[0]) for entry in (*found.turning, *found.hinged, *found.sliding)})
    return LinkMap(
        layout=layout,
        links=links,
        unknowns=unknowns,
        template=_template(found, ports, width),
        moving=np.array(moving, dtype=np.intp),
        varying=_varying(found, moving, width),
        turning=Turning(*_numbers(found.turning)),
        hinged=Hinged(*_numbers(found.hinged), _axes(found.hinged)),
        sliding=Sliding(*_numbers(found.sliding), _axes(found.sliding)),
        sliding_turning=_pairs(found.sliding_turning),
        sliding_hinged=_pairs(found.sliding_hinged),
    )


def _template(found: _Collector, ports: Index | None, width: int) -> Array:
    """Constant inputs (E, L, I): fixed directions of travels; port rotations, identity or the axis."""
    layout, out = found.layout, np.zeros((len(found.local), width, 9))
    for e, column, direction in found.fixed:
        out[e, column, :3] = direction
    for side, offset in ((0, 3), (1, 6)) if ports is not None else ():
        for e, dofs in enumerate(found.local):
            r = int(ports[side, e]) if ports is not None else 0
            start = layout.rotation_dofs[r]
            if start in dofs:
                column = dofs.index(start)
                free = layout.rotations.kind[r] == Turn.FREE
                axes = np.eye(3) if free else layout.rotations.axis[r][None]
                out[e, column : column + len(axes), offset : offset + 3] = axes
    inputs = layout.inputs[: 2 if layout.planar else 3] if ports is None else layout.inputs
    return np.ascontiguousarray(out[:, :, inputs])


def _varying(found: _Collector, moving: list[int], width: int) -> Array:
    out = np.zeros((len(moving), width, found.width))
    for entries, count in ((found.turning, 3), (found.hinged, 1), (found.sliding, 1)):
        for entry in entries:
            for k in range(count):
                out[moving.index(entry[0]), entry[1] + k, entry[3] + k] = 1.0
    return out


def _numbers(entries: Sequence[tuple[Any, ...]]) -> tuple[Index, Index, Index, Index]:
    """Link, column, arm and varying input of each entry."""
    table = np.array([entry[:4] for entry in entries], dtype=np.intp).reshape(-1, 4)
    return table[:, 0], table[:, 1], table[:, 2], table[:, 3]


def _axes(entries: Sequence[tuple[Any, ...]]) -> Array:
    return np.array([entry[-1] for entry in entries], dtype=float).reshape(-1, 3)


def _pairs(entries: list[tuple[int, int]]) -> Pairs:
    table = np.array(entries, dtype=np.intp).reshape(-1, 2)
    return Pairs(table[:, 0], table[:, 1])
