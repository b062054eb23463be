"""Values with units on the command line."""

from __future__ import annotations

import math

from pkmcal_cli.base.errors import UsageError
from pkmcal_cli.base.plural import with_article
from pkmcal_cli.units.dimensions import ANGLE, FORCE, LENGTH, NUMBER, Dimension
from pkmcal_cli.units.unit_text import Unit, UnitError, parse_value

_SMALL = {LENGTH: "20 um", ANGLE: "50 urad", FORCE: "5 N"}


def small_example(unit: Unit) -> str:
    """A small value of a unit's dimension, as one writes it."""
    return _SMALL.get(unit.dimension, f"5 {unit.difference.text}")


def small_amount(dimension: Dimension) -> str:
    """A small value of a dimension, in words where none is at hand."""
    return _SMALL.get(dimension, with_article(dimension.name))


def require_unit(option: str, text: str, stated: Unit, expected: Unit) -> None:
    """A value of a parameter that has a dimension was stated with a unit. Raises UsageError."""
    if stated.dimension == NUMBER != expected.dimension:
        hint = f'give it with its unit, for example "{small_example(expected)}"'
        raise UsageError(f"{option}: `{text}` has no unit", hint=hint)


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
