"""Cells of a measurement table: numbers and times from text, and the words for a cell that is neither."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from itertools import pairwise

from pkmcal_cli.base.plural import count
from pkmcal_cli.csv_files.cell_remedies import COMMENTS, LEAVE_EMPTY, remedy
from pkmcal_cli.csv_files.dialect import SEPARATOR_NAMES, SEPARATORS, SPACE, Flaw, Format, is_number

Convert = Callable[[str], float]
"""From the text of a cell to its value; raises ValueError for a text that is no value."""

_DATE_FORM = re.compile(r"[0-9]{4}-[0-9]{1,2}-[0-9]{1,2}(?:[T ][0-9:.,]+(?:Z|[+-][0-9:]+)?)?")  # as ISO 8601 has them
_INFINITE = re.compile(r"[+-]?(?:inf(?:inity)?|1\.#inf|∞)", re.IGNORECASE)


def number_of(decimal: str) -> Convert:
    """The converter of numbers with this decimal mark: finite ones only."""

    def convert(cell: str) -> float:
        if not is_number(cell, decimal):
            raise ValueError(cell)
        value = float(cell.replace(",", ".") if decimal == "," else cell)
        if value - value != 0.0:
            raise OverflowError(cell)
        return value

    return convert


def is_time(cell: str) -> bool:
    """Whether a cell is a date, or a date with time, in ISO 8601 ("2021-12-16T10:30:00", "... 10:30Z")."""
    return _instant(cell) is not None


def has_zone(cell: str) -> bool:
    """Whether an ISO 8601 time says its offset from UTC."""
    instant = _instant(cell)
    return instant is not None and instant.tzinfo is not None


def time_of(zone: bool) -> Convert:
    """The converter of ISO 8601 times to seconds since 1970-01-01 UTC.

    All times of a column name their offset from UTC (`zone`), or none does and they are taken for UTC.
    """

    def convert(cell: str) -> float:
        instant = _instant(cell)
        if instant is None or (instant.tzinfo is not None) != zone:
            raise ValueError(cell)
        return (instant if zone else instant.replace(tzinfo=UTC)).timestamp()

    return convert


def _instant(cell: str) -> datetime | None:
    if not re.match(r"[0-9]{4}-?[0-9W]", cell) or re.fullmatch(r"[0-9.]*", cell):
        return None
    try:
        return datetime.fromisoformat(cell)
    except ValueError:
        return None


def number_flaw(cell: str, form: Format, column: str, line_column: tuple[int, int]) -> Flaw:
    """The flaw of a cell that should be a number; `line_column` is its line and its index in the row."""
    if _INFINITE.fullmatch(cell) or is_number(cell, form.decimal):
        message = f"`{_short(cell)}` in column `{column}` is not finite"
        return Flaw("csv-number", message, LEAVE_EMPTY, *line_column)
    if column == "time":
        return _seconds_flaw(cell, form, line_column)
    message = f"`{_short(cell)}` in column `{column}` is not a number"
    return Flaw("csv-number", message, remedy(cell, form.decimal, column, form.decimal_seen), *line_column)


def _seconds_flaw(cell: str, form: Format, line_column: tuple[int, int]) -> Flaw:
    """The flaw of a time that is no number in a column whose first time is one."""
    if is_time(cell):
        message = f"`{_short(cell)}` in column `time` is a date, the first row has a number"
    elif _DATE_FORM.fullmatch(cell):
        message = f"`{_short(cell)}` in column `time`: there is no such date or time"
    else:
        message = f"`{_short(cell)}` in column `time` is neither a number of seconds nor a time in ISO 8601"
    return Flaw("csv-time", message, remedy(cell, form.decimal, "time", form.decimal_seen), *line_column)


def time_flaw(cell: str, zone: bool, column: str, line_column: tuple[int, int]) -> Flaw:
    """The flaw of a cell that should be an ISO 8601 time like the others of its column."""
    if is_time(cell):
        message = f"`{_short(cell)}` in column `{column}` {'lacks the' if zone else 'has an'} offset from UTC"
        return Flaw("csv-time", message, "write all times of the column with the offset, or all without", *line_column)
    hint = 'write times as in the first row, for example "2021-12-16T10:30:00"'
    return Flaw("csv-time", f"`{_short(cell)}` in column `{column}` is not a time in ISO 8601", hint, *line_column)


def comment_flaw(line: int) -> Flaw:
    """The flaw of a row that is commented out, or whose id looks like it."""
    hint = "delete the row; if the `#` belongs to its first cell, put that cell in quotes"
    return Flaw("csv-comment", "below the header, a row that begins with `#` is not a comment", hint, line)


def header_flaw(line: int) -> Flaw:
    """The flaw of a row that is the header once more, as where tables were put one below the other."""
    hint = "delete the line; tables of several sessions can have a column `session`, or be several files"
    return Flaw("csv-header", "the header stands here again", hint, line)


def width_flaw(cells: Sequence[str], form: Format, line: int) -> Flaw:
    """The flaw of a row that has not one cell for every name of the header, or does not end as the others do."""
    names = [cell.name for cell in form.header]
    more = len(cells) - len(names)
    commented = next((k for k, cell in enumerate(cells) if cell.startswith("#")), None)
    if commented is not None:
        return Flaw("csv-width", _width(cells, names), COMMENTS, line, commented)
    message = _width(cells, names)
    if more < 0:
        if (other := _other_separator(cells, form, -more)) is not None:
            hint = f"write a {SEPARATOR_NAMES[form.separator]} between cells, not a {SEPARATOR_NAMES[other]}"
            return Flaw("csv-width", message, hint, line)
        after = " and the columns after it" if more < -1 else ""
        hint = f"add a cell for `{names[more]}`{after}; an empty cell still needs its separator"
        return Flaw("csv-width", message, hint, line)
    if not any(cells[len(names) :]):
        return _end_flaw(more, form, line)
    hint = f"remove the cell after `{names[-1]}`, which belongs to no column"
    split = [k for k, pair in enumerate(pairwise(cells)) if form.separator == "," and _split_by_comma(*pair)]
    if len(split) == more:
        first = ",".join(cells[split[0] : split[0] + 2])
        hint = f"write decimal points: `{first.replace(',', '.')}` instead of `{first}`"
        return Flaw("csv-width", message, hint, line, split[0])
    if form.separator == "," and all(cell.lstrip("+-").replace(".", "").isdigit() for cell in cells):
        hint += "; check for decimal commas and thousands separators"
    return Flaw("csv-width", message, hint, line, len(names))


def _split_by_comma(whole: str, rest: str) -> bool:
    """Whether two cells may be one number that a decimal comma splits; three digits behind it may be thousands."""
    return bool(re.fullmatch(r"[+-]?[0-9]+", whole) and re.fullmatch(r"(?![0-9]{3}(?![0-9]))[0-9]+[^0-9.]*", rest))


def _other_separator(cells: Sequence[str], form: Format, lacking: int) -> str | None:
    """What stands within cells as often as there are cells too few, though it separates none in this table."""
    marks = [mark for mark in SEPARATORS if mark not in (form.separator, form.decimal, SPACE)]
    return next((mark for mark in marks if sum(cell.count(mark) for cell in cells) == lacking), None)


def _width(cells: Sequence[str], names: Sequence[str]) -> str:
    """What is wrong with a row of another width."""
    return f"the row has {count(len(cells), 'cell')}, the header has {len(names)}"


def _end_flaw(more: int, form: Format, line: int) -> Flaw:
    """The flaw of a row that ends with more or fewer empty cells than the others; the odd one may be any."""
    names = len(form.header)
    others = f"the other rows have {names + form.trailing}"
    message = f"the row has {count(names + more, 'cell')}, {others if form.trailing else f'the header has {names}'}"
    remedy = "remove the extra" if more > form.trailing else "add the missing"
    hint = f"{remedy} separator (cells after it are in the wrong columns), or end all rows alike"
    return Flaw("csv-width", message, hint, line)


def _short(cell: str) -> str:
    return cell if len(cell) <= 40 else cell[:37] + "..."


def cell_column(line: str, separator: str, index: int) -> int:
    """Where cell `index` of a line begins (its quote, if it has one), in characters from 1."""
    if separator == SPACE:
        starts = [match.start() for match in re.finditer(r'"[^"]*"|\S+', line)]
        return 1 + (starts[index] if index < len(starts) else len(line.rstrip()))
    at, quoted, passed = 0, False, 0
    while at < len(line) and passed < index:
        if line[at] == '"':
            quoted = not quoted
        elif line[at] == separator and not quoted:
            passed += 1
        at += 1
    while at < len(line) and line[at] in " \u00a0" and line[at] != separator:
        at += 1
    return at + 1
