"""Remarks of programs, in lines that controls read."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable

_LONGEST = 240  # bytes: LinuxCNC refuses programs with a line of more than 252, remarks too (LINELEN)
_CHARACTER = 4  # bytes of one in UTF-8, at most


def remark_lines(mark: str, remarks: Iterable[str]) -> list[str]:
    """Lines that begin with the mark and a blank; what is longer goes on in the next one."""
    lines: list[str] = []
    for remark in remarks:
        width = _LONGEST if remark.isascii() else _LONGEST // _CHARACTER
        parts = textwrap.wrap(remark, width, drop_whitespace=False, break_on_hyphens=False)
        lines += [f"{mark} {part}" for part in parts or [""]]
    return lines
