"""Finds out how a measurement file was written: encoding, header line, separator and decimal mark.

Separator and decimal mark are decided together, by the pair that splits the lines evenly and makes numbers of
most cells; either one alone is a trap ("x;y / 1,5;2,5" is also one column of text, or rows of 3 integers).
"""

from __future__ import annotations

import codecs
import csv
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from pkmcal_cli.base.plural import count
from pkmcal_cli.csv_files.guarded import bare

SPACE = " "  # stands for any run of spaces and tabs
SEPARATORS = (",", ";", "\t", "|", SPACE)
SEPARATOR_NAMES = {",": "comma", ";": "semicolon", "\t": "tab", "|": "bar", SPACE: "space"}
DECIMAL_NAMES = {".": "decimal point", ",": "decimal comma"}
_EXPONENT = r"(?:[eE][+-]?[0-9]+)?"
_NUMBER = {
    ".": re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)" + _EXPONENT),
    ",": re.compile(r"[+-]?(?:[0-9]+,?[0-9]*|,[0-9]+)" + _EXPONENT),
}
_WORD = re.compile(r'"([^"]*)"|((?:[^\s\["]|\[[^\]]*\]|\[|")+)')
_COMMENT = re.compile(r'#(.*)|"#((?:[^"]|"")*)"[,;\t| ]*')  # the second as spreadsheets save the first
_SEP_LINE = re.compile(r"\s*sep=(.)\s*", re.IGNORECASE)
MAX_COLUMNS = 10_000
"""More columns than any machine has: the table is turned, or its line ends are lost."""
QUOTE_HINT = "close the quote on the same line"


@dataclass(frozen=True)
class Flaw:
    """Something wrong at a place of the file; `cell` counts columns from 0, None means the whole line."""

    code: str
    message: str
    hint: str | None
    line: int | None = None
    cell: int | None = None


@dataclass(frozen=True)
class HeaderCell:
    """One cell of the header: `text` as written, split into `name` and `unit` ("x [mm]")."""

    text: str
    name: str
    unit: str | None


@dataclass(frozen=True, kw_only=True)
class Format:
    """How the file is written. Lines count from 1; `trailing` nameless empty cells end every row."""

    separator: str
    decimal: str
    decimal_seen: bool
    header_line: int
    header: tuple[HeaderCell, ...]
    trailing: int = 0
    comments: tuple[str, ...] = ()

    def fits(self, cells: Sequence[str]) -> bool:
        """Whether a row has one cell for every name of the header, and ends as all rows do."""
        return _fits(cells, len(self.header), self.trailing)

    def describe(self) -> str:
        """What to announce: "separator: semicolon, decimal comma"; empty for the plain form."""
        if (self.separator, self.decimal) == (",", "."):
            return ""
        mark = f", {DECIMAL_NAMES[self.decimal]}" if self.decimal_seen else ""
        return f"separator: {SEPARATOR_NAMES[self.separator]}{mark}"


def split_line(line: str, separator: str) -> list[str] | None:
    """Cells of one line without its end, stripped of blanks and quotes; None where a quote is left open."""
    if line.count('"') % 2:
        return None
    if separator == SPACE:
        return [a or b for a, b in _WORD.findall(line)] if '"' in line or "[" in line else line.split()
    if '"' not in line:
        return [cell.strip() for cell in line.split(separator)]
    return [cell.strip() for cell in next(csv.reader([line], delimiter=separator, skipinitialspace=True))]


def is_number(cell: str, decimal: str) -> bool:
    """Whether the whole cell is one finite decimal number (no thousands separators, no "nan", no "inf")."""
    return _NUMBER[decimal].fullmatch(cell) is not None


def split_header(text: str) -> HeaderCell:
    """Name and unit of a header cell such as "x [mm]"."""
    name, bracket, unit = text[:-1].rpartition("[")
    if not (text.endswith("]") and bracket and name) or "]" in unit:
        return HeaderCell(text, text, None)
    return HeaderCell(text, name.strip(), unit.strip())


def find_encoding(head: bytes, is_utf8: bool) -> tuple[str, str]:
    """(encoding, announcement) from the first bytes of the file and whether the whole of it is UTF-8."""
    if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16", "encoded as UTF-16"
    if head.startswith(codecs.BOM_UTF8):
        return "utf-8-sig", "starts with a byte order mark"
    if is_utf8:
        return "utf-8", ""
    return "cp1252", "not UTF-8, read as Windows-1252"


def find_binary(head: bytes) -> Flaw | None:
    """The flaw of a file that is no text, with the remedy for the usual kinds."""
    kinds = {
        b"PK\x03\x04": ("a spreadsheet or zip file", "save the sheet as CSV"),
        b"\xd0\xcf\x11\xe0": ("an old spreadsheet file", "save the sheet as CSV"),
        b"\x1f\x8b": ("a gzip file", "unpack it first, or pipe it: `gzip -dc FILE | pkmcal ... -`"),
        b"%PDF": ("a PDF file", "export the table as CSV"),
    }
    for magic, (kind, hint) in kinds.items():
        if head.startswith(magic):
            return Flaw("csv-binary", f"this is {kind}, not a text table", hint)
    if b"\0" in head and not head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return Flaw("csv-binary", "this is a binary file, not a text table", "save it as CSV in UTF-8")
    return None


def find_format(lines: Sequence[str]) -> Format | Flaw:
    """The format of a file whose first lines (without line ends) are given."""
    comments: list[str] = []
    separators: tuple[str, ...] = SEPARATORS
    for number, line in enumerate(lines, start=1):
        text = line.strip()
        if match := _COMMENT.fullmatch(text):
            comments.append((match[1] or match[2] or "").strip())
        elif number == 1 and (match := _SEP_LINE.fullmatch(line)) and match[1] in SEPARATORS:
            separators = (match[1],)
        elif text.strip("".join(SEPARATORS)):
            return _decide(number, lines, separators, comments)
    hint = "write a header with the column names, then one line per pose"
    return Flaw("csv-empty", "this file contains no table", hint)


@dataclass(frozen=True, kw_only=True)
class _Trial:
    """How well one pair of separator and decimal mark explains the lines."""

    separator: str
    decimal: str
    header: tuple[str, ...]
    nameless: int  # empty cells at the end of the header
    widths: tuple[int, ...]  # cells in every row
    trailing: int  # empty cells at the end of a row
    fitting: int  # rows that have as many cells as the header and `trailing` more, or nothing at all
    failing: int  # cells that are no numbers
    seen: bool  # some cell tells the decimal mark

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(split_header(cell).name for cell in self.header)  # without units and blanks before these

    @property
    def rank(self) -> tuple[int, int, int]:
        return self.fitting, -self.failing, len(self.header)


def _fits(cells: Sequence[str], columns: int, trailing: int) -> bool:
    return len(cells) == columns + trailing and not any(cells[columns:])


def _trailing(rows: Sequence[Sequence[str]], columns: int, header: int) -> int:
    """How many nameless empty cells end a row: as most rows have it, of equals the one next to the header's."""
    ends = Counter(len(row) - columns for row in rows if any(row) and len(row) >= columns and not any(row[columns:]))
    return max(ends, key=lambda number: (ends[number], -abs(number - header)), default=header)


def _header_cells(line: str, separator: str) -> list[str]:
    """Cells of the header; between blanks a unit belongs to the name before it ("x [mm] y [mm]")."""
    if separator == SPACE:
        line = re.sub(r"(?<!\s)\s++\[", "[", line)
    return split_line(line, separator) or []


def split_names(line: str, separator: str) -> list[str]:
    """Names in a header line, without the nameless cells at its end; [] where a quote is left open."""
    names = _header_cells(line, separator)
    while names and not names[-1]:
        names.pop()
    return names


def _try(header: str, rows: Sequence[str], separator: str, decimal: str) -> _Trial | None:
    names = split_names(header, separator)
    if not names:
        return None
    split = [split_line(row, separator) or [] for row in rows]
    columns = len(names)
    nameless = len(_header_cells(header, separator)) - columns
    trailing = _trailing(split, columns, nameless)
    fitting = sum(1 for row in split if _fits(row, columns, trailing) or (row and not any(row)))
    cells = [cell for row in split for cell in row if cell]
    failing = sum(1 for cell in cells if not is_number(cell, decimal))
    seen = any(is_number(cell, ".") != is_number(cell, ",") for cell in cells)
    widths = tuple(len(row) for row in split)
    return _Trial(
        separator=separator,
        decimal=decimal,
        header=tuple(names),
        nameless=nameless,
        widths=widths,
        trailing=trailing,
        fitting=fitting,
        failing=failing,
        seen=seen,
    )


def _trials(header: str, rows: Sequence[str], separators: Iterable[str]) -> list[_Trial]:
    pairs = [(s, d) for s in separators for d in (".", ",") if s != d]
    if any('"' in row for row in rows) and "," in separators:
        pairs.append((",", ","))  # "1,5","2,5"
    return [trial for s, d in pairs if (trial := _try(header, rows, s, d)) is not None]


def _without_blanks_in_cells(trials: Sequence[_Trial]) -> list[_Trial]:
    """Without those that part cells at blanks, where tabs alone part the same names and as many rows: else an id of
    two words would push the readings of its row aside if the last cell is empty."""
    by_tabs = {t.names: t.fitting for t in trials if t.separator == "\t"}
    return [t for t in trials if t.separator != SPACE or by_tabs.get(t.names, -1) < t.fitting]


def _choose(header: str, rows: Sequence[str], separators: Sequence[str]) -> _Trial | None:
    """The pair by which most rows fit and fewest cells are no numbers.

    One column it is only where nothing but blanks could part the header, and all cells are numbers.
    """
    trials = _without_blanks_in_cells(_trials(header, rows, separators))
    wide = [t for t in trials if len(t.header) > 1]
    alone = [t for t in trials if len(t.header) == 1 and t.fitting == len(rows)]
    best = max(wide, key=lambda t: t.rank, default=None)
    if best is not None and (2 * best.fitting > len(rows) or not rows):
        return best
    sure = [t for t in alone if not t.failing and all(w.separator == SPACE for w in wide)]
    if sure or best is None:
        return max(sure or alone or trials, key=lambda t: t.rank, default=None)
    return best


def _decide(number: int, lines: Sequence[str], separators: Sequence[str], comments: Sequence[str]) -> Format | Flaw:
    """The format, given the line number of the header."""
    rows = [line for line in lines[number:] if line.strip()]
    trial = _choose(lines[number - 1], rows, separators)
    if trial is None:
        return Flaw("csv-quote", "a quote in the header is not closed", QUOTE_HINT, number)
    if len(trial.header) > MAX_COLUMNS:
        message = f"the header has {len(trial.header)} columns; a table can have {MAX_COLUMNS}"
        hint = "check the line ends; write one row per pose, one column per reading"
        return Flaw("csv-columns", message, hint, number)
    if all(is_number(name, trial.decimal) for name in trial.header):
        hint = "name the columns in the first line, with units: `q1 [mm]`"
        return Flaw("csv-header", "the first line contains numbers instead of column names", hint, number)
    if rows and not trial.fitting:
        return _misfit(trial, number, 1 + lines.index(rows[0], number))
    if trial.nameless not in (0, trial.trailing):
        return _header_end(trial, number)
    header = tuple(split_header(bare(name)) for name in trial.header)
    return Format(
        separator=trial.separator,
        decimal=trial.decimal,
        decimal_seen=trial.seen,
        header_line=number,
        header=header,
        trailing=trial.trailing,
        comments=tuple(comments),
    )


def _misfit(trial: _Trial, header_line: int, line: int) -> Flaw:
    """No row has as many cells as the header: one flaw for all of them."""
    names, widths = len(trial.header), sorted(set(trial.widths))
    if widths == [0]:
        return Flaw("csv-quote", "a quote is not closed", f"{QUOTE_HINT}; write angles as decimal numbers", line)
    cells = count(widths[0], "cell") if len(widths) == 1 else f"{widths[0]} to {widths[-1]} cells"
    hint = f"line {header_line} is read as the header; begin lines before the header with `#`"
    numbers = trial.failing in (0, len(trial.widths))  # or ids and numbers
    if trial.separator == "," and numbers and len(widths) == 1 and names < widths[0] <= 2 * names:
        hint = "export with `;` as separator or with decimal points: a decimal comma looks like the separator"
    message = f"the header has {count(names, 'column')}, the rows have {cells}"
    return Flaw("csv-width", message, hint, line)


def _header_end(trial: _Trial, line: int) -> Flaw:
    """The header ends with empty cells, but not with as many as the rows."""
    message = f"the header ends with {count(trial.nameless, 'unnamed cell')}, the rows with {trial.trailing or 'none'}"
    hint = "end all lines with the same number of separators, or the header with none"
    return Flaw("csv-width", message, hint, line, len(trial.header))
