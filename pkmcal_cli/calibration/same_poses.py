"""Which rows are one pose's, and which are another's."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.prediction import Rows

_FEW = 500  # cells of which all pairs are looked at: usual tables do not import a search tree
_CELL = 0.25  # of what values of one pose may differ by: rows nearer than that are taken together at once
_CHAIN = 3.0  # times that: what merges to a group as wide is no pose but a scan of many
_FINER = 3  # times that a finer scan is looked at ten times as closely


def loads_of(rows: Rows) -> list[Array]:
    """What loads the machine from row to row: columns (N,) of forces of drives, and the payload."""
    return [*np.nan_to_num(rows.forces).T, np.nan_to_num(rows.columns.get("payload", np.zeros(len(rows))))]


def poses_alike(table: Array, share: float) -> NDArray[np.intp]:
    """Number (N,) of the pose of each row (N, k), in order of first appearance.

    Values of one pose differ by less than this share of their column's spread; in a scan so fine that poses merge, by
    less than a tenth of it, and so on.
    """
    varied = table[:, (table != table[:1]).any(axis=0)]  # what is equal in all rows tells none apart
    if not varied.size:
        return np.zeros(len(table), dtype=np.intp)
    return _by_appearance(_merged((varied - varied.min(axis=0)) / (share * np.ptp(varied, axis=0)), _FINER))


def _merged(scaled: Array, finer: int) -> NDArray[np.intp]:
    """Labels (N,) of rows (N, k) that lie within 1 of each other, or of others in between."""
    cells, cell = np.unique(np.round(scaled / _CELL), axis=0, return_inverse=True)
    label = _connected(_pairs(cells, 1.0 / _CELL), len(cells))[cell.ravel()]
    low, high = (np.full((label.max() + 1, scaled.shape[1]), s * np.inf) for s in (1, -1))
    np.minimum.at(low, label, scaled)
    np.maximum.at(high, label, scaled)
    chained = (np.max(high - low, axis=1) > _CHAIN)[label]
    if chained.any():
        distance = 10.0 * scaled[chained]
        subclusters = (
            _merged(distance, finer - 1) if finer else np.unique(distance, axis=0, return_inverse=True)[1].ravel()
        )
        label[chained] = label.max() + 1 + subclusters
    return label


def _pairs(points: Array, distance: float) -> NDArray[np.intp]:
    """Pairs (K, 2) of points (N, k) whose coordinates all differ by no more than this."""
    if len(points) <= _FEW:
        alike = (np.abs(points[:, None] - points) <= distance).all(axis=2)
        return np.argwhere(np.triu(alike, 1))
    from scipy.spatial import cKDTree

    return np.asarray(cKDTree(points).query_pairs(distance, p=np.inf, output_type="ndarray"))


def _connected(pairs: NDArray[np.intp], count: int) -> NDArray[np.intp]:
    """Labels (N,) of so many points that pairs (K, 2) connect, directly or through others."""
    if not len(pairs):
        return np.arange(count)
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    return np.asarray(connected_components(links, directed=False)[1], dtype=np.intp)


def _by_appearance(label: NDArray[np.intp]) -> NDArray[np.intp]:
    _, first, inverse = np.unique(label, return_index=True, return_inverse=True)
    order = np.empty(len(first), dtype=np.intp)
    order[np.argsort(first)] = np.arange(len(first))
    return np.asarray(order[inverse.ravel()])
