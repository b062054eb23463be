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
    "effect_at",
]


@cache
def catalogue() -> dict[str, Effect]:
    """All effects by keyword, in alphabetic order."""
    return members(__name__, __path__, Effect)


def effect_at(keyword: str, at: str) -> Effect | None:
    """An effect of the catalogue, or a displacement without a name over the axis of its place; None for other words."""
    from pkmcal_cli.effects.unexplained import UNEXPLAINED, FreeShape, place_and_axis, unexplained

    if keyword == UNEXPLAINED:
        shape = FreeShape(knots=(0.0, 1.0, 2.0), spread=1.0, width=1.0)
        return unexplained("command", shape, place_and_axis(at)[1])
    return catalogue().get(keyword)
