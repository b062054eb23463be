"""Forms of what controls take: every `Format` of the modules in this folder."""

from __future__ import annotations

from functools import cache

from pkmcal_cli.base.errors import UsageError, did_you_mean
from pkmcal_cli.base.families import members
from pkmcal_cli.correction.export_case import Format

__all__ = ["format_named", "formats"]


@cache
def formats() -> dict[str, Format]:
    """All formats by keyword, in alphabetic order."""
    return members(__name__, __path__, Format)


def format_named(keyword: str) -> Format:
    """The format that `--as` names. Raises UsageError."""
    known = formats()
    if keyword not in known:
        hint = did_you_mean(keyword, known, f"use one of {', '.join(known)}")
        raise UsageError(f"--as: unknown format `{keyword}`", hint=hint)
    return known[keyword]
