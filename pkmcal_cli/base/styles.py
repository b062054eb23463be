"""Faults on a terminal: the place bold, what it is in colour, the help apart; plain text everywhere else."""

from __future__ import annotations

import os
import re
from typing import TextIO

_BOLD, _RED, _YELLOW, _CYAN, _PLAIN = "\x1b[1m", "\x1b[1;31m", "\x1b[33m", "\x1b[36m", "\x1b[0m"
_HEAD = re.compile(r"^(?P<place>.*?: )?(?P<what>(?P<kind>error|warning)\[[\w-]+\]:)", re.MULTILINE)
_HELP = re.compile(r"^help:", re.MULTILINE)
_CARET = re.compile(r"^(\s*)\^$", re.MULTILINE)


def wants_styles(stream: TextIO) -> bool:
    """Whether styles are shown there: a terminal that knows them, and nobody who wants none (https://no-color.org)."""
    try:
        terminal = stream.isatty()
    except (OSError, ValueError):
        return False
    return terminal and not os.environ.get("NO_COLOR") and os.environ.get("TERM", "dumb") not in ("dumb", "unknown")


def styled(text: str) -> str:
    """The text of faults with styles."""
    text = _HEAD.sub(_head, text)
    text = _CARET.sub(rf"\1{_RED}^{_PLAIN}", text)
    return _HELP.sub(f"{_CYAN}help:{_PLAIN}", text)


def _head(match: re.Match[str]) -> str:
    place, colour = match["place"], _RED if match["kind"] == "error" else _YELLOW
    return (f"{_BOLD}{place}{_PLAIN}" if place else "") + f"{colour}{match['what']}{_PLAIN}"
