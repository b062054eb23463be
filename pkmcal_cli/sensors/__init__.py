"""The kinds of sensors: every `SensorKind` of the modules in this folder."""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache

from pkmcal_cli.sensors.base import WIDTHS, SensorKind, Sight, derivatives, read

__all__ = ["WIDTHS", "SensorKind", "Sight", "derivatives", "read", "sensor_kinds"]


@cache
def sensor_kinds() -> dict[str, SensorKind]:
    """All kinds by keyword, in alphabetic order."""
    found: dict[str, SensorKind] = {}
    for module in pkgutil.iter_modules(__path__):
        if module.name != "base":
            members = vars(importlib.import_module(f"{__name__}.{module.name}")).values()
            found |= {each.keyword: each for each in members if isinstance(each, SensorKind)}
    return dict(sorted(found.items()))
