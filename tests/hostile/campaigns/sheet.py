"""A measurement table as numbers, to be spoilt, and back to text."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tests.command import MACHINES
from tests.csv_tables import read_table

Array = NDArray[np.float64]
_ROWS = 24


@dataclass(frozen=True)
class Sheet:
    """Columns `names` with `units`; values (N, C) as the file has them, nan where a cell is empty; drives: how many
    of the columns, the first ones, are positions of drives."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    values: Array
    drives: int

    @classmethod
    def shipped(cls, table: str, rows: int = _ROWS) -> Sheet:
        """Rows of a shipped table, evenly taken; without ids. Its readings are of an independent simulator."""
        read = read_table(MACHINES / f"{table}.csv")
        kept = [n for n in read.numbers if n not in ("id", "index", "time")]
        values = np.column_stack([read.numbers[n] for n in kept])
        some = np.unique(np.linspace(0, len(values) - 1, min(rows, len(values))).round().astype(int))
        motors = [n for n in kept if _is_drive(n)]
        order = [kept.index(n) for n in (*motors, *(n for n in kept if n not in motors))]
        names = tuple(kept[k] for k in order)
        units = dict(zip(read.names, read.units, strict=True))
        return cls(names, tuple(units[n] or "" for n in names), values[some][:, order], len(motors))

    @property
    def readings(self) -> list[int]:
        """Columns that are no positions of drives."""
        return list(range(self.drives, len(self.names)))

    def at(self, name: str) -> int:
        """Place of a column."""
        return self.names.index(name)

    def having(self, values: Array) -> Sheet:
        """The same columns with other values."""
        return replace(self, values=values)

    def changed(self, name: str, change: Callable[[Array], Array], rows: slice = slice(None)) -> Sheet:
        """Cells (n,) of a column changed."""
        values, k = self.values.copy(), self.at(name)
        values[rows, k] = change(values[rows, k])
        return self.having(values)

    def text(self) -> str:
        """The file."""
        heads = [f"{n} [{u}]" if u else n for n, u in zip(self.names, self.units, strict=True)]
        lines = [",".join("" if np.isnan(v) else f"{v:.9f}" for v in row) for row in self.values]
        return "\n".join([",".join(heads), *lines]) + "\n"


def _is_drive(name: str) -> bool:
    return name[0] in "qXY" or name in ("TL", "TR", "BL", "BR") or name.startswith("motor_")
