"""The catalogue of effects: every `Effect` of the modules in this folder."""

from __future__ import annotations

from functools import cache

from pkmcal_cli.base.families import members
from pkmcal_cli.effects.base import PORTS, STAGES, WIDTHS, Column, Effect, EffectParameter, Inputs, Option, Port

__all__ = ["PORTS", "STAGES", "WIDTHS", "Column", "Effect", "EffectParameter", "Inputs", "Option", "Port", "catalogue"]


@cache
def catalogue() -> dict[str, Effect]:
    """All effects by keyword, in alphabetic order."""
    return members(__name__, __path__, Effect)
