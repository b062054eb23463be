"""Numbers as metrologists write them, and as JSON may hold them."""

from __future__ import annotations

import math

from pkmcal_cli.language.unit_text import Unit, parse_unit


def uncertain(value: float, std: float | None, unit: str = "", digits: int = 2) -> str:
    """Value with its standard uncertainty in the last digits (GUM 7.2.2): 300.0123(41) mm."""
    tail = f" {unit}" if unit not in ("", "1") else ""
    if std is None or not math.isfinite(std):
        return f"{value:.6g}{tail}"
    if std == 0.0:
        return f"{value!r}(0){tail}"
    decimals = digits - 1 - math.floor(math.log10(std))
    size = round(std * 10**decimals)
    if size >= 10**digits:
        decimals -= 1
        size = round(std * 10**decimals)
    if decimals > 12 or decimals < -3:
        return f"{value:.8g} +- {std:.{digits}g}{tail}"
    if decimals <= 0:
        return f"{round(value, decimals):.0f}({size * 10**-decimals}){tail}"
    return f"{value:.{decimals}f}({size}){tail}"


def finite(value: float | None) -> float | None:
    """A float for JSON: null for what is not finite."""
    return None if value is None or not math.isfinite(value) else float(value)


def short(value: float) -> str:
    """Four significant digits; a dash for nan."""
    return "-" if math.isnan(value) else f"{value:.4g}"


def readable(value: float, unit: Unit) -> str:
    """A length or angle (SI) in the file's unit, or in um or urad where that reads better; a dash for nan."""
    if math.isnan(value):
        return "-"
    small = {"length": ("um", 1e-4), "angle": ("urad", 1e-3)}.get(unit.dimension.name)
    if small is not None and 0 < abs(value) < small[1]:
        unit = parse_unit(small[0])
    return f"{unit.from_si(value):.4g} {unit.text}"
