"""The catalogue of effects: every `Effect` of the modules in this folder."""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache

from pkmcal_cli.effects.base import PORTS, STAGES, WIDTHS, Column, Effect, EffectParameter, Inputs, Option, Port

__all__ = ["PORTS", "STAGES", "WIDTHS", "Column", "Effect", "EffectParameter", "Inputs", "Option", "Port", "catalogue"]


@cache
def catalogue() -> dict[str, Effect]:
    """All effects by keyword, in alphabetic order."""
    found: dict[str, Effect] = {}
    for module in pkgutil.iter_modules(__path__):
        if module.name != "base":
            members = vars(importlib.import_module(f"{__name__}.{module.name}")).values()
            found |= {each.keyword: each for each in members if isinstance(each, Effect)}
    return dict(sorted(found.items()))
