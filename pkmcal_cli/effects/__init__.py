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
    "effect_named",
]


@cache
def catalogue() -> dict[str, Effect]:
    """All effects by keyword, in alphabetic order."""
    return members(__name__, __path__, Effect)


def effect_named(keyword: str) -> Effect | None:
    """An effect of the catalogue, or a displacement without a name; None for other words."""
    from pkmcal_cli.effects.unexplained import UNEXPLAINED, FreeShape, unexplained

    if keyword == UNEXPLAINED:
        return unexplained("command", FreeShape(knots=(0.0, 1.0, 2.0), spread=1.0, width=1.0))
    return catalogue().get(keyword)
