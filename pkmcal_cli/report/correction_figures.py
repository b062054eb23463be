"""Figures of corrections in texts and JSON: without what is rounding, and without rows that have none."""

from __future__ import annotations

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.report.number_format import finite, handy, small_unit
from pkmcal_cli.units.unit_text import Unit

NOTHING = "-"
_ROUNDING = 1e-4  # of the unit of what is shown: nothing
_NO_ERROR = 1e-6  # um, urad and N that are rounding


def exact(value: float, least: float = _NO_ERROR) -> float | None:
    """A number for JSON; 0 where it is rounding."""
    return finite(value if abs(value) > least or np.isnan(value) else 0.0)


def shown(value: float, unit: Unit, least: float = _ROUNDING, file_unit: Unit | None = None) -> str:
    """A number, SI, with its unit; 0 up to `least` of the unit, a dash where there is none.

    file_unit: of lengths in the machine file; errors of positions are told in what is usual beside it.
    """
    if np.isnan(value):
        return NOTHING
    size = value if abs(value) > least * unit.scale else 0.0
    if file_unit is not None and file_unit.dimension == unit.dimension:
        unit = small_unit(file_unit)
    return handy(size, unit)


def rms(values: Array) -> float:
    """Of those that are numbers."""
    kept = values[~np.isnan(values)]
    return float(np.sqrt((kept**2).mean())) if len(kept) else float("nan")


def largest(values: Array) -> float:
    """Of those that are numbers."""
    kept = values[~np.isnan(values)]
    return float(kept.max()) if len(kept) else float("nan")


def mean(values: Array) -> float:
    """Of those that are numbers."""
    kept = values[~np.isnan(values)]
    return float(kept.mean()) if len(kept) else float("nan")
