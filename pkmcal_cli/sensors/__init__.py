"""The kinds of sensors: every `SensorKind` of the modules in this folder."""

from __future__ import annotations

from functools import cache

from pkmcal_cli.base.families import members
from pkmcal_cli.sensors.sensor_kind import WIDTHS, SensorKind, Variable, derivatives, read

__all__ = ["WIDTHS", "SensorKind", "Variable", "derivatives", "read", "sensor_kinds"]


@cache
def sensor_kinds() -> dict[str, SensorKind]:
    """All kinds by keyword, in alphabetic order."""
    return members(__name__, __path__, SensorKind)
