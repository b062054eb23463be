"""Values with units on the command line."""

from __future__ import annotations

import math

from pkmcal_cli.base.errors import UsageError
from pkmcal_cli.units.dimensions import Dimension
from pkmcal_cli.units.unit_text import Unit, UnitError, parse_value


def amount(
    option: str, text: str, expected: Unit | None = None, fitting: tuple[Dimension, ...] = ()
) -> tuple[float, Unit]:
    """SI value and unit of e.g. "50 um"; a bare number is in `expected`, if that is stated. Raises UsageError.

    `fitting`: the dimensions that are expected, where not that of `expected`; another one is left to the caller.
    """
    try:
        number, unit = parse_value(text, fitting or (() if expected is None else (expected.dimension,)))
    except UnitError as error:
        raise UsageError(f"{option}: {error.message}", hint=error.hint or 'give a value such as "50 um"') from None
    if expected is not None and unit.text == "1":
        unit = expected
    value = unit.to_si(number)
    if not math.isfinite(value):
        raise UsageError(f"{option}: `{text}` is too large", hint='give a value such as "50 um"')
    return value, unit
