"""The layout of a tangent that is solved front by front says where its entries lie and which each front hands on.

A front is the block [K_aa K_ab; K_ba K_bb] of its own unknowns a and its border b; what elimination leaves of K_bb (see
`tangent`) is added to the fronts that hold these unknowns next (Duff and Reid 1983).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.equilibrium.partition import Front, fronts_of
from pkmcal_cli.mechanism.topology import Index


@dataclass(frozen=True)
class Wave:
    """Sums whose borders have nothing in common: which (w,), rows (w, r) that they touch, entries (w, r, r)."""

    sums: Index
    rows: Index
    entries: Index


@dataclass(frozen=True, kw_only=True)
class FrontSet:
    """F fronts of one level and shape: s unknowns and m multipliers each, s + m = o, and a border of r."""

    start: int  # of their entries: (F, o, o), (F, o, r), (F, r, o)
    unknowns: int  # s
    own: Index  # (F, o)
    border: Index  # (F, r)
    sums: Index  # (G,) first of the fronts that have the same border
    waves: tuple[Wave, ...]

    @property
    def stop(self) -> int:
        """First entry behind them."""
        count, size = self.own.shape
        return self.start + int(count * size * (size + 2 * self.border.shape[1]))

    def parts_of(self, entries: Array, transposed: bool) -> tuple[Array, Array, Array]:
        """Own parts (N, F, o, o), by the border (N, F, o, r), of the border (N, F, r, o): views."""
        (count, size), width, rows = self.own.shape, self.border.shape[1], len(entries)
        first, second = self.start + count * size * size, self.start + count * size * (size + width)
        own = entries[:, self.start : first].reshape(rows, count, size, size)
        ahead = entries[:, first:second].reshape(rows, count, size, width)
        back = entries[:, second : self.stop].reshape(rows, count, width, size)
        if transposed:
            return np.swapaxes(own, 2, 3), np.swapaxes(back, 2, 3), np.swapaxes(ahead, 2, 3)
        return own, ahead, back

    def own_of(self, entries: Array) -> Array:
        """Own parts (N, F, o, o)."""
        return self.parts_of(entries, False)[0]

    def summed(self, passed: Array) -> Array:
        """Sums (N, G, ...) of what fronts with the same border hand on (N, F, ...)."""
        if len(self.sums) == len(self.own):
            return passed
        if len(self.sums) == 1:
            return np.asarray(passed.sum(axis=1, keepdims=True))
        return np.asarray(np.add.reduceat(passed, self.sums, axis=1))

    def pass_on(self, passed: Array, entries: Array, right: Array, transposed: bool) -> None:
        """Subtract sums (N, G, r, r + k) from entries (N, width) and right-hand sides (N, n + c, k)."""
        width = self.border.shape[1]
        matrix = passed[..., :width]
        if transposed:
            matrix = np.swapaxes(matrix, 2, 3)
        for wave in self.waves:
            entries[:, wave.entries] -= matrix[:, wave.sums]
            right[:, wave.rows] -= passed[:, wave.sums, :, width:]


@dataclass(frozen=True)
class FrontLayout:
    """All fronts in the order of elimination; row and column in the matrix of every entry."""

    sets: tuple[FrontSet, ...]
    size: int
    unknowns: int
    row: Index
    column: Index

    @property
    def width(self) -> int:
        """Entries of a row."""
        return len(self.row)

    def places(self, row: Index, column: Index) -> Index:
        """Where entries of the matrix lie."""
        return _table(self)[row, column]

    @classmethod
    def of(cls, row: Index, column: Index, size: int, unknowns: int) -> FrontLayout | None:
        """The layout for a matrix with these entries that may be other than zero; None where one matrix is as fast."""
        pattern = np.eye(size, dtype=bool)
        pattern[row, column] = pattern[column, row] = True
        fronts = fronts_of(pattern, unknowns)
        return _layout(fronts, size, unknowns) if fronts else None


def _shape(front: Front) -> tuple[int, int, int, int]:
    return front.level, len(front.unknowns), len(front.multipliers), len(front.border)


def _layout(fronts: Sequence[Front], size: int, unknowns: int) -> FrontLayout:
    order = sorted(fronts, key=lambda front: (*_shape(front), front.border.tolist()))
    alike = [list(group) for _, group in groupby(order, key=_shape)]
    rows, columns, start, table = [], [], 0, np.full((size, size), -1, dtype=np.intp)
    for group in alike:
        own, border = (np.stack(x) for x in ([f.own for f in group], [f.border for f in group]))
        for a, b in ((own, own), (own, border), (border, own)):
            row, column = np.broadcast_arrays(a[:, :, None], b[:, None, :])
            table[row, column] = start + np.arange(row.size).reshape(row.shape)
            rows.append(row.ravel())
            columns.append(column.ravel())
            start += row.size
    sets, start = [], 0
    for group in alike:
        sets.append(_front_set(group, start, table))
        start = sets[-1].stop
    return FrontLayout(tuple(sets), size, unknowns, np.concatenate(rows), np.concatenate(columns))


def _table(layout: FrontLayout) -> Index:
    out = np.full((layout.size, layout.size), -1, dtype=np.intp)
    out[layout.row, layout.column] = np.arange(layout.width)
    return out


def _front_set(fronts: Sequence[Front], start: int, table: Index) -> FrontSet:
    own, border = np.stack([f.own for f in fronts]), np.stack([f.border for f in fronts])
    new = np.ones(len(border), dtype=bool)
    new[1:] = (border[1:] != border[:-1]).any(axis=1)
    sums = np.nonzero(new)[0]
    return FrontSet(
        start=start, unknowns=len(fronts[0].unknowns), own=own, border=border, sums=sums,
        waves=_waves(border[sums], table) if border.shape[1] else (),
    )  # fmt: skip


def _waves(borders: Index, table: Index) -> tuple[Wave, ...]:
    """Borders (G, r), those without a common row together."""
    waves: list[tuple[list[int], set[int]]] = []
    for k, border in enumerate(borders.tolist()):
        free = next((wave for wave in waves if wave[1].isdisjoint(border)), None)
        if free is None:
            waves.append(([k], set(border)))
        else:
            free[0].append(k)
            free[1].update(border)
    numbers = [np.array(wave, dtype=np.intp) for wave, _ in waves]
    return tuple(Wave(k, borders[k], table[borders[k][:, :, None], borders[k][:, None, :]]) for k in numbers)
