"""Header cells that are a column's but for a slip: case, one letter, or a unit not in square brackets."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable

from pkmcal_cli.csv_files.dialect import HeaderCell
from pkmcal_cli.language.fields import SPATIAL
from pkmcal_cli.tables.columns import Column
from pkmcal_cli.units.file_units import UnitError, parse_unit

_TAIL = re.compile(r"(?P<open>\s*+[\[\](){}]|\s*+[_/,]\s*+|\s++)(?P<unit>[^\[\](){}]*)(?P<close>[\[\](){}]*)\s*")
_LIKE = 0.8  # similarity from which on a name is taken for another one where much speaks for it
_SHORT = 2  # letters: of a name so short one other letter is another name


def is_near(cell: HeaderCell, column: Column) -> bool:
    """Whether a cell is the header of a column but for case, one edit, or how its unit is written."""
    return _misspelt(cell.name, column.header) or _unit_astray(cell, column, (column.header,)) is not None


def is_like(cell: HeaderCell, column: Column) -> bool:
    """Whether a cell may name a column of whose sensor nothing else is there: near, alike, or the end of its name."""
    name, header, called = cell.name.lower(), column.header.lower(), _called(column)
    if is_near(cell, column) or name in called or _unit_astray(cell, column, called) is not None:
        return True
    return bool(difflib.get_close_matches(name, [header], 1, _LIKE)) and not _another(name, header)


def did_you_mean_column(cell: HeaderCell, column: Column) -> str:
    """The hint for a cell that is near or like a column."""
    astray = None if _misspelt(cell.name, column.header) else _unit_astray(cell, column, _called(column))
    unit = cell.unit if astray is None else astray
    shown = f"{column.header} [{unit}]" if unit else column.header
    remedy = "Otherwise rename or remove it" if astray is None else "Write units in square brackets"
    return f"did you mean `{shown}`? {remedy}"


def _misspelt(name: str, header: str) -> bool:
    name, header = name.lower(), header.lower()
    return name == header or (_one_edit(name, header) and not _another(name, header))


def _one_edit(a: str, b: str) -> bool:
    """Whether one letter more, less or other, or two exchanged, makes one text of the other."""
    short, long = sorted((a, b), key=len)
    if len(long) > len(short):
        return len(long) == len(short) + 1 > 1 and any(long[:k] + long[k + 1 :] == short for k in range(len(long)))
    wrong = [k for k in range(len(a)) if a[k] != b[k]]
    return len(wrong) == 1 or (len(wrong) == 2 and a[: wrong[0]] + a[wrong[1]] + a[wrong[0]] + a[wrong[1] + 1 :] == b)


def _another(a: str, b: str) -> bool:
    """Whether names much alike are two names: numbers, coordinates and single letters tell things apart."""
    bare = [re.sub(r"[^a-z0-9]", "", name) for name in (a, b)]
    if bare[0] != bare[1] and re.sub(r"\d+", "0", bare[0]) == re.sub(r"\d+", "0", bare[1]):
        return True  # leg1, leg2
    parts = [re.split(r"[^a-z0-9]+", name) for name in (a, b)]
    pairs = zip(*parts, strict=True) if len(parts[0]) == len(parts[1]) else ()
    return any(p != q and ({p, q} <= set(SPATIAL) or _short_and_other(p, q)) for p, q in pairs)


def _short_and_other(p: str, q: str) -> bool:
    return len(p) == len(q) <= _SHORT and sorted(p) != sorted(q)


def _called(column: Column) -> list[str]:
    """Its header and name with and without the sensor: `tracker.ball.x`, `ball.x`, `x`."""
    names = (column.header.lower().split("."), column.name.lower().split("."))
    return [".".join(parts[k:]) for parts in names for k in range(len(parts))]


def _unit_astray(cell: HeaderCell, column: Column, names: Iterable[str]) -> str | None:
    """The unit of a cell that has one of the names and a unit that is not in square brackets; None for others.

    "mm" of `x [mm`, `x mm]`, `x (mm)`, `x_mm`, `x/mm`; that of the column for `x [`.
    """
    for name in names if cell.unit is None else ():
        match = _TAIL.fullmatch(cell.text[len(name) :])
        if match is None or not cell.text.lower().startswith(name.lower()):
            continue
        unit = match["unit"].strip()
        if _fits(unit, column):
            return unit
        if match["open"].strip(" _/,") or match["close"]:
            return column.unit_name
    return None


def _fits(unit: str, column: Column) -> bool:
    try:
        return unit == column.unit_name or (not unit.isdigit() and parse_unit(unit).dimension == column.physical)
    except UnitError:
        return False
