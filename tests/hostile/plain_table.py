"""A second reader of measurement tables: plain, slow to trust, and told how the file was written.

It shares no line with the program's reader. What it is not sure of it gives no numbers for (`Unsure`): a program that
reads such a file in silence is looked at.
"""

from __future__ import annotations

import csv
import math
import re
from dataclasses import dataclass, field
from datetime import UTC, datetime

from tests.hostile.plain_units import ZERO_CELSIUS, powers, unit

LABELS = ("id", "session", "tool", "part", "to")
_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_HEAD = re.compile(r"(.*?)\s*\[([^\[\]]*)\]", re.DOTALL)


class Unsure(Exception):
    """No plain reader would give numbers for this."""


@dataclass(frozen=True)
class Known:
    """A column that a machine has: letters of what it measures ("" for a plain number), unit where none is stated."""

    letters: str
    unit: str


@dataclass
class PlainTable:
    """Values in SI, NaN where a cell is empty, and labels, by name; lines of the rows."""

    numbers: dict[str, list[float]] = field(default_factory=dict)
    labels: dict[str, list[str]] = field(default_factory=dict)
    lines: list[int] = field(default_factory=list)


def read_plain(data: bytes, separator: str, decimal: str, known: dict[str, Known]) -> PlainTable:
    """The table in a file of which is told how it was written. Raises Unsure."""
    lines = _lines(data)
    try:
        return _read(_rows(lines, separator), decimal, known)
    except Unsure:
        if separator != "\t":
            raise
        return _read(_rows(lines, " "), decimal, known)  # a table that only looks as if tabs had a meaning


def _read(rows: list[tuple[int, list[str]]], decimal: str, known: dict[str, Known]) -> PlainTable:
    if not rows:
        raise Unsure("no header")
    (_, header), *body = rows
    while header and not header[-1]:
        header.pop()
    if not body:
        raise Unsure("no rows")
    out = PlainTable(lines=[line for line, _ in body])
    for line, cells in body:
        if len(cells) < len(header) or any(cells[len(header) :]):
            raise Unsure(f"width of line {line}")
    for place, cell in enumerate(header):
        _column(cell, [cells[place] for _, cells in body], decimal, known, out)
    return out


def _lines(data: bytes) -> list[str]:
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        text = data.decode("utf-16", "replace")
    else:
        try:
            text = data.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = data.decode("cp1252", "replace")
    if "\0" in text:
        raise Unsure("zero byte")
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def _rows(lines: list[str], separator: str) -> list[tuple[int, list[str]]]:
    out: list[tuple[int, list[str]]] = []
    for number, line in enumerate(lines, start=1):
        if not out and (line.strip().startswith("#") or re.fullmatch(r"\s*sep=.\s*", line, re.IGNORECASE)):
            continue
        if line.count('"') % 2:
            raise Unsure(f"open quote in line {number}")
        if separator == " ":
            line = re.sub(r"(?<!\s)\s+\[", "[", line) if not out else line
            cells = [cell.replace('"', "") for cell in re.findall(r'(?:"[^"]*"|[^\s\["]|\[[^\]]*\])+', line)]
        else:
            cells = next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])
        cells = [cell.strip() for cell in cells]
        if any(cells) or ('"' in line and out):
            out.append((number, cells))
    return out


def _column(cell: str, texts: list[str], decimal: str, known: dict[str, Known], out: PlainTable) -> None:
    head = _HEAD.fullmatch(cell)
    name, stated = (head[1], head[2].strip()) if head else (cell, None)
    if name in LABELS:
        name, taken = name, out.labels
        texts = [text[1:] if re.match(r"'+[=+@-]", text) else text for text in texts]
    elif name in known:
        taken = out.numbers  # type: ignore[assignment]
    else:
        return
    if name in taken:
        raise Unsure(f"{name} twice")
    if name in LABELS:
        out.labels[name] = texts
    elif name == "time" and any(re.match(r"\d{4}-\d\d-\d\d", text) for text in texts):
        out.numbers[name] = _times(texts)
    else:
        out.numbers[name] = [_si(text, decimal, known[name], stated) for text in texts]


def _times(texts: list[str]) -> list[float]:
    try:
        moments = [datetime.fromisoformat(text) if text else None for text in texts]
    except ValueError as error:
        raise Unsure(str(error)) from error
    if len({m.tzinfo is None for m in moments if m}) > 1:
        raise Unsure("times with and without offset")
    seconds = [(m if m.tzinfo else m.replace(tzinfo=UTC)).timestamp() if m else math.nan for m in moments]
    first = next(s for s in seconds if s == s)
    return [s - first for s in seconds]


def _si(text: str, decimal: str, column: Known, stated: str | None) -> float:
    if stated not in (None, "", "-") and stated != column.unit:
        found = unit(stated or "")
        if found is None or found[1] != powers(column.letters):
            raise Unsure(f"unit {stated}")
    name = column.unit if stated in (None, "", "-") else stated or ""
    if not text:
        return math.nan
    plain = text.replace(",", ".") if decimal == "," else text
    if not _NUMBER.fullmatch(plain) or (decimal == "," and "." in text):
        raise Unsure(f"cell {text}")
    value = float(plain)
    if math.isinf(value):
        raise Unsure(f"cell {text}")
    scale = unit(name or "1")
    assert scale is not None
    return value * scale[0] + (ZERO_CELSIUS if name in ("degC", "°C") else 0.0)
