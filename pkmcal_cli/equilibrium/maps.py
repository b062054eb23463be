"""Constant maps of a system: triads and links out of rotations and arms; residual and tangent out of elements.

The elements' arrays of all groups lie in stacked arrays, the row index last, so that one sparse product moves all of
them. Each group has its blocks there. In the tangent the derivative with respect to the inputs (I) of a link and to
its varying inputs (X) are separate blocks; so are the second derivatives of turning arms.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.base.sparse_map import Block, Entries, SparseMap, Stack
from pkmcal_cli.equilibrium.group_map import GroupMap
from pkmcal_cli.mechanism.topology import Index, Layout


@dataclass(frozen=True)
class ViewBlocks:
    """One group's triads, links and varying directions in a stacked array; E links, M of them with X varying inputs."""

    ti: Block  # (E, 3, 3), empty where the element ignores triads
    tj: Block
    delta: Block  # (E, 3)
    directions: Block  # (M, X, 3)


@dataclass(frozen=True)
class ViewMaps:
    """From rotations and arms to what the elements of all groups see."""

    groups: tuple[ViewBlocks, ...]
    views: SparseMap

    @classmethod
    def of(cls, layout: Layout, groups: Sequence[GroupMap]) -> ViewMaps:
        """The map of a system with these groups."""
        stack, entries, blocks = Stack(), Entries.none(), []
        for group in groups:
            count, shape = len(group.map.unknowns), group.map.shape
            triads = count if group.group.element.uses_triads else 0
            parts = [stack.block(*s) for s in ((triads, 3, 3), (triads, 3, 3), (count, 3), (*shape, 3))]
            blocks.append(ViewBlocks(*parts))
            _add_views(layout, group, blocks[-1], entries)
        return cls(tuple(blocks), entries.build(stack.stop, layout.moved))


def _add_views(layout: Layout, group: GroupMap, mine: ViewBlocks, entries: Entries) -> None:
    (rotations, arms), spec = layout.moved_blocks, group.group
    if spec.element.uses_triads:
        for block, ports, triads in zip((mine.ti, mine.tj), spec.rotation, spec.triads, strict=True):
            source = rotations.numbers[ports][:, :, None, :]  # t = R triad: (E, i, k, j), j summed over
            entries.add(block.numbers[..., None], source, np.swapaxes(triads, 1, 2)[:, None])
    links = np.arange(spec.links.start, spec.links.stop)
    used = np.nonzero(np.isin(layout.arms.link, links))[0]
    target = mine.delta.numbers[layout.arms.link[used] - spec.links.start]
    entries.add(target, arms.numbers[used], 1.0)
    group.map.add_directions(mine.directions, entries)


@dataclass(frozen=True, kw_only=True)
class Blocks:
    """One group's parts of the stacked arrays; E links, M of them with X varying inputs, R constraints."""

    force: Block  # forces: (E, I)
    varying_force: Block  # (M, X)
    own: Block  # tangents: (E, I, I), empty where the element has no stiffness and no curvature
    left: Block  # (M, X, I)
    right: Block  # (M, I, X)
    both: Block  # (M, X, X)
    turning: Block  # (F, 3, 3) second derivatives of arms, by what moves them
    hinged: Block  # (F,)
    sliding_turning: Block  # (F, 3)
    sliding_hinged: Block  # (F,)
    rigid: Block  # (R, I)
    varying_rigid: Block  # (R, X)


@dataclass(frozen=True)
class Maps:
    """Sparse maps of a system and the blocks between which they go."""

    groups: tuple[Blocks, ...]
    residual: SparseMap  # forces -> unknowns (n)
    tangent: SparseMap  # tangents -> non-zero entries of the matrix
    filled: Index  # (entries,) places of these in the matrix, flattened column by column
    arm_slots: SparseMap  # forces on arms (A, 3) in the arms' triads -> slots: offsets, prescribed travels


class MapsBuilder:
    """Collects the entries of all groups."""

    def __init__(self, layout: Layout, place: Index, constraints: int) -> None:
        self.layout, self.place, self.unknowns = layout, place, int((place >= 0).sum())
        self.size = self.unknowns + constraints
        self.forces, self.tangents = Stack(), Stack()
        self.residual, self.tangent = Entries.none(), Entries.none()

    def build(self, groups: Sequence[GroupMap]) -> Maps:
        """The maps of a system with these groups."""
        blocks = tuple(self._blocks(group) for group in groups)
        for group, mine in zip(groups, blocks, strict=True):
            self._add_forces(group, mine)
            self._add_tangents(group, mine)
            self._add_arms(group, mine)
            self._add_constraints(group, mine)
        full = self.tangent.build(self.size**2, self.tangents.stop)
        filled, place = np.unique(full.target, return_inverse=True)
        tangent = SparseMap(len(filled), full.columns, place, full.source, full.coefficient)
        return Maps(
            blocks,
            self.residual.build(self.unknowns, self.forces.stop),
            tangent,
            filled,
            self._arm_slots(),
        )

    def _arm_slots(self) -> SparseMap:
        layout, entries = self.layout, Entries.none()
        offsets, travels = layout.offset_map, layout.travel_map
        entries.add(offsets.source, offsets.target, offsets.coefficient)
        held = self.place[: len(layout.travel_slots)] < 0
        slots = np.where(held, layout.travel_slots, -1)
        entries.add(slots[travels.source], travels.target, travels.coefficient)
        return entries.build(offsets.columns, offsets.height)

    def _blocks(self, group: GroupMap) -> Blocks:
        forces, tangents = self.forces, self.tangents
        links, element = group.map, group.group.element
        e, (m, x), i = len(links.unknowns), links.shape, len(group.inputs)
        acts = group.yields or element.curved
        r = len(group.rigid[0])
        return Blocks(
            force=forces.block(e, i),
            varying_force=forces.block(m, x),
            own=tangents.block(e if acts else 0, i, i),
            left=tangents.block(m if acts else 0, x, i),
            right=tangents.block(m if acts else 0, i, x),
            both=tangents.block(m if acts else 0, x, x),
            turning=tangents.block(len(links.turning.link), 3, 3),
            hinged=tangents.block(len(links.hinged.link)),
            sliding_turning=tangents.block(len(links.sliding_turning.sliding), 3),
            sliding_hinged=tangents.block(len(links.sliding_hinged.sliding)),
            rigid=tangents.block(r, i),
            varying_rigid=tangents.block(r, x),
        )

    def _add_forces(self, group: GroupMap, mine: Blocks) -> None:
        links = group.map
        self.residual.add(links.unknowns[:, :, None], mine.force.numbers[:, None], links.template)
        where = links.unknowns[links.moving]
        self.residual.add(where[:, :, None], mine.varying_force.numbers[:, None], links.varying)

    def _add_tangents(self, group: GroupMap, mine: Blocks) -> None:
        links = group.map
        if len(mine.own.numbers) == 0:
            return
        where, template = links.unknowns[links.moving], links.template[links.moving]
        self._add_product(mine.own, links.unknowns, links.template, links.template)
        self._add_product(mine.left, where, links.varying, template)
        self._add_product(mine.right, where, template, links.varying)
        self._add_product(mine.both, where, links.varying, links.varying)

    def _add_product(self, block: Block, unknowns: Index, rows: Array, columns: Array) -> None:
        """rows (E, L, a) block (E, a, b) columns^T (E, L, b), at the unknowns (E, L)."""
        factor = rows[:, :, None, :, None] * columns[:, None, :, None, :]
        target = self._flat(unknowns[:, :, None], unknowns[:, None, :])
        self.tangent.add(target[..., None, None], block.numbers[:, None, None], factor)

    def _flat(self, row: Index, column: Index) -> Index:
        """Place in the matrix flattened column by column, -1 where the row or the column is prescribed."""
        return np.where((row >= 0) & (column >= 0), column * self.size + row, -1)

    def _add_arms(self, group: GroupMap, mine: Blocks) -> None:
        links, axes = group.map, np.arange(3)
        turning = links.unknowns[links.turning.link[:, None], links.turning.column[:, None] + axes]
        self._add_at(mine.turning, turning[:, :, None], turning[:, None, :])
        hinged = links.unknowns[links.hinged.link, links.hinged.column]
        self._add_at(mine.hinged, hinged, hinged)
        sliding = links.unknowns[links.sliding.link, links.sliding.column]
        for block, pairs, turns in (
            (mine.sliding_turning, links.sliding_turning, turning),
            (mine.sliding_hinged, links.sliding_hinged, hinged),
        ):
            along, about = sliding[pairs.sliding], turns[pairs.turning]
            along = along.reshape(along.shape + (1,) * (about.ndim - 1))
            self._add_at(block, along, about)
            self._add_at(block, about, along)

    def _add_at(self, block: Block, row: Index, column: Index) -> None:
        self.tangent.add(self._flat(row, column), block.numbers, 1.0)

    def _add_constraints(self, group: GroupMap, mine: Blocks) -> None:
        """Rows and columns of the multipliers."""
        links, element = group.map, group.rigid[0]
        constraint = (self.unknowns + np.arange(group.rows.start, group.rows.stop))[:, None]
        varying = np.zeros((len(links.unknowns), *links.varying.shape[1:]))
        varying[links.moving] = links.varying
        for block, inputs in ((mine.rigid, links.template), (mine.varying_rigid, varying)):
            unknowns = links.unknowns[element]
            for target in (self._flat(constraint, unknowns), self._flat(unknowns, constraint)):
                self.tangent.add(target[:, :, None], block.numbers[:, None], inputs[element])


@dataclass(frozen=True)
class StrainMaps:
    """From the gradients of strains to their Jacobian with respect to the unknowns."""

    groups: dict[int, tuple[Block, Block]]  # by group: inputs (E, m, inputs) and varying inputs (M, m, X)
    count: int  # strains that act
    jacobian: SparseMap  # gradients -> non-zero entries of the Jacobian
    filled: Index  # (entries,) flat places of these in (count, n)

    @classmethod
    def of(cls, groups: Sequence[GroupMap], unknowns: int) -> StrainMaps:
        """All strains that have a stiffness or are rigid, group by group."""
        stack, entries, blocks, count = Stack(), Entries.none(), {}, 0
        for index, group in enumerate(groups):
            acting = group.elastic > 0
            acting[group.rigid] = True
            if not acting.any():
                continue
            width, (m, x), shape = group.group.element.inputs, group.map.shape, group.group.shape
            blocks[index] = own, varying = stack.block(*shape, width), stack.block(m, shape[1], x)
            number = np.where(acting, count + np.cumsum(acting).reshape(shape) - 1, -1)
            count += int(acting.sum())
            where, rows = group.map.unknowns, group.map.moving
            mine = own.numbers[..., group.inputs]
            for place, strain, source, factor in (
                (where, number, mine, group.map.template),
                (where[rows], number[rows], varying.numbers, group.map.varying),
            ):  # (E, m, L, inputs)
                used = (place[:, None] >= 0) & (strain[:, :, None] >= 0)
                flat = np.where(used, strain[:, :, None] * unknowns + place[:, None], -1)
                entries.add(flat[..., None], source[:, :, None], factor[:, None])
        full = entries.build(count * unknowns, stack.stop)
        filled, place = np.unique(full.target, return_inverse=True)
        return cls(blocks, count, SparseMap(len(filled), stack.stop, place, full.source, full.coefficient), filled)
