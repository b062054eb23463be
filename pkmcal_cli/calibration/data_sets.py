"""What data sets say of the parameters that all of them have: equations without what belongs to one of them alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.loading.data_information import DataInformation

_RANK = 1e-9  # of the largest singular value
SEEN = 0.01
"""Per half range: what rows see less of is nothing that a set says."""


@dataclass(frozen=True, kw_only=True)
class DataSet:
    """What one data set says: matrix (r, q) and right (r,) in its noise, by the common parameters in `scale`.

    freedom: degrees of freedom by which its noise is known.
    """

    matrix: Array
    right: Array
    noise: float
    freedom: float


@dataclass(frozen=True, kw_only=True)
class Common:
    """Data sets in their common parameters: `names`, scale (q,) SI, offsets from `reference` (q,) SI."""

    names: tuple[str, ...]
    scale: Array
    reference: Array
    sets: tuple[DataSet, ...]

    @cached_property
    def matrix(self) -> Array:
        """All equations (m, q)."""
        return np.vstack([s.matrix for s in self.sets])

    @cached_property
    def right(self) -> Array:
        """Right-hand sides (m,) of all."""
        return np.concatenate([s.right for s in self.sets])

    @cached_property
    def set_of(self) -> NDArray[np.intp]:
        """Number (m,) of the set of each equation."""
        return np.repeat(np.arange(len(self.sets)), [len(s.right) for s in self.sets])


def common(
    data: Sequence[DataInformation], values: Sequence[dict[str, float]], per_campaign: Sequence[set[str]]
) -> Common:
    """Data sets in the parameters that all have; own: names that are each set's own, though others have them too."""
    apart = set().union(*per_campaign)
    names = tuple(n for n in data[0].names if n not in apart and all(n in d.names for d in data))
    scales = np.array([[d.scale[d.names.index(n)] for n in names] for d in data]).reshape(len(data), len(names))
    scale, reference = scales.max(axis=0), np.array([values[0][n] for n in names])
    sets = []
    for d, v in zip(data, values, strict=True):
        index = [d.names.index(n) for n in names]
        others = [k for k in range(len(d.names)) if k not in set(index)]
        shared = d.root[:, index] * (scale / d.scale[index])
        right = d.right + shared @ ((np.array([v[n] for n in names]) - reference) / scale)
        sets.append(_data_set(d, d.root[:, others], shared, right))
    return Common(names=names, scale=scale, reference=reference, sets=tuple(sets))


def _data_set(d: DataInformation, unshared: Array, shared: Array, right: Array) -> DataSet:
    """Equations without what is the set's own, in units of its noise."""
    if unshared.shape[1]:
        u, s, _ = np.linalg.svd(unshared)
        null_directions = u[:, int((s > _RANK * s.max(initial=0.0)).sum()) :]
        shared, right = null_directions.T @ shared, null_directions.T @ right
    gone = len(d.right) - len(right)
    u, s, vt = np.linalg.svd(shared)
    rank = int((s > max(SEEN, _RANK * s.max(initial=0.0))).sum())
    turned = u.T @ right
    left, freedom = d.left + float((turned[rank:] ** 2).sum()), max(d.count - gone - rank, 0)
    noise = 1.0 if np.isinf(d.worth) else (left + d.worth) / (freedom + d.worth)
    size = np.sqrt(noise)
    matrix = s[:rank, None] * vt[:rank] / size
    return DataSet(matrix=matrix, right=turned[:rank] / size, noise=noise, freedom=freedom + d.worth)
