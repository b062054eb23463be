"""Whole tables in memory, by the program's reader and writer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pkmcal_cli.csv_files.cell_values import Chunk, ColumnRules, FaultLog, FloatArray, IntArray, Kind
from pkmcal_cli.csv_files.origin import Origin
from pkmcal_cli.csv_files.reader import TEXT_COLUMNS, TableReader, check_header, no_rows, open_table
from pkmcal_cli.csv_files.writer import Values, open_writer


@dataclass(frozen=True, kw_only=True)
class Table:
    """A whole table in the units of its file.

    `names` and `units` by column (None where the header has none); `numbers` (N,) by name, NaN where a cell
    is empty; `texts` (N) by name; `lines` (N,) the file line of every row; `comments` are before the header.
    """

    path: str
    names: tuple[str, ...]
    units: tuple[str | None, ...]
    numbers: Mapping[str, FloatArray]
    texts: Mapping[str, tuple[str, ...]]
    lines: IntArray
    separator: str
    decimal: str
    comments: tuple[str, ...]
    notes: tuple[str, ...]
    sha256: str


def read_table(source: Path | str, texts: Sequence[str] = ("remarks",)) -> Table:
    """A whole table, numbers everywhere but in the columns of labels and `texts`. Raises BadInput with all faults."""
    with open_table(source) as reader:
        log = FaultLog(reader.name, reader.format.separator)
        check_header(reader, log, [cell.name for cell in reader.header])
        kinds: list[Kind] = ["text" if cell.name in (*TEXT_COLUMNS, *texts) else "number" for cell in reader.header]
        chunks = list(reader.chunks(ColumnRules(tuple(kinds)), log))
        if not chunks and not log.total:
            log.add(no_rows(reader))
        log.raise_if_any()
        return _table(reader, kinds, chunks)


def _table(reader: TableReader, kinds: Sequence[Kind], chunks: Sequence[Chunk]) -> Table:
    names = tuple(cell.name for cell in reader.header)
    numbers = {
        names[i]: np.concatenate([chunk.numbers[i] for chunk in chunks])
        for i, kind in enumerate(kinds)
        if kind in ("number", "time")
    }
    texts = {
        names[i]: tuple(text for chunk in chunks for text in chunk.texts[i])
        for i, kind in enumerate(kinds)
        if kind == "text"
    }
    form = reader.format
    return Table(
        path=reader.name,
        names=names,
        units=tuple(cell.unit for cell in reader.header),
        numbers=numbers,
        texts=texts,
        lines=np.concatenate([chunk.lines for chunk in chunks]),
        separator=form.separator,
        decimal=form.decimal,
        comments=form.comments,
        notes=reader.notes,
        sha256=reader.sha256,
    )


def write_table(
    target: Path | str,
    columns: Sequence[tuple[str, str | None, Values]],
    *,
    origin: Origin | None = None,
    digits: int | None = None,
    force: bool = False,
) -> None:
    """Write columns (name, unit, values (N,)), made from no file: numbers are in SI and written in the unit.

    The header is "x [mm]". Floats have the fewest digits that give them back, or are rounded to `digits`
    significant ones; NaN is an empty cell. Labels have the unit None. Raises OutputError.
    """
    heads = [(name, unit) for name, unit, _ in columns]
    with open_writer(target, heads, (), origin=origin, digits=digits, force=force) as writer:
        writer.write([values for _, _, values in columns])
