"""Strict reading of measurement tables: every cell becomes a number or a fault with its place.

A file is read in blocks of whole lines: memory is bounded by it, a faulty cell is told where it stands.
Blocks of large files go through pandas, all that is unusual in any way through the plain reader, which is
the reference: both give the same values.
"""

from __future__ import annotations

import codecs
import hashlib
import io
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO

from pkmcal_cli.base.errors import BadInput
from pkmcal_cli.base.files import input_name, open_input
from pkmcal_cli.base.plural import count
from pkmcal_cli.csv_files.cell_values import Chunk, ColumnRules, FaultLog, Parser
from pkmcal_cli.csv_files.cells import has_zone
from pkmcal_cli.csv_files.dialect import (
    Flaw,
    Format,
    HeaderCell,
    find_binary,
    find_encoding,
    find_format,
    is_number,
    split_line,
)
from pkmcal_cli.csv_files.origin import origin_note
from pkmcal_cli.units.file_units import UnitError, parse_unit

TEXT_COLUMNS = ("id", "session", "tool", "part", "to")
"""Names of the columns that hold text in every measurement table."""

HEAD = 1 << 16
"""So many bytes or characters tell how the file is written."""

_YAML = re.compile(r"(extends|units|space|gravity|ranges|parameters|provenance|fingerprint)\s*:")  # of our own files
_YAML_HINT = "name the machine file first, then tables; a parameter file is given by `-p`"
_BLOCK = 1 << 21  # characters read at once
_LARGE = 1 << 22  # bytes; from here on the import of pandas pays


class TableReader:
    """An open table: `format` tells how it is written, `size` is in bytes, `sha256` 64 hex digits."""

    def __init__(self, file: BinaryIO, name: str) -> None:
        """Look at the file; raises BadInput where there is no header to go by."""
        self.name, self._file = name, file
        self.size, self.sha256, is_utf8 = _survey(file)
        head = file.read(HEAD)
        self._encoding, self._encoding_note = find_encoding(head, is_utf8)
        self._head: Sequence[str] = ()  # the lines at the beginning
        self._open_end = False  # the last line ends with a digit, and not as lines do
        form = find_binary(head) or self._find_format()
        if isinstance(form, Flaw):
            log = FaultLog(name)
            log.add(form, self._source(form.line))
            raise BadInput(log.faults)
        self.format: Format = form
        self.blank_lines = 0
        self._origin = origin_note(name, self.sha256, form.comments)

    @property
    def header(self) -> tuple[HeaderCell, ...]:
        """The cells of the header."""
        return self.format.header

    @property
    def notes(self) -> tuple[str, ...]:
        """What to announce of the way the file is written; complete when all of it has been read."""
        trailing = "trailing separators ignored" if self.format.trailing else ""
        blank = f"{count(self.blank_lines, 'empty line')} skipped" if self.blank_lines else ""
        form = self.format.describe()
        cut = "the last line ends with a number and has no line end: was the file cut off?" if self._open_end else ""
        return tuple(note for note in (self._origin, form, self._encoding_note, trailing, blank, cut) if note)

    def header_source(self) -> str:
        """The text of the header line."""
        return self._source(self.format.header_line) or ""

    def first_cell(self, index: int) -> str:
        """The first cell of a column that is not empty, if the beginning of the file has one, else ""."""
        for line in self._head[self.format.header_line :]:
            cells = split_line(line, self.format.separator) or []
            if index < len(cells) and cells[index]:
                return cells[index]
        return ""

    def chunks(self, column_rules: ColumnRules, log: FaultLog) -> Iterator[Chunk]:
        """The rows, block by block. Faults go to `log`; a block with faults is not given out."""
        log.separator = self.format.separator
        zones = {i: has_zone(self.first_cell(i)) for i, kind in enumerate(column_rules.kinds) if kind == "time"}
        parser = Parser(self.format, column_rules, zones, self.size >= _LARGE)
        line = 1
        for block in self._blocks(_BLOCK):
            lines, before = block.count("\n"), log.total
            if line == 1:  # the header is in the first block: the head is shorter
                line += self.format.header_line
                block = block.split("\n", self.format.header_line)[-1]
                lines -= self.format.header_line
            chunk = parser.parse(block, line, log)
            line += lines
            if log.total == before and len(chunk.lines):
                yield chunk
        self.blank_lines = parser.blank_lines

    def _blocks(self, size: int) -> Iterator[str]:
        """Blocks of whole lines, each with the line end "\\n"."""
        self._file.seek(0)
        text = io.TextIOWrapper(self._file, self._encoding, errors="replace", newline=None)
        try:
            while block := text.read(size):
                block += text.readline()
                self._open_end = not block.endswith("\n") and block[-1].isdigit()
                yield block if block.endswith("\n") else block + "\n"
        finally:
            text.detach()

    def _source(self, line: int | None) -> str | None:
        return self._head[line - 1] if line is not None and 0 < line <= len(self._head) else None

    def _find_format(self) -> Format | Flaw:
        """The format by the head of the file; if that has no decimal mark, by the first cell that has."""
        blocks = self._blocks(HEAD)
        self._head = next(blocks, "").split("\n")[:-1]
        begin = next((k for k, line in enumerate(self._head) if line.strip() and line[:1] != "#"), None)
        if begin is not None and _YAML.match(self._head[begin]):
            return Flaw("csv-header", "this is a machine or parameter file, no table", _YAML_HINT, begin + 1)
        first = find_format(self._head)
        if isinstance(first, Flaw) or first.decimal_seen:
            return first
        names = self._head[: first.header_line]
        for block in blocks:
            lines = [line for line in block.split("\n") if "." in line or "," in line]
            form = find_format([*names, *lines[:50]])
            if isinstance(form, Format) and form.decimal_seen and len(form.header) == len(first.header):
                return replace(form, trailing=first.trailing)
        return first


@contextmanager
def open_table(source: Path | str) -> Iterator[TableReader]:
    """A table opened for reading, `-` for stdin. Raises BadInput where it has no header to go by."""
    with open_input(source) as file:
        yield TableReader(file, input_name(source))


def check_header(reader: TableReader, log: FaultLog, names: Sequence[str | None]) -> None:
    """Report names that stand in the header twice; None is a column not used, "" one without name."""
    first: dict[str, int] = {}
    source, line = reader.header_source(), reader.format.header_line
    for index, name in enumerate(names):
        if name == "":
            message = f"column {index + 1} has no name"
            log.add(Flaw("csv-header", message, "name it in the header", line, index), source)
        elif name is not None and name in first:
            message = f"duplicate column `{name}` (columns {first[name] + 1} and {index + 1})"
            log.add(Flaw("csv-duplicate", message, "rename or remove one of them", line, index), source)
        elif name is not None:
            first[name] = index


def check_cells(source: Path | str) -> None:
    """Read a table of which nobody knows what it is about: columns with a unit, or a number at first, hold numbers.

    Raises BadInput with all faults of form and cells.
    """
    with open_table(source) as reader:
        log, decimal = FaultLog(reader.name), reader.format.decimal
        plain = [
            cell.name not in TEXT_COLUMNS and (_has_unit(cell) or is_number(reader.first_cell(i), decimal))
            for i, cell in enumerate(reader.header)
        ]
        for _ in reader.chunks(ColumnRules(tuple("number" if p else "skip" for p in plain)), log):
            pass
        log.raise_if_any()


def _has_unit(cell: HeaderCell) -> bool:
    """Whether what stands in brackets is a unit, not a remark."""
    try:
        return cell.unit is not None and bool(parse_unit(cell.unit))
    except UnitError:
        return False


def no_rows(reader: TableReader) -> Flaw:
    """The flaw of a table that has a header and nothing below."""
    hint = "add one line per pose below the header"
    return Flaw("csv-empty", "the table has no rows below the header", hint, reader.format.header_line)


def _survey(file: BinaryIO) -> tuple[int, str, bool]:
    """Size in bytes, SHA-256, and whether the bytes are UTF-8; the file is left at its start."""
    digest, decoder = hashlib.sha256(), codecs.getincrementaldecoder("utf-8")()
    size, is_utf8 = 0, True
    file.seek(0)
    while block := file.read(1 << 20):
        digest.update(block)
        size += len(block)
        if is_utf8:
            try:
                decoder.decode(block)
            except UnicodeDecodeError:
                is_utf8 = False
    file.seek(0)
    return size, digest.hexdigest(), is_utf8
