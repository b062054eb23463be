"""Writing of measurement tables, block by block, so that a million rows need little memory."""

from __future__ import annotations

import csv
import os
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TextIO

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.errors import OutputError, UsageError
from pkmcal_cli.base.files import is_stream, readable, sha256
from pkmcal_cli.base.outputs import check_target, takes_directly, write_text, write_together
from pkmcal_cli.csv_files.guarded import guarded
from pkmcal_cli.csv_files.origin import Origin, beside
from pkmcal_cli.units.file_units import Unit, parse_unit

Values = NDArray[Any] | Sequence[str]
"""A column (N,): numbers in SI, or texts."""

_ROWS = 1 << 14
_ROUNDED = 4  # last digits
_NO_TABLES = (".xlsx", ".xls", ".ods", ".pdf", ".html", ".docx")  # what a table would be taken for by its name


class TableWriter:
    """An open table that rows are appended to."""

    def __init__(self, file: TextIO, units: Sequence[Unit | None], digits: int | None, names: Sequence[str]) -> None:
        self._writer = csv.writer(file, lineterminator="\n")
        self._units, self._digits, self._names = units, digits, names

    def header(self) -> None:
        """The names, with units: "x [mm]"."""
        cells = [f"{name} [{unit.text}]" if unit else name for name, unit in zip(self._names, self._units, strict=True)]
        self._writer.writerow([guarded(cell) for cell in cells])

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
            return [guarded(" ".join(str(text).splitlines())) for text in values]
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
    """SI values in the unit, by the same operations as `Unit.from_si`; steps that are whole but for rounding are so."""
    convert: Any = unit.from_si
    out = np.asarray(convert(values))
    if "=" not in unit.definition:
        return out
    whole = np.round(out)
    return np.where(np.abs(out - whole) <= _ROUNDED * np.spacing(np.abs(whole)), whole, out)


@contextmanager
def open_writer(
    target: Path | str,
    columns: Sequence[tuple[str, str | None]],
    inputs: Collection[str],
    *,
    origin: Origin | None = None,
    digits: int | None = None,
    force: bool = False,
) -> Iterator[TableWriter]:
    """A new table of columns (name, unit or None), whole at the end or absent; `-` is stdout.

    `inputs`: names of the files that it is made from. `origin` goes to a file beside it, which is there first, or,
    where the table goes to a stream, to lines before the header that begin with "#". Raises OutputError.
    """
    units = [parse_unit(unit) if unit else None for _, unit in columns]
    check_table(target, inputs, force=force)
    with open_with_origin(target, inputs, origin, force=force) as file:
        writer = TableWriter(file, units, digits, [name for name, _ in columns])
        writer.header()
        yield writer


def check_table(target: Path | str | None, inputs: Collection[str], *, force: bool = False) -> None:
    """Find out before the work whether a table, and the file beside it, could be written; None: none will be.

    Neither replaces an input, nor the file beside one. Raises OutputError, and UsageError for a name that is another
    kind of file's.
    """
    if target is None:
        return
    if not is_stream(target) and os.path.splitext(target)[1].lower() in _NO_TABLES:
        hint = "write FILE.csv: spreadsheets open it as it is"
        raise UsageError(f"-o: `{readable(str(target))}`: a table is a CSV file", hint=hint)
    read = [*inputs, *(beside(name) for name in inputs)]
    check_target(target, read, force=force)
    if not takes_directly(target):
        check_target(beside(target), read, force=force)


@contextmanager
def open_with_origin(
    target: Path | str, inputs: Collection[str], origin: Origin | None, *, force: bool = False
) -> Iterator[TextIO]:
    """A new table as a text, whole at the end or absent, with what it is beside it; on a stream before it in "#" lines.

    Raises OutputError.
    """
    if origin is None or takes_directly(target):
        with write_text(target, inputs, force=force) as file:
            file.writelines(f"# {line}\n" for line in ([] if origin is None else origin.lines()))
            yield file
        return
    with write_together([beside(target), target], inputs, force=force) as (companion, file):
        yield file
        file.flush()
        companion.write(origin.text(target, _checksum(file.name)))


def _checksum(name: str) -> str:
    """Of what was just written, hex. Raises OSError, which is an error of the output and not of an input."""
    with open(name, "rb") as file:
        return sha256(file)
