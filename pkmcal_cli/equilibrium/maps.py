"""Constant maps of a system: from rotations to triads and links, from elements to residual and tangent.

Assembly is linear: g = sum H^T g_e and K = sum H^T K_e H, where H (inputs of an element by unknowns) is mostly zeros
and ones that never change (Ecorchard 2010, eq. 6: K_g = T^T K T, summed over nodes). So H is multiplied out once, into
sparse maps over the stacked arrays of all groups, the row index last: one product moves everything for all rows. In
the tangent the derivatives with respect to the inputs (I) of a link and to its varying inputs (X) are separate blocks;
so are the second derivatives of rotating offset vectors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.base.sparse_map import Block, Entries, SparseMap, Stack
from pkmcal_cli.equilibrium.fronts import FrontLayout
from pkmcal_cli.equilibrium.group_map import GroupMap
from pkmcal_cli.equilibrium.path_map import PathMap
from pkmcal_cli.mechanism.topology import Index, Topology


@dataclass(frozen=True)
class GeometryBlocks:
    """One group's triads, links and varying directions in a stacked array; E links, M of them with X varying inputs."""

    ti: Block  # (E, 3, 3), empty where the element ignores triads
    tj: Block
    delta: Block  # (E, 3)
    directions: Block  # (M, X, 3)


@dataclass(frozen=True)
class GeometryMaps:
    """From rotations and offset vectors to what the elements of all groups see."""

    groups: tuple[GeometryBlocks, ...]
    geometries: SparseMap

    @classmethod
    def of(cls, topology: Topology, groups: Sequence[GroupMap]) -> GeometryMaps:
        """The map of a system with these groups."""
        stack, entries, blocks = Stack(), Entries.none(), []
        for group in groups:
            count, shape = len(group.map.unknowns), group.map.shape
            triads = count if group.group.element.uses_triads else 0
            parts = [stack.block(*s) for s in ((triads, 3, 3), (triads, 3, 3), (count, 3), (*shape, 3))]
            blocks.append(GeometryBlocks(*parts))
            _add_geometries(topology, group, blocks[-1], entries)
        return cls(tuple(blocks), entries.build(stack.stop, topology.moved))


def _add_geometries(topology: Topology, group: GroupMap, blocks: GeometryBlocks, entries: Entries) -> None:
    (rotations, offset_vectors), spec = topology.moved_blocks, group.group
    if spec.element.uses_triads:
        for block, connections, triads in zip((blocks.ti, blocks.tj), spec.rotation, spec.triads, strict=True):
            source = rotations.numbers[connections][:, :, None, :]  # t = R triad: (E, i, k, j), j summed over
            entries.add(block.numbers[..., None], source, np.swapaxes(triads, 1, 2)[:, None])
    links = np.arange(spec.links.start, spec.links.stop)
    used = np.nonzero(np.isin(topology.offset_vectors.link, links))[0]
    target = blocks.delta.numbers[topology.offset_vectors.link[used] - spec.links.start]
    entries.add(target, offset_vectors.numbers[used], 1.0)
    group.map.add_directions(blocks.directions, entries)


@dataclass(frozen=True, kw_only=True)
class Blocks:
    """One group's parts of the stacked arrays; K links, M of them with X varying inputs, R constraints; E paths."""

    force: Block  # forces: (K, I)
    varying_force: Block  # (M, X)
    own: Block  # tangents: (K, I, I), empty where the element has no stiffness and no curvature
    left: Block  # (M, X, I)
    right: Block  # (M, I, X)
    both: Block  # (M, X, X)
    rotating: Block  # (F, 3, 3) second derivatives of offset vectors, by what moves them
    hinged: Block  # (F,)
    sliding_rotating: Block  # (F, 3)
    sliding_hinged: Block  # (F,)
    rigid: Block  # (R, I), of paths (R, L)
    varying_rigid: Block  # (R, X), of paths none
    paths: Block  # (E, L, L), of paths that yield


@dataclass(frozen=True, kw_only=True)
class Maps:
    """Sparse maps of a system and the blocks between which they go."""

    groups: tuple[Blocks, ...]
    residual: SparseMap  # forces -> unknowns (n)
    tangent: SparseMap  # tangents -> non-zero entries of the matrix
    filled: Index  # (entries,) places of these among all entries: of `fronts`, or the matrix column by column
    width: int  # all entries
    fronts: FrontLayout | None  # None: the matrix is solved as one
    offset_vector_coefficients: SparseMap  # forces on offset vectors (A, 3) -> coefficients that set the vectors


class MapsBuilder:
    """Collects the entries of all groups."""

    def __init__(self, topology: Topology, unknown_of: Index, constraints: int) -> None:
        self.topology, self.unknown_of, self.unknowns = topology, unknown_of, int((unknown_of >= 0).sum())
        self.size = self.unknowns + constraints
        self.forces, self.tangents = Stack(), Stack()
        self.residual, self.tangent = Entries.none(), Entries.none()

    def build(self, groups: Sequence[GroupMap]) -> Maps:
        """The maps of a system with these groups."""
        blocks = tuple(self._blocks(group) for group in groups)
        for group, own in zip(groups, blocks, strict=True):
            self._add_forces(group, own)
            self._add_tangents(group, own)
            self._add_offset_vectors(group, own)
            if group.paths is None:
                self._add_constraints(group, own)
            else:
                self._add_paths(group, group.paths, own)
        full = self.tangent.build(self.size**2, self.tangents.stop)
        filled, inverse = np.unique(full.target, return_inverse=True)
        column, row = np.divmod(filled, self.size) if self.size else (filled, filled)
        fronts = FrontLayout.of(row, column, self.size, self.unknowns)
        return Maps(
            groups=blocks,
            residual=self.residual.build(self.unknowns, self.forces.stop),
            tangent=SparseMap(len(filled), full.columns, inverse, full.source, full.factor),
            filled=filled if fronts is None else fronts.places(row, column),
            width=self.size**2 if fronts is None else fronts.width,
            fronts=fronts,
            offset_vector_coefficients=self._offset_vector_coefficients(),
        )

    def _offset_vector_coefficients(self) -> SparseMap:
        topology, entries = self.topology, Entries.none()
        offsets, translations = topology.offset_map, topology.translation_map
        entries.add(offsets.source, offsets.target, offsets.factor)
        held = self.unknown_of[: len(topology.translation_coefficients)] < 0
        coefficients = np.where(held, topology.translation_coefficients, -1)
        entries.add(coefficients[translations.source], translations.target, translations.factor)
        return entries.build(offsets.columns, offsets.height)

    def _blocks(self, group: GroupMap) -> Blocks:
        forces, tangents = self.forces, self.tangents
        links, element = group.map, group.group.element
        e, (m, x), i = len(links.unknowns), links.shape, len(group.inputs)
        paths = group.paths
        count, length = (0, 0) if paths is None else paths.unknowns.shape
        acts = element.curved or (group.yields and paths is None)
        r = len(group.rigid[0])
        return Blocks(
            force=forces.block(e, i),
            varying_force=forces.block(m, x),
            own=tangents.block(e if acts else 0, i, i),
            left=tangents.block(m if acts else 0, x, i),
            right=tangents.block(m if acts else 0, i, x),
            both=tangents.block(m if acts else 0, x, x),
            rotating=tangents.block(len(links.rotating.link), 3, 3),
            hinged=tangents.block(len(links.hinged.link)),
            sliding_rotating=tangents.block(len(links.sliding_rotating.sliding), 3),
            sliding_hinged=tangents.block(len(links.sliding_hinged.sliding)),
            rigid=tangents.block(r, i if paths is None else length),
            varying_rigid=tangents.block(r if paths is None else 0, x),
            paths=tangents.block(count if group.yields else 0, length, length),
        )

    def _add_forces(self, group: GroupMap, blocks: Blocks) -> None:
        links = group.map
        self.residual.add(links.unknowns[:, :, None], blocks.force.numbers[:, None], links.template)
        where = links.unknowns[links.moving]
        self.residual.add(where[:, :, None], blocks.varying_force.numbers[:, None], links.varying)

    def _add_tangents(self, group: GroupMap, blocks: Blocks) -> None:
        links = group.map
        if len(blocks.own.numbers) == 0:
            return
        where, template = links.unknowns[links.moving], links.template[links.moving]
        self._add_product(blocks.own, links.unknowns, links.template, links.template)
        self._add_product(blocks.left, where, links.varying, template)
        self._add_product(blocks.right, where, template, links.varying)
        self._add_product(blocks.both, where, links.varying, links.varying)

    def _add_product(self, block: Block, unknowns: Index, rows: Array, columns: Array) -> None:
        """rows (E, L, a) block (E, a, b) columns^T (E, L, b), at the unknowns (E, L)."""
        factor = rows[:, :, None, :, None] * columns[:, None, :, None, :]
        target = self._flat(unknowns[:, :, None], unknowns[:, None, :])
        self.tangent.add(target[..., None, None], block.numbers[:, None, None], factor)

    def _flat(self, row: Index, column: Index) -> Index:
        """Place in the matrix flattened column by column, -1 where the row or the column is prescribed."""
        return np.where((row >= 0) & (column >= 0), column * self.size + row, -1)

    def _add_offset_vectors(self, group: GroupMap, blocks: Blocks) -> None:
        links, axes = group.map, np.arange(3)
        rotating = links.unknowns[links.rotating.link[:, None], links.rotating.column[:, None] + axes]
        self._add_at(blocks.rotating, rotating[:, :, None], rotating[:, None, :])
        hinged = links.unknowns[links.hinged.link, links.hinged.column]
        self._add_at(blocks.hinged, hinged, hinged)
        sliding = links.unknowns[links.sliding.link, links.sliding.column]
        for block, pairs, about_columns in (
            (blocks.sliding_rotating, links.sliding_rotating, rotating),
            (blocks.sliding_hinged, links.sliding_hinged, hinged),
        ):
            along, about = sliding[pairs.sliding], about_columns[pairs.rotating]
            along = along.reshape(along.shape + (1,) * (about.ndim - 1))
            self._add_at(block, along, about)
            self._add_at(block, about, along)

    def _add_at(self, block: Block, row: Index, column: Index) -> None:
        self.tangent.add(self._flat(row, column), block.numbers, 1.0)

    def _add_constraints(self, group: GroupMap, blocks: Blocks) -> None:
        """Rows and columns of the multipliers."""
        links, element = group.map, group.rigid[0]
        constraint = (self.unknowns + np.arange(group.rows.start, group.rows.stop))[:, None]
        varying = np.zeros((len(links.unknowns), *links.varying.shape[1:]))
        varying[links.moving] = links.varying
        for block, inputs in ((blocks.rigid, links.template), (blocks.varying_rigid, varying)):
            unknowns = links.unknowns[element]
            for target in (self._flat(constraint, unknowns), self._flat(unknowns, constraint)):
                self.tangent.add(target[:, :, None], block.numbers[:, None], inputs[element])

    def _add_paths(self, group: GroupMap, paths: PathMap, blocks: Blocks) -> None:
        """Stiffness of paths, rows and columns of the multipliers of rigid ones."""
        if group.yields:
            target = self._flat(paths.unknowns[:, :, None], paths.unknowns[:, None, :])
            self.tangent.add(target, blocks.paths.numbers, 1.0)
        constraint = (self.unknowns + np.arange(group.rows.start, group.rows.stop))[:, None]
        unknowns = paths.unknowns[group.rigid[0]]
        for target in (self._flat(constraint, unknowns), self._flat(unknowns, constraint)):
            self.tangent.add(target, blocks.rigid.numbers, 1.0)


@dataclass(frozen=True)
class StrainMaps:
    """From the gradients of strains to their Jacobian with respect to the unknowns."""

    groups: dict[int, tuple[Block, Block]]  # by group: inputs (K, m, inputs) and varying inputs (M, m, X)
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
            links = len(group.map.unknowns)
            blocks[index] = own, varying = stack.block(links, shape[1], width), stack.block(m, shape[1], x)
            number = np.where(acting, count + np.cumsum(acting).reshape(shape) - 1, -1)[group.group.owners]
            count += int(acting.sum())
            where, rows = group.map.unknowns, group.map.moving
            own_inputs = own.numbers[..., group.inputs]
            for unknown, strain, source, factor in (
                (where, number, own_inputs, group.map.template),
                (where[rows], number[rows], varying.numbers, group.map.varying),
            ):  # (E, m, L, inputs)
                used = (unknown[:, None] >= 0) & (strain[:, :, None] >= 0)
                flat = np.where(used, strain[:, :, None] * unknowns + unknown[:, None], -1)
                entries.add(flat[..., None], source[:, :, None], factor[:, None])
        full = entries.build(count * unknowns, stack.stop)
        filled, inverse = np.unique(full.target, return_inverse=True)
        return cls(blocks, count, SparseMap(len(filled), stack.stop, inverse, full.source, full.factor), filled)
