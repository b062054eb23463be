"""Writing of measurement tables, block by block, so that a million rows need little memory."""

from __future__ import annotations

import csv
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TextIO

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.errors import OutputError
from pkmcal_cli.base.outputs import write_text
from pkmcal_cli.units.file_units import Unit, parse_unit

Values = NDArray[Any] | Sequence[str]
"""A column (N,): numbers in SI, or texts."""

_ROWS = 1 << 14


class TableWriter:
    """An open table that rows are appended to."""

    def __init__(self, file: TextIO, units: Sequence[Unit | None], digits: int | None, names: Sequence[str]) -> None:
        self._writer = csv.writer(file, lineterminator="\n")
        self._units, self._digits, self._names = units, digits, names

    def header(self) -> None:
        """The names, with units: "x [mm]"."""
        cells = [f"{name} [{unit.text}]" if unit else name for name, unit in zip(self._names, self._units, strict=True)]
        self._writer.writerow(cells)

    def write(self, columns: Sequence[Values]) -> None:
        """Append rows: one array (n,) a column, numbers in SI. Raises OutputError for an infinite number."""
        count = len(columns[0]) if columns else 0
        for start in range(0, count, _ROWS):
            cells = [self._cells(index, column[start : start + _ROWS]) for index, column in enumerate(columns)]
            self._writer.writerows(zip(*cells, strict=True))

    def _cells(self, index: int, values: Values) -> list[Any]:
        """Cells of one column: csv writes floats with the fewest digits that suffice, and None as nothing."""
        array = np.asarray(values)
        if array.dtype.kind not in "fiu":
            return [" ".join(str(text).split("\n")) for text in values]
        unit = self._units[index]
        if array.dtype.kind != "f" and unit is None:
            cells: list[Any] = array.tolist()
            return cells
        array = array.astype(np.float64)
        if np.isinf(array).any():
            raise OutputError(f"column `{self._names[index]}` has an infinite value", None, None, "output")
        numbers = (array if unit is None else _in_unit(unit, array)).tolist()
        if self._digits is not None:
            numbers = [float(f"{value:.{self._digits}g}") for value in numbers]
        if np.isnan(array).any():
            return [None if value != value else value for value in numbers]
        return list(numbers)


def _in_unit(unit: Unit, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """SI values in the unit, by the same operations as `Unit.from_si`."""
    convert: Any = unit.from_si
    return np.asarray(convert(values))


@contextmanager
def open_writer(
    target: Path | str,
    columns: Sequence[tuple[str, str | None]],
    inputs: Collection[str],
    *,
    comments: Sequence[str] = (),
    digits: int | None = None,
    force: bool = False,
) -> Iterator[TableWriter]:
    """A new table of columns (name, unit or None), whole at the end or absent; `-` is stdout.

    `inputs`: names of the files that it is made from; `comments` become lines before the header that begin with "#".
    Raises OutputError.
    """
    units = [parse_unit(unit) if unit else None for _, unit in columns]
    with write_text(target, inputs, force=force) as file:
        for comment in comments:
            file.writelines(f"# {line}\n" for line in comment.splitlines() or [""])
        writer = TableWriter(file, units, digits, [name for name, _ in columns])
        writer.header()
        yield writer
