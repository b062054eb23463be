"""Units with a name of their own: `unit: {step: 1.25 um}` of a drive or sensor that reads steps or counts.

Such a unit is known to the entry that names it and to the column of its readings. Where it stands behind a number in
the entry, its definition is put in its place, so that the value says by itself what it is.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from typing import Any

from pkmcal_cli.language.quantities import Quantity, fault, kind_of
from pkmcal_cli.units.unit_text import UnitError, parse_unit

UNIT_SCHEMA = {
    "anyOf": [
        {"type": "string"},
        {"type": "object", "minProperties": 1, "maxProperties": 1, "additionalProperties": {"type": "string"}},
    ]
}
_EXAMPLE = "write, for example, `unit: {step: 1.25 um}`"


def unit_definition(raw: Any) -> Any:
    """The value of a key `unit` as a text that `parse_unit` reads. Raises PydanticCustomError."""
    if isinstance(raw, str):
        return _known(raw)
    if not isinstance(raw, dict):
        return raw
    if len(raw) != 1:
        raise fault("unit", f"expected one name with its size, found {len(raw)}", _EXAMPLE)
    ((name, size),) = raw.items()
    if not isinstance(size, str):
        raise fault("unit", f"the size of `{name}` needs a unit, found {kind_of(size)}", _EXAMPLE)
    try:
        return parse_unit(f"{name}={size}").definition
    except UnitError as error:
        raise fault("unit", error.message, error.hint) from None


def _known(text: str) -> str:
    """A unit of the table."""
    if "=" in text:
        raise fault("unit", f"`{text}` is not a unit", _EXAMPLE)
    try:
        parse_unit(text)
    except UnitError as error:
        more = f"; or give its size: `unit: {{{text}: 1.25 um}}`" if text.isalpha() else ""
        raise fault("unit", error.message, f"{error.hint}{more}") from None
    return text


def with_definition(raw: Any, keys: Collection[str]) -> Any:
    """An entry whose values at some keys have the definition of its own unit behind their numbers, not its name."""
    unit = raw.get("unit") if isinstance(raw, dict) else None
    if not isinstance(unit, dict) or len(unit) != 1:
        return raw
    ((name, size),) = unit.items()
    named = re.compile(rf"(?<=[0-9.])(?P<gap>\s*){re.escape(str(name))}(?![A-Za-z=/*^])")
    try:
        definition = parse_unit(f"{name}={size}").definition
    except UnitError:
        definition = ""  # told at the key itself
    return {key: _defined(value, named, definition) if key in keys else value for key, value in raw.items()}


def _defined(value: Any, named: re.Pattern[str], definition: str) -> Any:
    if isinstance(value, str):
        return named.sub(lambda match: f"{match['gap']}{definition}", value)
    if isinstance(value, tuple):
        return tuple(_defined(each, named, definition) for each in value)
    if isinstance(value, Mapping):
        return {key: _defined(each, named, definition) for key, each in value.items()}
    return value


def in_steps(quantity: Quantity) -> bool:
    """Whether a quantity was written in the entry's own unit."""
    return "=" in quantity.text
