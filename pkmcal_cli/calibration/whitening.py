"""Covariance of readings: rows by themselves, and rows that measurements join together.

Linearised at the drives' readings, the readings of rows that are joined have the covariance S_y + G S_q G^T, where G
(k C, k A) holds their derivatives by the drives of all k rows.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array

Index = NDArray[np.intp]


@dataclass(frozen=True)
class Clusters:
    """Rows in groups of equal size: M clusters of k rows each, (M, k)."""

    groups: tuple[Index, ...]

    @classmethod
    def of(cls, rows: int, partner: Index | None) -> Clusters:
        """Rows that partners (N,) join, -1 without, directly or through others."""
        if partner is None or not (partner >= 0).any():
            return cls((np.arange(rows)[:, None],))
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        joined = np.nonzero(partner >= 0)[0]
        links = coo_array((np.ones(len(joined)), (joined, partner[joined])), shape=(rows, rows))
        _, label = connected_components(links, directed=False)
        order = np.argsort(label, kind="stable")
        sizes = np.bincount(label)
        members = np.split(order, np.cumsum(sizes)[:-1])
        return cls(tuple(np.array([m for m in members if len(m) == k]) for k in np.unique(sizes)))

    def together(self, label: Index) -> Index:
        """Labels of rows (N,), those of rows that are joined made one; numbered from 0 in order of appearance."""
        label = label.copy()
        for cluster in self.groups:
            for members in cluster if cluster.shape[1] > 1 else ():
                label[np.isin(label, label[members])] = label[members[0]]
        _, first, number = np.unique(label, return_index=True, return_inverse=True)
        order = np.empty(len(first), dtype=np.intp)
        order[np.argsort(first)] = np.arange(len(first))
        return np.asarray(order[number.ravel()])


@dataclass(frozen=True)
class Slopes:
    """Derivatives of readings by drives: of the own row (N, C, A), of the row that it is joined to; that row (N,)."""

    own: Array
    partners: Array | None
    partner: Index | None

    def of(self, cluster: Index) -> Array:
        """G (M, k C, k A) of clusters (M, k)."""
        m, k = cluster.shape
        _, c, a = self.own.shape
        out = np.zeros((m, k, c, k, a))
        for i in range(k):
            out[:, i, :, i] = self.own[cluster[:, i]]
        if k > 1 and self.partners is not None and self.partner is not None:
            for i in range(k):
                for j in range(k):
                    joined = np.nonzero(self.partner[cluster[:, i]] == cluster[:, j])[0]
                    out[joined, i, :, j] += self.partners[cluster[joined, i]]
        return out.reshape(m, k * c, k * a)


@dataclass(frozen=True)
class Whitened:
    """Weights W (M, k C, k C) of clusters with W^T W = (S_y + G S_q G^T)^-1, G and the drives' part S_q G^T W^T."""

    cluster: Index
    weights: Array
    slopes: Array
    drives: Array

    def apply(self, x: Array) -> Array:
        """W x of an array (N, C, ...), as (M, k, C, ...)."""
        m, k = self.cluster.shape
        of_clusters = x[self.cluster]
        flat = of_clusters.reshape(m, k * x.shape[1], -1)
        return np.asarray((self.weights @ flat).reshape(m, k, *x.shape[1:]))


def whiten(
    clusters: Clusters,
    slopes: Slopes,
    noise: Array,
    drives: Array,
    measured: NDArray[np.bool_],
) -> Iterator[Whitened]:
    """Weights of all clusters: noise (N, C, C) of readings, uncertainty (N, A) of drives, what was measured (N, C)."""
    for cluster in clusters.groups:
        m, k = cluster.shape
        c = measured.shape[1]
        on = measured[cluster].reshape(m, k * c, 1)
        by_drive = np.where(on, slopes.of(cluster), 0.0)
        sigma = drives[cluster].reshape(m, 1, -1)
        spread = by_drive * sigma
        covariance = spread @ np.swapaxes(spread, 1, 2)
        for i in range(k):
            covariance[:, i * c : (i + 1) * c, i * c : (i + 1) * c] += noise[cluster[:, i]]
        weights = np.linalg.inv(np.linalg.cholesky(covariance)) * np.swapaxes(on, 1, 2)
        back = np.swapaxes(sigma, 1, 2) ** 2 * np.swapaxes(weights @ by_drive, 1, 2)
        yield Whitened(cluster, weights, by_drive, back)
