"""Words for the rows of a part of a table: where they stand in the whole."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

IntArray = NDArray[np.intp]


@dataclass(frozen=True)
class RowNames:
    """Words for a row of a part of the table."""

    row_origin: Callable[[int], str]
    rows: IntArray

    def __call__(self, row: int) -> str:
        return self.row_origin(int(self.rows[row]))
