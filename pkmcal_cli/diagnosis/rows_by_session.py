"""Least squares by chosen rows, many choices at once, where each session has parameters of its own.

Such parameters have derivatives in the rows of their session alone, so they are eliminated session by session (Björck
1996, section 6.3): for K sessions this costs K small systems and one of the parameters that sessions share, instead of
one with them all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.lean import parts_of
from pkmcal_cli.base.rotation import Array

KNOWN = 0.25  # of half a range, by a prior of a whole one

Index = NDArray[np.intp]


@dataclass(frozen=True, kw_only=True)
class Steps:
    """Steps of the parameters for S choices, in half ranges, and what their uncertainties follow from.

    shared (S, a); local (S, K, b), of one session each; normal (S, a, a): of the shared ones, others eliminated;
    local_normal (S, K, b, b): of those of a session; ratio (S, K, b, a): by how much these give way to the shared ones.
    """

    shared: Array
    local: Array
    normal: Array
    local_normal: Array
    ratio: Array

    def determined(self) -> float:
        """How many parameters the rows of the first choice determine, those that the prior gives left out."""
        inverse, local = np.linalg.inv(self.normal[0]), np.linalg.inv(self.local_normal[0])
        by_prior = np.trace(inverse) + np.einsum("kbb->", local)
        by_prior += np.einsum("kba,ac,kbc->", self.ratio[0], inverse, self.ratio[0])
        return float(len(inverse) + local.shape[0] * local.shape[1] - KNOWN * by_prior)


@dataclass(frozen=True, kw_only=True)
class RowsBySession:
    """Whitened residuals (N, C), derivatives by shared (N, C, a) and local (N, C, b) parameters in half ranges.

    on (N, C): values that are measured; session (N,) of each row; offsets (a,) and local_offsets (K, b): from nominal,
    where the derivatives hold. Of a session with fewer than b parameters the others do nothing.
    """

    residual: Array
    shared: Array
    local: Array
    on: NDArray[np.bool_]
    session: Index
    offsets: Array
    local_offsets: Array

    @classmethod
    def of(
        cls, residual: Array, jacobian: Array, on: NDArray[np.bool_], session: Index, offsets: Array
    ) -> RowsBySession:
        """Find what is a session's own among derivatives (N, C, p): what acts in no row of another."""
        count = int(session.max(initial=0)) + 1
        acts = np.zeros((count, len(offsets)), dtype=bool)  # (K, p)
        np.logical_or.at(acts, session, (jacobian != 0).any(axis=1))
        only = np.where((acts.sum(axis=0) == 1) & (count > 1), acts.argmax(axis=0), -1)  # (p,)
        places = [np.nonzero(only == k)[0] for k in range(count)]
        width = max(map(len, places))
        local, local_offsets = np.zeros((*residual.shape, width)), np.zeros((count, width))
        for k, columns in enumerate(places):
            rows = session == k
            local[rows, :, : len(columns)] = jacobian[rows][:, :, columns]
            local_offsets[k, : len(columns)] = offsets[columns]
        return cls(
            residual=residual,
            shared=jacobian[..., only < 0] if width else jacobian,
            local=local,
            on=on,
            session=session,
            offsets=offsets[only < 0],
            local_offsets=local_offsets,
        )

    @property
    def rows(self) -> Index:
        """Rows with readings."""
        return np.nonzero(self.on.any(axis=1))[0]

    @property
    def parameters(self) -> int:
        """Number of all parameters."""
        return len(self.offsets) + self.local_offsets.size

    def take(self, rows: Index | slice) -> RowsBySession:
        """Some rows."""
        return RowsBySession(
            residual=self.residual[rows],
            shared=self.shared[rows],
            local=self.local[rows],
            on=self.on[rows],
            session=self.session[rows],
            offsets=self.offsets,
            local_offsets=self.local_offsets,
        )

    def fit(self, chosen: NDArray[np.bool_], wider: float = 1.0) -> Steps:
        """Steps by chosen rows (S, N) and the ranges; wider: by which the ranges are taken."""
        known, a, b = KNOWN / wider**2, len(self.offsets), self.local_offsets.shape[1]
        normal, right = self._shared_sums(chosen)
        normal, right = normal + known * np.eye(a), right - known * self.offsets
        sums = self._local_sums(chosen)
        local_normal = sums[..., :b] + known * np.eye(b)  # (S, K, b, b)
        sums[..., -1] -= known * self.local_offsets
        solved = np.linalg.solve(local_normal, sums[..., b:])  # (S, K, b, a + 1)
        crossed, ratio, local = sums[..., b:-1], solved[..., :a], solved[..., a]
        if b:
            normal = normal - np.einsum("skba,skbc->sac", crossed, ratio)
            right = right - np.einsum("skba,skb->sa", crossed, local)
        shared = np.linalg.solve(normal, right[..., None])[..., 0]
        local = local - np.einsum("skba,sa->skb", ratio, shared)
        return Steps(shared=shared, local=local, normal=normal, local_normal=local_normal, ratio=ratio)

    def _shared_sums(self, chosen: NDArray[np.bool_]) -> tuple[Array, Array]:
        """Products of shared parameters with each other (S, a, a) and residuals (S, a), over chosen rows."""
        normal, right = np.zeros((len(chosen), *2 * self.offsets.shape)), np.zeros((len(chosen), len(self.offsets)))
        for rows in parts_of(len(self.on)):
            jacobian, chosen_rows = self.shared[rows], chosen[:, rows]
            normal += np.tensordot(chosen_rows.astype(float), np.einsum("ncp,ncq->npq", jacobian, jacobian), 1)
            right += chosen_rows @ np.einsum("ncp,nc->np", jacobian, self.residual[rows])
        return normal, right

    def _local_sums(self, chosen: NDArray[np.bool_]) -> Array:
        """Products of local parameters with all others and residuals, over chosen rows: (S, K, b, b + a + 1)."""
        sessions, b = self.local_offsets.shape
        out = np.zeros((len(chosen), sessions, b, b + len(self.offsets) + 1))
        for k in range(sessions if b else 0):
            rows = np.nonzero(self.session == k)[0]
            every = np.concatenate([self.local[rows], self.shared[rows], self.residual[rows, :, None]], axis=2)
            products = np.einsum("ncb,ncj->nbj", self.local[rows], every)
            out[:, k] = np.tensordot(chosen[:, rows].astype(float), products, 1)
        return out

    def squares(self, steps: Steps) -> Array:
        """Sums of squares (S, N) of the rows' residuals after steps."""
        squares = np.empty((len(steps.shared), len(self.residual)))
        for rows in parts_of(len(self.on)):
            left = self.residual[rows] - np.einsum("ncp,sp->snc", self.shared[rows], steps.shared)
            if self.local.shape[2]:
                left = left - np.einsum("ncb,snb->snc", self.local[rows], steps.local[:, self.session[rows]])
            squares[:, rows] = (left**2).sum(axis=2)
        return squares

    def left(self, steps: Steps) -> Array:
        """What the first steps leave of the residuals (N, C)."""
        moved = self.shared @ steps.shared[0] + np.einsum("ncb,nb->nc", self.local, steps.local[0][self.session])
        return np.asarray(self.residual - moved)

    def leverage(self, steps: Steps) -> Array:
        """Covariance (N, C, C) of what the first steps predict, by rows."""
        inverse, local = np.linalg.inv(steps.normal[0]), np.linalg.inv(steps.local_normal[0])
        net = self.shared - self.local @ steps.ratio[0][self.session]  # (N, C, a), the local ones giving way
        by_local = np.einsum("ncb,nbe,nde->ncd", self.local, local[self.session], self.local)
        return np.asarray(np.einsum("ncp,pq,ndq->ncd", net, inverse, net) + by_local)
