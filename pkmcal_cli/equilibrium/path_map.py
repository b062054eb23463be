"""How the strains of paths of links depend on the unknowns: what couples the links of a rope in the tangent.

The strain e of a path is a sum over its links, so its stiffness S adds S g g^T to the tangent, and its constraint the
row g^T, with g = de/du of the whole: the sum of what the links contribute to each of the path's unknowns.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.base.sparse_map import Block, Entries, SparseMap, Stack, pick
from pkmcal_cli.equilibrium.links import LinkMap
from pkmcal_cli.mechanism.topology import Group, Index


@dataclass(frozen=True)
class PathMap:
    """Unknowns of the E paths of a group, and the map from their links' gradients to theirs."""

    unknowns: Index  # (E, L) global unknowns, -1 padded
    moving: Index  # (M,) links with varying inputs
    own: Block  # (K, I) gradients of links
    varying: Block  # (M, X)
    out: Block  # (E, L)
    sums: SparseMap

    @classmethod
    def of(cls, group: Group, links: LinkMap, inputs: Index) -> PathMap:
        """The map of a group of paths; inputs (I,): those of the element that can be non-zero."""
        parts = [links.unknowns[group.path == e] for e in range(len(group.names))]
        lists = [np.unique(part[part >= 0]) for part in parts]
        unknowns = np.full((len(lists), max(len(own) for own in lists)), -1, dtype=np.intp)
        for e, own in enumerate(lists):
            unknowns[e, : len(own)] = own
        stack, entries, out = Stack(), Entries.none(), Block(0, unknowns.shape)
        own_block, varying = stack.block(len(links.unknowns), len(inputs)), stack.block(*links.shape)
        entry = np.full(links.unknowns.shape, -1, dtype=np.intp)  # (K, L) to entries of `out`
        for k, e in enumerate(group.owners):
            used = links.unknowns[k] >= 0
            entry[k, used] = out.numbers[e, np.searchsorted(lists[e], links.unknowns[k, used])]
        entries.add(entry[:, :, None], own_block.numbers[:, None], links.template)
        entries.add(entry[links.moving][:, :, None], varying.numbers[:, None], links.varying)
        return cls(unknowns, links.moving, own_block, varying, out, entries.build(out.stop, stack.stop))

    def gradients(self, links: Array, directions: Array) -> Array:
        """Gradients of the paths' strains (N, E, L) from those of links (N, K, I), directions (N, M, X, d)."""
        stacked = np.empty((self.sums.columns, len(links)), dtype=links.dtype)
        self.own.of(stacked)[...] = links
        along = pick(links, self.moving)[..., : directions.shape[-1]]
        np.einsum("nmxd,nmd->nmx", directions, along, out=self.varying.of(stacked))
        return self.out.of(self.sums(stacked))
