"""Turns lines of a measurement table into arrays; what is no value becomes a fault with its place."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from io import BytesIO
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.errors import MAX_FAULTS, BadInput, Fault, Location
from pkmcal_cli.csv_files.cells import (
    cell_column,
    comment_flaw,
    header_flaw,
    number_flaw,
    number_of,
    time_flaw,
    time_of,
    width_flaw,
)
from pkmcal_cli.csv_files.dialect import QUOTE_HINT, SPACE, Flaw, Format, split_line
from pkmcal_cli.csv_files.guarded import bare

Kind = Literal["number", "text", "time", "skip"]
"""What cells are: ISO 8601 "time" is read as seconds since 1970-01-01 UTC, "skip" is not read."""

_AROUND = '\ufeff"'  # a name where a file with a byte order mark was put behind another one
_COMMENT = re.compile(r"^[^\S\n]*#", re.MULTILINE)

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


class FaultLog:
    """Faults of one file: the first `MAX_FAULTS` in full, all of them counted."""

    def __init__(self, file: str, separator: str = ",") -> None:
        self.file, self.separator = file, separator
        self.faults: list[Fault] = []
        self.total = 0
        self.conclusion: Fault | None = None

    @property
    def is_full(self) -> bool:
        """Whether further faults are only counted: nobody has to word them."""
        return len(self.faults) >= MAX_FAULTS

    def add(self, flaw: Flaw | None, source: str | None = None) -> None:
        """Take a flaw; `source` is the text of its line. None is one that is only counted."""
        self.total += 1
        if self.is_full or flaw is None:
            return
        column = 0
        if source is not None and flaw.line is not None:
            column = 1 if flaw.cell is None else cell_column(source, self.separator, flaw.cell)
        where = Location(self.file, flaw.line or 1, column)
        self.faults.append(Fault(flaw.code, flaw.message, where, flaw.hint, source))

    def conclude(self, flaw: Flaw) -> None:
        """Take what all faults together suggest: told last."""
        self.conclusion = Fault(flaw.code, flaw.message, Location(self.file, flaw.line or 1), flaw.hint)

    def raise_if_any(self) -> None:
        """Raise BadInput with the faults, if there are any."""
        if self.faults:
            by_place = sorted(self.faults, key=lambda fault: fault.where or Location(self.file, 0))
            last = [] if self.conclusion is None else [self.conclusion]
            raise BadInput([*by_place, *last], self.total + len(last))


@dataclass(frozen=True)
class Chunk:
    """Consecutive rows: file lines (n,); by index of column numbers (n,) and n texts, if empty NaN and ""."""

    lines: IntArray
    numbers: dict[int, FloatArray]
    texts: dict[int, list[str]]


@dataclass(frozen=True)
class Rule:
    """What the numbers of a column must be, in words; `allowed` maps values (n,) to booleans (n,); the remedy."""

    allowed: Callable[[FloatArray], NDArray[np.bool_]]
    requirement: str
    hint: str


@dataclass(frozen=True)
class ColumnRules:
    """How to read the columns, by index: kinds, why a cell may not be empty (the hint), rules for numbers."""

    kinds: tuple[Kind, ...]
    required: Mapping[int, str] = field(default_factory=dict)
    rules: Mapping[int, Rule] = field(default_factory=dict)


class Parser:
    """Parses blocks of whole lines of one table.

    `zones` tells of columns of times whether they name their offset from UTC. With `fast`, blocks without
    anything unusual go through pandas; the values are the same.
    """

    def __init__(self, form: Format, column_rules: ColumnRules, zones: Mapping[int, bool], fast: bool) -> None:
        self.format, self.column_rules, self.zones = form, column_rules, zones
        self.kinds = column_rules.kinds
        self.names = [cell.name for cell in form.header]
        self.fast = fast and form.separator != SPACE and "number" in self.kinds and "time" not in self.kinds
        self._takes_comments = self.kinds[0] in ("text", "skip")  # without a fault of their first cell
        self.blank_lines = 0
        self._blank_before = 0  # empty lines not yet followed by a row

    def parse(self, block: str, first_line: int, log: FaultLog) -> Chunk:
        """The rows of a block; `first_line` is the number of its first line. Faults go to `log`."""
        lines = block.count("\n")
        chunk = self._parse_with_pandas(block, first_line, lines) if self.fast else None
        return chunk or self._parse_plain(block.split("\n")[:-1], first_line, log)

    def _parse_with_pandas(self, block: str, first_line: int, lines: int) -> Chunk | None:
        """By pandas; None if any row is longer or shorter than the others, or a cell no finite number."""
        separator, width = self.format.separator, len(self.names) + self.format.trailing
        if any(c in block for c in ('"', "\0", "\n\n")) or block.count(separator) != (width - 1) * lines:
            return None
        if self._takes_comments and _COMMENT.search(block):
            return None
        frame = _read_frame(block, separator, self.format.decimal, width, self.kinds)
        if frame is None or frame.shape != (lines, width):
            return None
        if not all(frame[i].isna().all() for i in range(len(self.names), width)):
            return None
        numbers = {i: frame[i].to_numpy() for i, kind in enumerate(self.kinds) if kind == "number"}
        if self._is_odd(numbers, block):
            return None
        chosen = [i for i, kind in enumerate(self.kinds) if kind == "text"]
        texts = {i: _texts(frame[i].fillna("").tolist()) for i in chosen}
        if any(i in texts and "" in texts[i] for i in self.column_rules.required):
            return None
        self.blank_lines, self._blank_before = self.blank_lines + self._blank_before, 0
        return Chunk(np.arange(first_line, first_line + lines, dtype=np.int64), numbers, texts)

    def _is_odd(self, numbers: Mapping[int, FloatArray], block: str) -> bool:
        """Whether the plain reader must look: infinite numbers, faults, rows that may be empty, a "nan"."""
        for i, values in numbers.items():
            rule = self.column_rules.rules.get(i)
            if np.isinf(values).any() or (rule and not (rule.allowed(values) | np.isnan(values)).all()):
                return True
            if i in self.column_rules.required and np.isnan(values).any():
                return True
        gaps = [np.isnan(values) for values in numbers.values()]
        empty = bool(np.logical_and.reduce(gaps).any())
        return empty or (any(gap.any() for gap in gaps) and "nan" in block.lower())

    def _parse_plain(self, lines: Sequence[str], first_line: int, log: FaultLog) -> Chunk:
        """Line by line, whole columns at once; cell by cell where one is odd."""
        rows: list[list[str]] = []
        numbers: list[int] = []
        header = [cell.text for cell in self.format.header]
        for number, line in enumerate(lines, start=first_line):
            cells = split_line(line, self.format.separator)
            if "\0" in line:
                log.add(Flaw("csv-binary", "this line contains a zero byte", "save the file as UTF-8", number))
            elif cells is None:
                log.add(Flaw("csv-quote", "a quote is not closed", QUOTE_HINT, number), line)
            elif not any(cells) and '"' not in line:
                self._blank_before += 1
            elif self._takes_comments and _COMMENT.match(line):
                log.add(comment_flaw(number), line)
            elif cells[1 : len(header)] == header[1:] and cells[0].strip(_AROUND) == header[0]:
                log.add(header_flaw(number), line)
            elif not self.format.fits(cells):
                log.add(width_flaw(cells, self.format, number), line)
            else:
                rows.append(cells)
                numbers.append(number)
                self.blank_lines, self._blank_before = self.blank_lines + self._blank_before, 0
        sources = _Sources(lines, first_line, np.array(numbers, dtype=np.int64), log)
        return self._convert(rows, sources)

    def _convert(self, rows: Sequence[Sequence[str]], sources: _Sources) -> Chunk:
        columns = list(zip(*rows, strict=False)) or [()] * len(self.names)
        values: dict[int, FloatArray] = {}
        texts: dict[int, list[str]] = {}
        for index, kind in enumerate(self.kinds):
            if kind == "text":
                texts[index] = _texts(columns[index])
            elif kind != "skip":
                values[index] = self._values(columns[index], index, sources)
                self._check_rule(columns[index], values[index], index, sources)
            if index in self.column_rules.required:
                self._check_empty(columns[index], index, sources)
        return Chunk(sources.numbers, values, texts)

    def _values(self, cells: Sequence[str], index: int, sources: _Sources) -> FloatArray:
        """The values (n,) of one column, NaN where a cell is empty."""
        decimal, zone = self.format.decimal, self.zones.get(index, False)
        is_time = self.kinds[index] == "time"
        convert = time_of(zone) if is_time else number_of(decimal)
        at_once = None if is_time else _values_at_once(cells, decimal)
        if at_once is not None:
            return at_once
        out = np.full(len(cells), np.nan)
        for row, cell in enumerate(cells):
            if cell:
                try:
                    out[row] = convert(cell)
                except (ValueError, OverflowError):
                    if sources.log.is_full:  # a remedy takes a fraction of a millisecond, and there may be a million
                        sources.log.add(None)
                        continue
                    line_column = int(sources.numbers[row]), index
                    flaw = time_flaw(cell, zone, self.names[index], line_column) if is_time else None
                    sources.add(flaw or number_flaw(cell, self.format, self.names[index], line_column))
        return out

    def _check_empty(self, cells: Sequence[str], index: int, sources: _Sources) -> None:
        """Report empty cells of a column that is needed in every row."""
        if "" in cells:
            message = f"empty cell in column `{self.names[index]}`"
            for row in (row for row, cell in enumerate(cells) if not cell):
                line_column = int(sources.numbers[row]), index
                sources.add(Flaw("csv-empty-cell", message, self.column_rules.required[index], *line_column))

    def _check_rule(self, cells: Sequence[str], values: FloatArray, index: int, sources: _Sources) -> None:
        """Report numbers that a column may not have."""
        rule = self.column_rules.rules.get(index)
        if rule is not None:
            for row in np.nonzero(~(rule.allowed(values) | np.isnan(values)))[0]:
                message = f"`{cells[int(row)]}` in column `{self.names[index]}`: {rule.requirement}"
                sources.add(Flaw("csv-value", message, rule.hint, int(sources.numbers[row]), index))


@dataclass(frozen=True)
class _Sources:
    """Lines of a block, the number of the first, line numbers (n,) of rows, and where faults go."""

    lines: Sequence[str]
    first: int
    numbers: IntArray
    log: FaultLog

    def add(self, flaw: Flaw) -> None:
        """Take a flaw with the text of its line."""
        self.log.add(flaw, None if flaw.line is None else self.lines[flaw.line - self.first])


def _read_frame(block: str, separator: str, decimal: str, width: int, kinds: Sequence[Kind]) -> Any:
    """As a pandas frame with columns 0 to width - 1 and exact numbers; None where it is not to be had."""
    import pandas as pd

    dtype: dict[Any, Any] = dict.fromkeys(range(width), str)
    dtype |= {i: np.float64 for i, kind in enumerate(kinds) if kind == "number"}
    options: dict[str, Any] = {"keep_default_na": False, "na_values": [""], "quoting": 3, "index_col": False}
    if int(pd.__version__.partition(".")[0]) < 3:
        options["float_precision"] = "round_trip"
    file = BytesIO(block.encode())
    try:
        return pd.read_csv(
            file, header=None, sep=separator, decimal=decimal, dtype=dtype, skip_blank_lines=False, **options
        )
    except ValueError:  # ParserError is one
        return None


def _texts(cells: Sequence[str]) -> list[str]:
    """Texts without blanks around; equal ones are one object, so that labels cost little memory."""
    seen: dict[str, str] = {}
    return [seen.setdefault(cell, cell) for cell in (bare(cell.strip()) for cell in cells)]


def _values_at_once(cells: Sequence[str], decimal: str) -> FloatArray | None:
    """The values (n,) of cells that are all plain finite numbers or empty; None if not."""
    text = "\n".join(cells)
    if not text.isascii() or "_" in text or (decimal == "," and "." in text):
        return None
    if decimal == ",":
        cells = text.replace(",", ".").split("\n")
    try:
        out = np.array([float(cell) if cell else np.nan for cell in cells])
    except ValueError:
        return None
    return out if int(np.isfinite(out).sum()) == len(cells) - cells.count("") else None
