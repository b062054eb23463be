"""The terminal: tables and messages on stderr, JSON on stdout."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Sequence
from typing import Any

from rich.console import Console
from rich.table import Table

_BAR = 24
_WIDTH = 160  # of tables that do not go to a terminal


class Reporter:
    """Writes for people to stderr, unless quiet."""

    def __init__(self, quiet: bool = False) -> None:
        wide = None if sys.stderr.isatty() else _WIDTH
        self.console = Console(stderr=True, quiet=quiet, soft_wrap=True, highlight=False, width=wide)

    def say(self, text: str = "") -> None:
        """A line."""
        self.console.print(text, markup=False)

    def notes(self, notes: Iterable[str]) -> None:
        """Announcements."""
        for note in notes:
            self.console.print(f"note: {note}", markup=False, style="dim")

    def warn(self, text: str) -> None:
        """A warning."""
        self.console.print(text, markup=False, style="yellow")

    def table(self, title: str, headers: Sequence[str], rows: Iterable[Sequence[str]], left: int = 1) -> None:
        """A table; the first `left` columns are text."""
        table = Table(title=title, title_justify="left", box=None, pad_edge=False, header_style="bold")
        for k, header in enumerate(headers):
            text = k < left or header in ("remark", "")
            table.add_column(header, justify="left" if text else "right", no_wrap=header != "remark")
        for row in rows:
            table.add_row(*(cell.replace("[", "\\[") for cell in row))
        self.console.print(table)


def bar(share: float, width: int = _BAR) -> str:
    """A horizontal bar of a share between 0 and 1."""
    eighths = round(max(0.0, min(1.0, share)) * width * 8)
    full, rest = divmod(eighths, 8)
    return "\u2588" * full + (" \u258f\u258e\u258d\u258c\u258b\u258a\u2589"[rest] if rest else "")


def emit_json(result: dict[str, Any]) -> None:
    """The result on stdout."""
    json.dump(result, sys.stdout, indent=2, allow_nan=False, ensure_ascii=False)
    sys.stdout.write("\n")
    sys.stdout.flush()
