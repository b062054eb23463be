"""The tangent of all rows and the solution of its equations: as one matrix, or front by front.

With own unknowns a and border b of a front, elimination leaves K_bb - K_ba K_aa^-1 K_ab at the border (multifrontal
elimination: Duff and Reid 1983). Fronts of the same level and shape, of all rows, are one call. The same fronts serve
the transposed equations of adjoints, and tell whether the equilibrium is stable: the inertia of a symmetric matrix is
the sum of those of its pivots (Haynsworth 1968), so it is stable where every pivot is.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.equilibrium.fronts import FrontLayout
from pkmcal_cli.equilibrium.stability import definite
from pkmcal_cli.mechanism.topology import Index

_GROWTH = 1e4  # of entries by elimination; beyond, a pivot is (nearly) singular and the whole matrix is solved at once


def solve_rows(matrix: Array, right: Array) -> Array:
    """Solve (N, n, n) x = (N, n, k); NaN in rows whose matrix is singular."""
    try:
        return np.linalg.solve(matrix, right)
    except np.linalg.LinAlgError:
        if len(matrix) == 1:
            return np.full(right.shape, np.nan, dtype=right.dtype)
        half = len(matrix) // 2
        return np.concatenate([solve_rows(matrix[:half], right[:half]), solve_rows(matrix[half:], right[half:])])


class Tangent(ABC):
    """Derivatives of the balance of N rows by unknowns and scaled multipliers."""

    @abstractmethod
    def solve(self, right: Array) -> Array:
        """Solution (N, n + c, k) for right-hand sides (N, n + c, k); NaN in rows whose matrix is singular."""

    @abstractmethod
    def solve_transposed(self, right: Array) -> Array:
        """The same of the transposed matrices."""

    @abstractmethod
    def stable(self, rows: Index) -> NDArray[np.bool_]:
        """Which of some rows are in a minimum of the energy. Call it after `solve`."""

    @abstractmethod
    def dense(self, rows: Index | slice = slice(None)) -> Array:
        """Matrices (n, n + c, n + c) of some rows."""


@dataclass(frozen=True)
class DenseTangent(Tangent):
    """One matrix (N, n + c, n + c) for each row."""

    matrix: Array
    unknowns: int

    def solve(self, right: Array) -> Array:
        return solve_rows(self.matrix, right)

    def solve_transposed(self, right: Array) -> Array:
        return solve_rows(np.swapaxes(self.matrix, 1, 2), right)

    def stable(self, rows: Index) -> NDArray[np.bool_]:
        n, some = self.unknowns, self.matrix[rows]
        return definite(some[:, :n, :n], some[:, n:, :n])

    def dense(self, rows: Index | slice = slice(None)) -> Array:
        return self.matrix[rows]


@dataclass
class FrontTangent(Tangent):
    """Entries (N, width) laid out by fronts."""

    entries: Array
    layout: FrontLayout
    pivots: Array | None = None  # entries as elimination left them
    whole: Index = field(default_factory=lambda: np.zeros(0, dtype=np.intp))  # rows that were solved as one matrix

    def solve(self, right: Array) -> Array:
        return self._solve(right, transposed=False)

    def solve_transposed(self, right: Array) -> Array:
        return self._solve(right, transposed=True)

    def stable(self, rows: Index) -> NDArray[np.bool_]:
        assert self.pivots is not None
        out, n = np.ones(len(rows), dtype=bool), self.layout.unknowns
        pivots = self.pivots[rows]
        for fronts in self.layout.sets:
            own, s = fronts.own_of(pivots), fronts.unknowns
            flat = own.reshape(-1, *own.shape[2:])
            out &= definite(flat[:, :s, :s], flat[:, s:, :s]).reshape(own.shape[:2]).all(axis=1)
        whole = np.nonzero(np.isin(rows, self.whole))[0]
        if len(whole):
            matrix = self.dense(rows[whole])
            out[whole] = definite(matrix[:, :n, :n], matrix[:, n:, :n])
        return out

    def dense(self, rows: Index | slice = slice(None)) -> Array:
        some, size = self.entries[rows], self.layout.size
        out = np.zeros((len(some), size * size))
        out[:, self.layout.row * size + self.layout.column] = some
        return out.reshape(-1, size, size)

    def _solve(self, right: Array, transposed: bool) -> Array:
        try:
            out, grown = self._eliminated(right.copy(), transposed)
        except np.linalg.LinAlgError:
            out, grown = np.empty_like(right), np.ones(len(right), dtype=bool)
            self.pivots = self.entries
        whole = np.nonzero(grown)[0]
        if len(whole):
            matrix = self.dense(whole)
            out[whole] = solve_rows(np.swapaxes(matrix, 1, 2) if transposed else matrix, right[whole])
        self.whole = whole
        return out

    def _eliminated(self, right: Array, transposed: bool) -> tuple[Array, NDArray[np.bool_]]:
        """Solution, and rows (N,) in which a pivot cannot be trusted."""
        entries, eliminated = self.entries.copy(), []
        limit = _GROWTH * float(np.abs(entries[:1]).max(initial=0.0))
        grown = np.zeros(len(right), dtype=bool)
        for fronts in self.layout.sets:
            own, ahead, back = fronts.parts_of(entries, transposed)
            width = ahead.shape[3]
            both = np.concatenate([ahead, right[:, fronts.own]], axis=3)
            both = np.linalg.solve(own, both)
            eliminated.append(both)
            if width:
                passed = fronts.summed(back @ both)  # (N, G, r, r + k)
                if not np.abs(passed[..., :width]).max(initial=0.0) <= limit:
                    grown |= ~(np.abs(passed[..., :width]).max(axis=(1, 2, 3)) <= limit)
                fronts.pass_on(passed, entries, right, transposed)
        for fronts, both in zip(reversed(self.layout.sets), reversed(eliminated), strict=True):
            width = both.shape[3] - right.shape[2]
            own = both[..., width:]
            if width:
                own = own - both[..., :width] @ right[:, fronts.border]
            right[:, fronts.own] = own
        self.pivots = entries
        return right, grown


def tangent_of(entries: Array, layout: FrontLayout | None, size: int, unknowns: int) -> Tangent:
    """Make the tangent of entries (N, width): laid out by fronts, or flat matrices column by column."""
    if layout is not None:
        return FrontTangent(entries, layout)
    return DenseTangent(np.swapaxes(entries.reshape(len(entries), size, size), 1, 2), unknowns)
