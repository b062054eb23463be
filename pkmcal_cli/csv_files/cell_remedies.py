"""What to do about a cell that should be a number: there is a remedy for every cell."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator
from datetime import datetime

from pkmcal_cli.csv_files.dialect import DECIMAL_NAMES, is_number
from pkmcal_cli.units.file_units import UnitError, parse_unit
from pkmcal_cli.units.letters import digits_hint

LEAVE_EMPTY = "leave the cell empty where nothing was measured"
COMMENTS = "write comments only before the header, in lines that begin with `#`"
_THOUSANDS = re.compile(r"[+-]?[0-9]{1,3}(?:([.,' \u2019\u00a0\u202f])[0-9]{3})(?:\1[0-9]{3})*(?:[.,][0-9]+)?")
_MISSING = {"na", "n/a", "n.a.", "nan", "null", "none", "nil", "-", "--", "---", "?", ".", "x"}
_MISSING |= {"missing", "error", "err", "void", "out"}
_NO_NUMBER = re.compile(r"[+-]?(?:1[.,]#(?:q?nan|snan|ind)0*|nan\(.*\))", re.IGNORECASE)  # of C libraries
_SPREADSHEET = re.compile(r"#[\w/ ]+[!?]|#N/?[AV]|#+", re.IGNORECASE)  # #N/A, #DIV/0!, #WERT!, ####
_MINUS = "\u2212\u2013\u2014\u2010\u2011"  # minus sign, dashes, hyphens
_EXPONENT = re.compile(
    r"([+-]?[0-9.,]+)(?:[dDqQ]|\s*[eE]\s*|\s*[*x\u00d7\u00b7]\s*10\s*(?:\^|\*\*)\s*)([+-]?\s*[0-9]+)"
)
_LACKING = re.compile(r"([+-]?[0-9.,]+)[eE][+-]?")
_COMMENT = re.compile(r"(.*?)\s*(#|//|;|!|/\*|\().*")
_DATE = re.compile(r"([0-9]{1,4})([./-])([0-9]{1,2})\2([0-9]{1,4})(?:[ T,]+([0-9]{1,2}:[0-9]{2}(?::[0-9.]+)?))?.*")
_GERMAN_DATE = re.compile(r"[0-9]{1,2}\.[0-9]{1,2}\.(?:[0-9]{2}|[0-9]{4})")
_MONTHS = "jan|f[eé][bv]|m[aä]r|mrz|a[pv]r|ma[iy]|ju[inl]|aug|ao[uû]|sep|o[ck]t|nov|d[eé][cz]"
_MONTH = re.compile(rf"(?=.*[0-9])[0-9]{{0,2}}[. -]*(?:{_MONTHS})[a-zéû]*[. -]*[0-9]{{0,4}}", re.IGNORECASE)
_CLOCK = re.compile(r"[0-9]{1,3}:[0-9]{2}(?::[0-9]{2}(?:[.,][0-9]+)?)?(?:\s*[AaPp][Mm])?")
_WORDS = {"true", "false", "yes", "no", "on", "off", "wahr", "falsch", "ja", "nein", "vrai", "faux", "y", "n", "t", "f"}
_QUANTITY = re.compile(r"[+-]?[0-9.,]+(?:[eE][+-]?[0-9]+)?\s*([A-Za-zµμ°%].*)")
_SPREAD = re.compile(r"\s*(?:±|\+/?-|\()\s*")
_TIME_HINT = "write times as `2021-12-16T10:30`, or as seconds, and all rows of the column alike"


def remedy(cell: str, decimal: str, column: str, seen: bool = True) -> str:
    """What to do about a cell that is no number with this decimal mark; `seen`: whether any of the file has it."""
    return next(itertools.chain(_thousands(cell, decimal, seen), _remedies(cell, decimal, column)))


def _remedies(cell: str, decimal: str, column: str) -> Iterator[str]:
    """Remedies, the one that fits best first; the last one fits all."""
    if cell.lower() in _MISSING or _NO_NUMBER.fullmatch(cell):
        yield LEAVE_EMPTY
    if _SPREADSHEET.fullmatch(cell):
        yield "a spreadsheet's error value: correct its formula, widen its column, or leave the cell empty"
    for rule in (_marks, _letters, _exponent, _time, _wrapped, _behind, _word):
        yield from rule(cell, decimal, column)
    yield from _unit(cell, column)
    if column == "time":
        yield _TIME_HINT
    yield f"write one number, such as `12{decimal}5`, or {LEAVE_EMPTY}"


def _thousands(cell: str, decimal: str, seen: bool) -> Iterator[str]:
    """The number without its thousands separators; its decimal mark is that of the file, as far as this has one."""
    other = "," if decimal == "." else "."
    thousands = _THOUSANDS.fullmatch(cell)
    if thousands and not is_number(cell, other):
        plain = cell.replace(thousands[1], "")
        plain = plain.replace(other, decimal) if seen and is_number(plain, other) else plain
        yield f"write numbers without thousands separators: `{plain}`"


def _marks(cell: str, decimal: str, column: str) -> Iterator[str]:
    """Decimal marks, signs."""
    other = "," if decimal == "." else "."
    if is_number(cell, other):
        yield f"write all numbers with the same decimal mark; this file has a {DECIMAL_NAMES[decimal]}"
    if re.fullmatch(r"[+-]?[0-9]+;[0-9]+", cell):
        yield f"write the decimal mark as `{decimal}`: `{cell.replace(';', decimal)}`"
    if cell[:1] in _MINUS and is_number(cell[1:], decimal):
        yield f"write the minus sign as `-`: `-{cell[1:]}`"
    if cell[-1:] in ("-", *_MINUS) and is_number(cell[:-1], decimal):
        yield f"write the minus sign before the number: `-{cell[:-1]}`"
    if cell[:1] == "(" and cell[1:2] not in "+-" and cell[-1:] == ")" and is_number(cell[1:-1], decimal):
        yield f"write a negative number as `-{cell[1:-1]}`, or {LEAVE_EMPTY}"
    bare = cell.lstrip("+-")
    if bare != cell and len(cell) - len(bare) > 1 and is_number(bare, decimal):
        yield "write one sign before the number"
    for extra in ("_", "'", " ", "\u00a0", "\u202f", "\u2009"):
        if extra in cell and is_number(plain := cell.replace(extra, ""), decimal):
            extras = "underscores" if extra == "_" else "blanks and quotes"
            yield f"write the number without {extras}: `{plain}`"
    if re.fullmatch(r"[+-]?[0-9]*(?:[.,]+[0-9]*){2,}", cell) and not _GERMAN_DATE.fullmatch(cell):
        yield "write one number with one decimal mark; two numbers need a separator between them"


def _letters(cell: str, decimal: str, column: str) -> Iterator[str]:
    """Letters and foreign digits for digits."""
    if hint := digits_hint(cell, lambda digits: is_number(digits, decimal)):
        yield hint
    plain = "".join(str(int(c)) if c.isdecimal() else c for c in cell)
    if plain != cell and is_number(plain, decimal):
        yield f"write the digits 0 to 9: `{plain}`"
    if re.fullmatch(r"0[xX][0-9A-Fa-f]+", cell):
        yield f"write decimal numbers: `{int(cell, 16)}`"


def _exponent(cell: str, decimal: str, column: str) -> Iterator[str]:
    """Exponents as other languages write them, or without their digits."""
    match = _EXPONENT.fullmatch(cell)
    if match and is_number(match[1], decimal):
        yield f"write exponents with `e`: `{match[1]}e{re.sub(r'[+ ]', '', match[2])}`"
    if (match := _LACKING.fullmatch(cell)) and is_number(match[1], decimal):
        yield "the exponent has no digits: the number may be cut off"


def _time(cell: str, decimal: str, column: str) -> Iterator[str]:
    """Dates and times of day."""
    if not any(form.fullmatch(cell) for form in (_DATE, _MONTH, _CLOCK)) and not _reads_as_time(cell):
        return
    if column == "time":
        yield _TIME_HINT
    elif _CLOCK.fullmatch(cell):
        yield "times belong in column `time` only; write angles as decimal numbers"
    else:
        yield "use dates only in column `time`, and there in all rows; a spreadsheet may have made a date of a number"


def _reads_as_time(cell: str) -> bool:
    try:
        return bool(re.match(r"[0-9]{4}-?[0-9W]", cell)) and bool(datetime.fromisoformat(cell))
    except ValueError:
        return False


def _wrapped(cell: str, decimal: str, column: str) -> Iterator[str]:
    """Formulas, apostrophes, bounds, uncertainties, fractions, percents."""
    if cell.startswith("=") or re.fullmatch(r"[+@-]?\$?[A-Z]{1,3}\$?[0-9]+", cell):
        yield "a spreadsheet's formula: export the values, not the formulas"
    if cell.lstrip("'\"` \u2018\u201c") != cell and is_number(cell.strip("'\"` \u2018\u2019\u201c\u201d"), decimal):
        yield "write the number without quotes"
    if cell[:1] in "<>~≈≤≥" and is_number(cell.lstrip("<>=~≈≤≥ "), decimal):
        yield f"write a measured number, not a bound, or {LEAVE_EMPTY}"
    parts = _SPREAD.split(cell.rstrip(") "))
    if len(parts) == 2 and all(is_number(part, decimal) for part in parts):
        yield f"write the value alone, and its standard deviation in a column `sigma.{column}`"
    if re.fullmatch(r"[+-]?[0-9]+\s*/\s*[0-9]+", cell):
        yield "write fractions as decimal numbers"
    if is_number(cell.rstrip("% "), decimal):
        yield "write fractions of 1, not percent"


def _behind(cell: str, decimal: str, column: str) -> Iterator[str]:
    """Comments."""
    match = _COMMENT.fullmatch(cell)
    if match and (not match[1] or is_number(match[1], decimal)):
        yield COMMENTS


def _word(cell: str, decimal: str, column: str) -> Iterator[str]:
    """Words for yes and no, characters that were lost."""
    if cell.lower() in _WORDS:
        yield "write a direction as 1 or -1" if column.startswith("dir.") else f"write a number, or {LEAVE_EMPTY}"
    if "\ufffd" in cell:
        yield "a character was lost: save the table as UTF-8"


def _unit(cell: str, column: str) -> Iterator[str]:
    match = _QUANTITY.fullmatch(cell)
    unit = match[1] if match else cell.strip("[]()")  # of a line of units below the header
    try:
        parse_unit(unit)
    except UnitError:
        return
    yield f"write the unit in the header: `{column} [{unit}]`"
