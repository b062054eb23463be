"""A table as lines of a given width: texts fold, numbers and their units never do.

What does not fit is mended in this order: texts and headers fold, columns that are told as spare are left out (who
shows the table says which), and what is still too wide goes on below, under the names of the rows again.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

_GAP = 2  # blanks between columns
_TEXT, _SHORT, _NAME = 30, 14, 16  # characters to which texts fold, gladly and where they must, and names of rows
_GLUE = "\u00a0"
_NUMBER_AND_UNIT = re.compile(r"(?<=\d) (?=[^\W\d_]|[%\u00b0])")
_PIECES = re.compile(r"[^@_/:,;|\]\)]*[@_/:,;|\]\)]+|[^@_/:,;|\]\)]+")  # where a long name may go on in the next line


@dataclass(frozen=True)
class Column:
    """Header and cells; text: goes to the left, and may fold; least: so narrow it may become, gladly and at last."""

    header: str
    cells: tuple[str, ...]
    text: bool
    least: tuple[int, int]

    @property
    def natural(self) -> int:
        """Its width where nothing folds."""
        return max(map(len, (self.header, *self.cells)))


@dataclass(frozen=True)
class Laid:
    """Lines, which of them are headers, and the headers of columns that were left out."""

    lines: tuple[str, ...]
    heads: frozenset[int]
    hidden: tuple[str, ...]


def columns_of(
    headers: Sequence[str], rows: Iterable[Sequence[str]], left: int, folded: Sequence[str]
) -> list[Column]:
    """Columns of a table; the first `left` ones are names, those with headers `folded` texts, "" goes to the left."""
    cells = list(zip(*rows, strict=True)) or [()] * len(headers)
    out = []
    for k, (header, texts) in enumerate(zip(headers, cells, strict=True)):
        name, folds = k < left, header in folded
        whole = (_numbers(text) if name or folds else len(text) for text in texts)  # what of a cell cannot fold
        least = max([max(map(len, header.split(" "))), *whole])
        column = Column(header, tuple(texts), name or folds or header == "", (least, least))
        ways = (_TEXT, _SHORT) if folds else (_NAME, _NAME) if name else (0, 0)
        gladly, at_last = (min(max(least, way), column.natural) for way in ways)
        out.append(replace(column, least=(gladly, at_last)))
    return out


def laid_out(columns: Sequence[Column], width: int, names: int, spare: Sequence[str] = ()) -> Laid:
    """The lines; names: how many columns name a row; spare: headers of columns to leave out, the first ones first."""
    kept, hidden = list(columns), list[str]()
    for header in (None, *spare):
        if header is not None and any(c.header == header for c in kept):
            kept = [c for c in kept if c.header != header]
            hidden.append(header)
        if widths := _widths(kept, width, 0):
            return Laid(*_block(kept, widths), tuple(hidden))
    if widths := _widths(kept, width, 1):
        return Laid(*_block(kept, widths), tuple(hidden))
    lines, heads = list[str](), set[int]()
    for part in _parts(kept, width, names):
        block, head_lines = _block(part, _widths(part, width, 1) or [c.least[1] for c in part])
        lines += [""] if lines else []
        heads |= {k + len(lines) for k in head_lines}
        lines += block
    return Laid(tuple(lines), frozenset(heads), tuple(hidden))


def _widths(columns: Sequence[Column], width: int, how: int) -> list[int]:
    """Widths with which columns fit, the widest texts folded most; [] where they do not."""
    widths, least = [c.natural for c in columns], [c.least[how] for c in columns]
    room = width - _GAP * (len(columns) - 1)
    if sum(least) > room:
        return []
    while (over := sum(widths) - room) > 0:
        free = [k for k in range(len(columns)) if widths[k] > least[k]]
        widest = max(free, key=lambda k: widths[k] - least[k])
        widths[widest] -= min(over, max(1, (widths[widest] - least[widest]) // 2))
    return widths


def _parts(columns: list[Column], width: int, names: int) -> Iterable[list[Column]]:
    """Columns side by side as far as they fit, the rest below, with the names again."""
    count = min(names, len(columns) - 1)  # else nothing would remain to be shown beside them
    lead, remaining = columns[:count], columns[count:]
    while remaining:
        count = len(remaining)
        while count > 1 and not _widths([*lead, *remaining[:count]], width, 1):
            count -= 1
        yield [*lead, *remaining[:count]]
        remaining = remaining[count:]


def _block(columns: Sequence[Column], widths: Sequence[int]) -> tuple[tuple[str, ...], frozenset[int]]:
    """Lines of columns of these widths, and which are headers."""
    head = _row([_folded(c.header, w) for c, w in zip(columns, widths, strict=True)], columns, widths, True)
    lines = list(head)
    for cells in zip(*(c.cells for c in columns), strict=True):
        parts = [_folded(text, w) if c.text else [text] for text, c, w in zip(cells, columns, widths, strict=True)]
        lines += _row(parts, columns, widths)
    return tuple(lines), frozenset(range(len(head)))


def _row(
    parts: Sequence[Sequence[str]], columns: Sequence[Column], widths: Sequence[int], bottom: bool = False
) -> list[str]:
    """Lines of one row; bottom: what has fewer lines stands in the last ones."""
    height = max(map(len, parts))
    full = [[""] * (height - len(p)) + list(p) if bottom else [*p, *[""] * (height - len(p))] for p in parts]
    lines = []
    for line in zip(*full, strict=True):
        cells = (t.ljust(w) if c.text else t.rjust(w) for t, c, w in zip(line, columns, widths, strict=True))
        lines.append((" " * _GAP).join(cells).rstrip())
    return lines


def _folded(text: str, width: int) -> list[str]:
    """A text in lines; what is longer goes on after `@`, `_` and the like, else anywhere."""
    if len(text) <= width:
        return [text]
    lines = [""]
    for word in _NUMBER_AND_UNIT.sub(_GLUE, text).split(" "):
        if lines[-1] and len(lines[-1]) + 1 + len(word) <= width:
            lines[-1] += f" {word}"
            continue
        lines += [""] if lines[-1] else []
        for piece in _PIECES.findall(word) if len(word) > width else [word]:
            if lines[-1] and len(lines[-1]) + len(piece) > width:
                lines.append("")
            while len(piece) > width:
                lines[-1], piece = piece[:width], piece[width:]
                lines.append("")
            lines[-1] += piece
    return [line.replace(_GLUE, " ") for line in lines if line] or [""]


def _numbers(text: str) -> int:
    """Length of the longest number in a text, with its unit."""
    return max((len(w) for w in _NUMBER_AND_UNIT.sub(_GLUE, text).split(" ") if re.match(r"[-+(]*\d", w)), default=0)
