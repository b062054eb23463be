"""Keywords of the catalogue, for those who type them."""

from __future__ import annotations

from pkmcal_cli.effects import catalogue


def keywords_like(begin: str) -> list[str]:
    """Keywords that begin with some letters, in alphabetic order."""
    return [keyword for keyword in catalogue() if keyword.startswith(begin)]
