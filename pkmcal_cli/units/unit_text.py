"""The closed table of units, and texts like "kN/mm" or "12 um" read with it."""

from __future__ import annotations

import re
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from math import pi

from pkmcal_cli.base.errors import did_you_mean
from pkmcal_cli.units.dimensions import (
    ANGLE,
    FORCE,
    LENGTH,
    MASS,
    MODULUS,
    NUMBER,
    TEMPERATURE,
    TIME,
    TORQUE,
    Dimension,
)  # fmt: skip
from pkmcal_cli.units.limits import LARGEST, SMALLEST


@dataclass(frozen=True)
class Unit:
    """A unit: SI value = value * factor * pi**pi_power (+ offset), factor exact."""

    text: str
    factor: Fraction
    dimension: Dimension
    pi_power: int = 0
    offset: float = 0.0

    def to_si(self, value: float) -> float:
        """The SI value, rounded as little as possible."""
        result = value * float(self.factor.numerator) / float(self.factor.denominator)
        if self.pi_power:
            result *= pi**self.pi_power
        return result + self.offset if self.offset else result

    def from_si(self, value: float) -> float:
        """The inverse of `to_si`."""
        result = (value - self.offset) if self.offset else value
        if self.pi_power:
            result /= pi**self.pi_power
        return result * float(self.factor.denominator) / float(self.factor.numerator)

    @property
    def scale(self) -> float:
        """SI value of a difference of one unit (no offset)."""
        scale = float(self.factor.numerator) / float(self.factor.denominator)
        return scale * pi**self.pi_power if self.pi_power else scale

    @property
    def difference(self) -> Unit:
        """The unit of differences: degC as K."""
        return Unit(self.text, self.factor, self.dimension, self.pi_power) if self.offset else self

    def format(self, si_value: float, digits: int = 6) -> str:
        """The value in this unit as text, "0.3 mm"."""
        number = f"{self.from_si(si_value):.{digits}g}"
        return f"{number} {self.text}" if self.text not in ("", "1") else number


def _unit(text: str, factor: Fraction | int, dimension: Dimension, pi_power: int = 0) -> Unit:
    return Unit(text, Fraction(factor), dimension, pi_power)


def _table() -> dict[str, Unit]:
    micro = Fraction(1, 10**6)
    units = [
        _unit("1", 1, NUMBER), _unit("%", Fraction(1, 100), NUMBER), _unit("ppm", micro, NUMBER),
        _unit("m", 1, LENGTH), _unit("cm", Fraction(1, 100), LENGTH),
        _unit("mm", Fraction(1, 1000), LENGTH), _unit("um", micro, LENGTH),
        _unit("nm", Fraction(1, 10**9), LENGTH), _unit("km", 1000, LENGTH),
        _unit("rad", 1, ANGLE), _unit("mrad", Fraction(1, 1000), ANGLE),
        _unit("urad", micro, ANGLE), _unit("deg", Fraction(1, 180), ANGLE, 1),
        _unit("arcmin", Fraction(1, 180 * 60), ANGLE, 1),
        _unit("arcsec", Fraction(1, 180 * 3600), ANGLE, 1), _unit("rev", 2, ANGLE, 1),
        _unit("N", 1, FORCE), _unit("mN", Fraction(1, 1000), FORCE), _unit("kN", 1000, FORCE),
        _unit("MN", 10**6, FORCE), _unit("Nm", 1, TORQUE), _unit("Nmm", Fraction(1, 1000), TORQUE),
        _unit("kNm", 1000, TORQUE), _unit("kg", 1, MASS), _unit("g", Fraction(1, 1000), MASS),
        _unit("t", 1000, MASS), _unit("s", 1, TIME), _unit("ms", Fraction(1, 1000), TIME),
        _unit("min", 60, TIME), _unit("h", 3600, TIME), _unit("K", 1, TEMPERATURE),
        Unit("degC", Fraction(1), TEMPERATURE, 0, 273.15),
        _unit("Pa", 1, MODULUS), _unit("kPa", 1000, MODULUS), _unit("MPa", 10**6, MODULUS),
        _unit("GPa", 10**9, MODULUS),
    ]  # fmt: skip
    return {unit.text: unit for unit in units}


UNITS = _table()
"""The closed table of units."""

_ALIASES = {"µm": "um", "μm": "um", "µrad": "urad", "μrad": "urad", "°": "deg", "°C": "degC"}
_TOKEN = re.compile(r"\s*(?:[A-Za-zµμ°%]+|\*\*|[*·/^()²³]|-?\d+)")


class UnitError(ValueError):
    """A text is no unit; `hint` says what may have been meant."""

    def __init__(self, what: str, hint: str | None = None) -> None:
        super().__init__(what)
        self.what = what
        self.hint = hint


@lru_cache(maxsize=1024)
def parse_unit(text: str) -> Unit:
    """The unit that `text` names: "mm", "kN/mm", "N mm/rad", "kg/m^3", "J" is not in the table.

    Products by space or *, quotients by /, powers by ^ or **. Raises `UnitError`.
    """
    stripped = text.strip()
    known = UNITS.get(_ALIASES.get(stripped, stripped))
    if known is not None:
        return known
    if not stripped or len(stripped) > 40:
        raise UnitError("a unit is expected", 'for example "mm", "kN/mm" or "N*m/rad"')
    return _UnitParser(stripped).parse()


class _UnitParser:
    def __init__(self, text: str) -> None:
        self.text = text
        self.tokens: list[str] = []
        at = 0
        while at < len(text):
            match = _TOKEN.match(text, at)
            if match is None:
                raise self.fault()
            self.tokens.append(match.group().strip())
            at = match.end()

    def fault(self, name: str | None = None) -> UnitError:
        if name is None:
            return UnitError(f"`{self.text}` is no unit", 'for example "mm", "kN/mm" or "N*m/rad"')
        whole = "" if name == self.text else f" in `{self.text}`"
        return UnitError(f"unknown unit `{name}`{whole}", did_you_mean(name, UNITS, _KNOWN))

    def parse(self) -> Unit:
        unit = self.product()
        if self.tokens:
            raise self.fault()
        if not SMALLEST < unit.factor < LARGEST:
            raise UnitError(f"`{self.text}` is too large or too small a unit to compute with", "check its powers")
        return Unit(self.text, unit.factor, unit.dimension, unit.pi_power)

    def product(self) -> Unit:
        unit = self.power()
        while self.tokens and self.tokens[0] != ")":
            divide = self.tokens[0] == "/"
            if self.tokens[0] in ("*", "·", "/"):
                self.tokens.pop(0)
            right = self.power()
            unit = _combine(unit, right, -1 if divide else 1)
        return unit

    def power(self) -> Unit:
        unit = self.atom()
        if self.tokens and self.tokens[0] in ("²", "³"):
            return _power(unit, 2 if self.tokens.pop(0) == "²" else 3)
        if self.tokens and self.tokens[0] in ("^", "**"):
            self.tokens.pop(0)
            if not self.tokens or not re.fullmatch(r"-?\d", self.tokens[0]):
                raise self.fault()
            return _power(unit, int(self.tokens.pop(0)))
        return unit

    def atom(self) -> Unit:
        if not self.tokens:
            raise self.fault()
        token = self.tokens.pop(0)
        if token == "(":
            unit = self.product()
            if not self.tokens or self.tokens.pop(0) != ")":
                raise self.fault()
            return unit
        if not (token == "1" or token[0].isalpha() or token[0] in "%°"):
            raise self.fault()
        found = UNITS.get(_ALIASES.get(token, token))
        if found is None:
            raise self.fault(token)
        return found.difference


_KNOWN = "known units: " + ", ".join(u for u in UNITS if u != "1")


def _combine(a: Unit, b: Unit, sign: int) -> Unit:
    dimension = a.dimension * b.dimension if sign > 0 else a.dimension / b.dimension
    return Unit("", a.factor * b.factor**sign, dimension, a.pi_power + sign * b.pi_power)


def _power(unit: Unit, power: int) -> Unit:
    return Unit("", unit.factor**power, unit.dimension**power, unit.pi_power * power)


_VALUE = re.compile(
    r"\s*(?P<number>(?>[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?))\s*(?P<unit>[A-Za-zµμ°%].*)?",
    re.DOTALL,
)


def split_value(text: str) -> tuple[float, str | None] | None:
    """A text "12 um" as (12.0, "um"), "12" as (12.0, None); None if it is no such value."""
    match = _VALUE.fullmatch(text.rstrip())
    if match is None:
        return None
    return float(match["number"]), match["unit"]


def parse_value(text: str) -> tuple[float, Unit]:
    """A text "12 um" as number and unit ("1" when there is none).

    Raises `UnitError` when the text is no number with a unit of the table.
    """
    parts = split_value(text)
    if parts is None:
        raise UnitError(f"`{text}` is no number with a unit", 'for example "12 um"')
    return parts[0], parse_unit(parts[1]) if parts[1] else UNITS["1"]
