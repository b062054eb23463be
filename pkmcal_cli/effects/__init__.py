"""The catalogue of effects: every `Effect` of the modules in this folder."""

from __future__ import annotations

from functools import cache

from pkmcal_cli.base.families import members
from pkmcal_cli.effects.effect import (
    ABSENT,
    ENTRIES,
    FRAME_PARTS,
    KINDS,
    STAGES,
    WIDTHS,
    Column,
    Effect,
    EffectParameter,
    Entry,
    Inputs,
    Option,
)

__all__ = [
    "ABSENT",
    "ENTRIES",
    "FRAME_PARTS",
    "KINDS",
    "STAGES",
    "WIDTHS",
    "Column",
    "Effect",
    "EffectParameter",
    "Entry",
    "Inputs",
    "Option",
    "catalogue",
]


@cache
def catalogue() -> dict[str, Effect]:
    """All effects by keyword, in alphabetic order."""
    return members(__name__, __path__, Effect)
