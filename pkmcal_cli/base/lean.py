"""Arrays over the rows of a long table that are the same in every row: one is stored, and cannot be written to."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Rows = slice | NDArray[np.intp] | NDArray[np.bool_]


def lean(x: NDArray[Any]) -> NDArray[Any]:
    """The array (N, ...), stored as one row where all are equal; nan equals nan."""
    if len(x) < 2 or _stored_once(x):
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
    if not _stored_once(x):
        return x[rows]
    count = len(np.broadcast_to(0, (len(x),))[rows])
    return np.broadcast_to(x[0], (count, *x.shape[1:]))


def _stored_once(x: NDArray[Any]) -> bool:
    return len(x) > 1 and x.strides[0] == 0
