"""Texts that a spreadsheet would run as a formula, or that look like a comment: written behind an apostrophe, and read
without it."""

from __future__ import annotations

import re

_RUN = re.compile(r"'*[=+@#-]")
_NUMBER = re.compile(r"[+-]?[0-9]+(?:[.,][0-9]+)?")  # is shown, not run


def guarded(text: str) -> str:
    """The text as a table holds it; of one that is there like this already, the other apostrophe is kept."""
    return f"'{text}" if _RUN.match(text) and not _NUMBER.fullmatch(text) else text


def bare(cell: str) -> str:
    """The text that `guarded` made a cell of."""
    return cell[1:] if cell.startswith("'") and _RUN.match(cell) else cell
