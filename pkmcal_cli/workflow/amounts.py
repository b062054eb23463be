"""Values with units on the command line."""

from __future__ import annotations

import math

from pkmcal_cli.base.errors import UsageError
from pkmcal_cli.units.unit_text import Unit, UnitError, parse_value


def amount(option: str, text: str, own: Unit | None = None) -> tuple[float, Unit]:
    """SI value and unit of a text such as "50 um"; a bare number is in `own`, where it is given. Raises UsageError."""
    try:
        number, unit = parse_value(text)
    except UnitError as error:
        raise UsageError(f"{option}: {error.what}", hint=error.hint) from None
    if own is not None and unit.text == "1":
        unit = own
    value = unit.to_si(number)
    if not math.isfinite(value):
        raise UsageError(f"{option}: `{text}` is too large", hint='a value such as "50 um"')
    return value, unit
