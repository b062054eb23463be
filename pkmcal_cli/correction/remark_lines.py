"""Remarks of programs, in lines that controls read and do nothing about."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable

_LONGEST = 240  # bytes: LinuxCNC refuses programs with a line of more than 252, remarks too (LINELEN)
_CHARACTER = 4  # bytes of one in UTF-8, at most
_ACTIVE = re.compile(
    r"\s*(msg|debug|print|log|logopen|logappend|logclose|probeopen|probeclose|py|pyrun|pyreload|abort|system)\b", re.I
)  # what LinuxCNC carries out, in a remark (Interp::convert_comment)


def remark_lines(mark: str, remarks: Iterable[str]) -> list[str]:
    """Lines that begin with the mark and a blank; what is longer goes on in the next one.

    Names of others cannot be words that a control acts upon: these stand behind a point.
    """
    lines: list[str] = []
    for remark in remarks:
        width = _LONGEST if remark.isascii() else _LONGEST // _CHARACTER
        parts = textwrap.wrap(remark, width, drop_whitespace=False, break_on_hyphens=False)
        lines += [f"{mark} {'. ' if _ACTIVE.match(part) else ''}{part}" for part in parts or [""]]
    return lines
