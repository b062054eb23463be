"""Uncertainties as certificates state them: a constant part, a part that grows with length, a coverage factor."""

from __future__ import annotations

import math
import re
from typing import Any, ClassVar, Generic

from pydantic import Field

from pkmcal_cli.language.fields import SIGMA, Entity, Growth, SensorSigma
from pkmcal_cli.language.quantities import V, WrittenValue, fault
from pkmcal_cli.units.dimensions import NUMBER
from pkmcal_cli.units.unit_text import UnitError, parse_unit, split_value

_COVERAGE = re.compile(r"(?P<rest>.*?)\s*\(\s*k\s*=(?P<k>[^()]*)\)\s*", re.DOTALL)
_PLUS = re.compile(r"\s*((?<![0-9][eE])\+)\s*")  # not that of 1e+3
_EXAMPLE = "write, for example, `10 um + 5 um/m` or `20 um + 10 um/m (k=2)`"
_LENGTH_OVER = re.compile(r"(?<![A-Za-z])L\s*/")


class StatedSigma(Entity, Generic[V]):
    """A standard uncertainty: `constant` + `per_length` times the measured length, a linear sum.

    Written as one value: "10 um", "10 um + 5 um/m", and with the coverage factor of an expanded uncertainty, by which
    all of it is divided, "20 um + 10 um/m (k=2)".
    """

    shorthand: ClassVar[str | None] = "constant"
    one_value: ClassVar[bool] = True

    constant: SensorSigma[V] = Field(description="At length 0")
    per_length: Growth[V] | None = Field(default=None, description="Growth with the measured length")

    @classmethod
    def expanded(cls, raw: Any) -> Any:
        """The two parts of a text; any other value is the constant part."""
        return _parts(raw) if isinstance(raw, str) else super().expanded(raw)


def _parts(text: str) -> dict[str, Any]:
    """The parts of a text. Raises PydanticCustomError."""
    covered = _COVERAGE.fullmatch(text)
    factor = 1.0 if covered is None else _coverage(covered["k"])
    whole = text if covered is None else covered["rest"]
    first, plus, second = _PLUS.split(whole, 1) if _PLUS.search(whole) else (whole, "", "")
    a, b = split_value(first), split_value(second)
    if plus and _LENGTH_OVER.search(second):
        raise fault("unit", f"`{second}` has no unit", "for L/200 um with L in mm write `+ 5 um/m` (1000/200 um/m)")
    if not plus or a is None or b is None or b[1] is None:
        if covered is None:
            return {"constant": text}
        if plus or a is None:
            raise fault("value", f"`{text.strip()}` is not a value with a coverage factor", _EXAMPLE)
        return {"constant": _divided(first, a, factor)}
    return {"constant": _divided(first, a, factor), "per_length": _growth(second, b, factor)}


def _coverage(text: str) -> float:
    """The coverage factor, a number from 1 on."""
    number = split_value(text)
    if number is None or number[1] is not None or not 1 <= number[0] < math.inf:
        raise fault("value", f"`k={text.strip()}` is not a coverage factor", "write, for example, `(k=2)`")
    return number[0]


def _divided(text: str, value: tuple[float, str | None], factor: float) -> WrittenValue:
    number, name = value
    try:
        unit = None if name is None else parse_unit(name)
    except UnitError as error:
        raise fault("unit", error.message, error.hint) from None
    return WrittenValue(text.strip(), SIGMA, None, number / factor, unit)


def _growth(text: str, value: tuple[float, str | None], factor: float) -> WrittenValue:
    written = _divided(text, value, factor)
    if written.unit is not None and written.unit.dimension != NUMBER:
        message = f"`{written.text}` is in units of {written.unit.dimension}; the part that grows is per length"
        raise fault("dimension", message, _EXAMPLE)
    return written
