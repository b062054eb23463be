"""Numbers as metrologists write them, and as JSON may hold them."""

from __future__ import annotations

import math
from collections.abc import Iterable

from pkmcal_cli.units.unit_text import Unit, parse_unit

_ROUNDING = 1e-9  # of a range: nobody states a value that is so near zero


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
    value = round(value, decimals) or 0.0  # no minus before what is rounded to nothing
    if decimals > 12 or decimals < -3:
        return f"{value:.8g} +- {std:.{digits}g}{tail}"
    if decimals <= 0:
        return f"{value:.0f}({size * 10**-decimals}){tail}"
    return f"{value:.{decimals}f}({size}){tail}"


def unknown(value: float, spread: float, unit: str = "") -> str:
    """A value that nothing determines, to a hundredth of what is thought of it, marked as such: 250.001(?) mm."""
    tail = f" {unit}" if unit not in ("", "1") else ""
    if not (math.isfinite(spread) and spread > 0.0):
        return f"{value:.6g}(?){tail}"
    decimals = min(max(2 - math.floor(math.log10(spread)), 0), 12)
    return f"{round(value, decimals) or 0.0:.{decimals}f}(?){tail}"


def nominal_number(value: float, spread: float) -> str:
    """A nominal value to eight digits; 0 where it is what rounding leaves of an expression, whatever its range."""
    return f"{0.0 if abs(value) < _ROUNDING * spread else value:.8g}"


def finite(value: float | None) -> float | None:
    """A float for JSON: null for what is not finite."""
    return None if value is None or not math.isfinite(value) else float(value)


def short(value: float) -> str:
    """Four significant digits; a dash for nan."""
    return "-" if math.isnan(value) else to_digits(value, 4)


def readable(value: float, unit: Unit, like: float | None = None) -> str:
    """A length or angle (SI) in the file's unit, or in um or urad where that reads better, beside inches never.

    A dash for nan. `like`: another value that chooses the unit, so that the two can be compared.
    """
    if math.isnan(value):
        return "-"
    small = {"length": 1e-4, "angle": 1e-3}.get(unit.dimension.name)
    if small is not None and 0 < abs(value if like is None else like) < small:
        unit = small_unit(unit)
    return f"{to_digits(unit.from_si(value), 4)}{'' if unit.text == '1' else f' {unit.text}'}"


def small_unit(unit: Unit) -> Unit:
    """The unit of small lengths or angles in a file with this one: um, the inch itself, urad."""
    return unit if unit.text == "in" else parse_unit({"length": "um", "angle": "urad"}[unit.dimension.name])


def plain_number(value: float) -> str:
    """A number as people write it: 0.001, 20, 5000; powers of ten only where it is longer than nine figures."""
    text = f"{value:.12f}".rstrip("0").rstrip(".") if 1e-7 <= abs(value) < 1e9 else f"{value:g}"
    return text or "0"


def to_digits(value: float, digits: int) -> str:
    """A number rounded to so many digits, as people write it."""
    return plain_number(float(f"{value:.{digits}g}"))


def three_digits(value: float) -> str:
    """A number rounded to three digits."""
    return to_digits(value, 3)


_LARGER = {"um": "mm", "mm": "m", "urad": "mrad", "um/m": "mm/m", "urad/rad": "mrad/rad", "N": "kN"}
_SMALLER = {"m": "mm", "mm": "um", "rad": "mrad", "mrad": "urad", "mm/m": "um/m", "kN": "N", "kg": "g"}
_LONG = 1e4  # of a unit: so many micrometres are read as millimetres
NEVER = 1e4  # times the plausible size: no machine has so large an effect
_SEVERAL = 2.0  # times the plausible size: from there on multiples read better than percent


def handy(value: float, unit: Unit) -> str:
    """An amount (SI) to three digits, in the unit or in one of its multiples, without powers of ten where possible."""
    while abs(value) >= 999.5 * unit.scale and unit.text in _LARGER:
        unit = parse_unit(_LARGER[unit.text])
    while 0 < abs(value) < 0.0995 * unit.scale and unit.text in _SMALLER:
        unit = parse_unit(_SMALLER[unit.text])
    return f"{three_digits(value / unit.scale)}{'' if unit.text == '1' else f' {unit.text}'}"


def unit_of_size(value: float, unit: Unit, file_units: Iterable[Unit]) -> Unit:
    """The unit in which the size (SI) of an effect is told: its own, or if that takes five digits and more the file's
    (one of `file_units`, of its dimension), else a multiple: 25 deg instead of 436000 urad."""
    if abs(value) < _LONG * unit.scale:
        return unit
    larger = [u for u in file_units if u.dimension == unit.dimension and u.scale > unit.scale]
    if larger and unit.dimension.name in ("length", "angle"):
        return larger[0]
    while abs(value) >= _LONG * unit.scale and unit.text in _LARGER:
        unit = parse_unit(_LARGER[unit.text])
    return unit


def detectable_size(value: float, plausible: float, unit: Unit) -> str:
    """A smallest detectable size (SI); "never" where it is beyond all that is plausible."""
    return handy(value, unit) if value < NEVER * plausible else "never"


def plausible_share(share: float) -> str:
    """A smallest detectable size over the plausible one; "never" where it is beyond all that is plausible."""
    if not share < NEVER:
        return "never"
    if share < _SEVERAL:
        return f"{100 * share:.3g} % of the plausible size"
    return f"{float(f'{share:.2g}'):.0f} times the plausible size"
