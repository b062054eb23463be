"""Constant linear maps between arrays whose last axis runs over rows (machine configurations).

Most of what the engine does between the elements' formulas is linear with constant, mostly zero coefficients: triads
of connection points out of rotations, links out of offset vectors, forces and tangents out of the elements' ones. All
of it is done for many rows at once by one product with a sparse matrix.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.lean import some_rows, stored_once
from pkmcal_cli.base.rotation import Array

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Index = NDArray[np.intp]
_FEW = 2000  # products of entries that are added up without a sparse matrix: a cold start does not import it
_SMALL = 2000  # cells of a map up to which a full matrix is fastest


@dataclass(frozen=True)
class SparseMap:
    """y[target] += factor * x[source] for arrays x (columns, N) and y (height, N); repeated targets add up."""

    height: int
    columns: int
    target: Index  # (nnz,)
    source: Index  # (nnz,)
    factor: Array  # (nnz,)

    @cached_property
    def used(self) -> Index:
        """Columns on which the image depends."""
        return np.nonzero(np.bincount(self.source, minlength=self.columns))[0]

    @cached_property
    def _matrix(self) -> csr_array:
        from scipy.sparse import csr_array

        entries = (self.factor, (self.target, self.source))
        return csr_array(entries, shape=(self.height, self.columns))

    @cached_property
    def _full(self) -> Array | None:
        """The whole matrix where it is small."""
        if self.height * self.columns > _SMALL:
            return None
        places = self.target * self.columns + self.source
        flat = np.bincount(places, self.factor, self.height * self.columns)
        return np.asarray(flat.reshape(self.height, self.columns), dtype=float)

    @cached_property
    def _places(self) -> dict[int, Index]:
        """Where products go in an image of so many rows; kept, as numbers of rows come again."""
        return {}

    def __call__(self, x: Array) -> Array:
        """The image (height, N) of x (columns, N), real or complex; what is not finite spoils its targets only."""
        rows = x.shape[1]
        if self._full is not None:
            return _product(self._full, x)
        if rows > 1 and rows * len(self.factor) > _FEW:
            return np.asarray(self._matrix @ x)
        parts = self.factor[:, None] * x[self.source]  # (nnz, N)
        if rows not in self._places:
            self._places[rows] = (self.target[:, None] * rows + np.arange(rows)).ravel()
        image_row = self._places[rows]
        image = np.bincount(image_row, parts.real.ravel(), self.height * rows)
        if np.iscomplexobj(parts):
            image = image + 1j * np.bincount(image_row, parts.imag.ravel(), self.height * rows)
        return np.asarray(image.reshape(self.height, rows), dtype=parts.dtype)


def _product(matrix: Array, x: Array) -> Array:
    """A real matrix times x, real or complex; zeros of the matrix are no entries."""
    if math.isfinite(np.vdot(x, x).real):  # where it overflows, the entries are looked at one by one
        return _all_products(matrix, x)
    lost = ~np.isfinite(x)
    image = _all_products(matrix, np.where(lost, 0.0, x))
    image[(matrix != 0.0) @ lost] = np.nan
    return image


def _all_products(matrix: Array, x: Array) -> Array:
    if x.dtype == complex:
        return np.asarray((matrix @ np.ascontiguousarray(x).view(float)).view(complex))
    return np.asarray(matrix @ x)


@dataclass(frozen=True)
class Block:
    """A part of a stacked array (rows of machines last): an array (N, *shape) in which the row index runs fastest."""

    start: int
    shape: tuple[int, ...]

    @cached_property
    def stop(self) -> int:
        """First entry behind the block."""
        return self.start + math.prod(self.shape)

    @cached_property
    def _stacked(self) -> tuple[int, ...]:
        return self.shape[::-1]

    @property
    def numbers(self) -> Index:
        """Place of each entry in the stacked array, shape `shape`."""
        return np.arange(self.start, self.stop).reshape(self.shape[::-1]).T

    def of(self, stacked: Array) -> Array:
        """The block as a view (N, *shape) of a stacked array (entries, N)."""
        return stacked[self.start : self.stop].reshape(*self._stacked, stacked.shape[1]).T


class Stack:
    """Blocks laid one behind the other."""

    def __init__(self) -> None:
        self.stop = 0

    def block(self, *shape: int) -> Block:
        """The next block."""
        made = Block(self.stop, shape)
        self.stop = made.stop
        return made


@dataclass
class Entries:
    """Entries of a map being collected."""

    target: list[Index]
    source: list[Index]
    factor: list[Array]

    @classmethod
    def none(cls) -> Entries:
        """No entries yet."""
        return cls([], [], [])

    def add(self, target: Index, source: Index, factor: Array | float) -> None:
        """Add entries, arrays that broadcast; those with a zero factor or a negative target do not count."""
        t, s, c = np.broadcast_arrays(target, source, np.asarray(factor, dtype=float))
        used = np.nonzero((c != 0) & (t >= 0))
        self.target.append(t[used])
        self.source.append(s[used])
        self.factor.append(c[used])

    def build(self, height: int, columns: int) -> SparseMap:
        """The map."""
        if not self.target:
            empty = np.zeros(0, dtype=np.intp)
            return SparseMap(height, columns, empty, empty, np.zeros(0))
        target, source = np.concatenate(self.target), np.concatenate(self.source)
        factor = np.concatenate(self.factor)
        return SparseMap(height, columns, target, source, factor)


def rows_last(x: Array) -> Array:
    """x (N, ...) as a matrix (entries, N); a view where the row index runs fastest in memory."""
    return np.asarray(x.T.reshape(-1, len(x)))


def take_rows(x: Array, rows: Index | slice) -> Array:
    """x[rows] of an array (N, ...), with the row index running fastest in memory; what is stored once stays so."""
    if stored_once(x):
        return some_rows(x, rows)
    if isinstance(rows, slice):
        return np.asarray(np.ascontiguousarray(x.T[..., rows]).T)
    return np.asarray(x.T.take(rows, axis=-1).T)


def pick(x: Array, numbers: Index) -> Array:
    """x[:, numbers] of an array (N, E, ...), with the row index running fastest in memory."""
    return np.asarray(x.T.take(numbers.T, axis=-2).T)
