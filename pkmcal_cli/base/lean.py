"""Arrays over the rows of a long table: worked on in parts; stored once, read-only, where all rows are equal."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Rows = slice | NDArray[np.intp] | NDArray[np.bool_]

PART = 20_000  # rows of a long table that are worked on together


def parts_of(count: int) -> list[slice]:
    """Rows that are worked on together, of so many; one empty part of none."""
    return [slice(first, min(first + PART, count)) for first in range(0, max(count, 1), PART)]


def lean(x: NDArray[Any]) -> NDArray[Any]:
    """The array (N, ...), stored as one row where all are equal; nan equals nan."""
    if len(x) < 2 or stored_once(x):
        return x
    first = x[:1]
    kept = (x == first) | ((x != x) & (first != first))
    return np.broadcast_to(first[0].copy(), x.shape) if bool(kept.all()) else x


def lean_join(parts: Sequence[NDArray[Any]]) -> NDArray[Any]:
    """Parts (n, ...) one after the other, stored as one row where all rows are equal."""
    first = parts[0][:1]
    if all(bool((part == first).all()) for part in parts):
        return np.broadcast_to(first[0].copy(), (sum(map(len, parts)), *first.shape[1:]))
    return np.concatenate(parts)


def some_rows(x: NDArray[Any], rows: Rows) -> NDArray[Any]:
    """x[rows] of an array (N, ...); what is stored once stays so."""
    if not stored_once(x):
        return x[rows]
    if isinstance(rows, slice) or rows.dtype == bool:
        rows = np.arange(len(x))[rows]
    count = len(rows)
    return np.broadcast_to(x[0], (count, *x.shape[1:]))


def stored_once(x: NDArray[Any]) -> bool:
    """Whether one row of an array (N, ...) stands for all."""
    return len(x) > 1 and x.strides[0] == 0
