"""The closed table of units, and texts like "kN/mm" or "12 um" read with it."""

from __future__ import annotations

import difflib
import re
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from math import pi

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
from pkmcal_cli.units.letters import digits_hint
from pkmcal_cli.units.limits import LARGEST, SMALLEST


@dataclass(frozen=True)
class Unit:
    """A unit: SI value = value * factor * pi**pi_power (+ offset), factor exact.

    `size`: that of a unit with a name of its own, "1.25 um" of a step; "" for those of the table.
    """

    text: str
    factor: Fraction
    dimension: Dimension
    pi_power: int = 0
    offset: float = 0.0
    size: str = ""

    @property
    def definition(self) -> str:
        """A text that `parse_unit` reads wherever it stands: "mm", "step=1.25 um"."""
        return f"{self.text}={self.size}" if self.size else self.text

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
        _unit("1", 1, NUMBER), _unit("%", Fraction(1, 100), NUMBER), _unit("ppm", micro, NUMBER), _unit("m", 1, LENGTH),
        _unit("cm", Fraction(1, 100), LENGTH), _unit("mm", Fraction(1, 1000), LENGTH), _unit("um", micro, LENGTH),
        _unit("nm", Fraction(1, 10**9), LENGTH), _unit("km", 1000, LENGTH), _unit("in", Fraction(254, 10**4), LENGTH),
        _unit("rad", 1, ANGLE), _unit("mrad", Fraction(1, 1000), ANGLE), _unit("urad", micro, ANGLE),
        _unit("deg", Fraction(1, 180), ANGLE, 1), _unit("arcmin", Fraction(1, 180 * 60), ANGLE, 1),
        _unit("arcsec", Fraction(1, 180 * 3600), ANGLE, 1), _unit("rev", 2, ANGLE, 1), _unit("N", 1, FORCE),
        _unit("mN", Fraction(1, 1000), FORCE), _unit("kN", 1000, FORCE), _unit("MN", 10**6, FORCE),
        _unit("lbf", Fraction(44482216152605, 10**13), FORCE), _unit("Nm", 1, TORQUE),
        _unit("Nmm", Fraction(1, 1000), TORQUE), _unit("kNm", 1000, TORQUE), _unit("MNm", 10**6, TORQUE),
        _unit("kg", 1, MASS), _unit("g", Fraction(1, 1000), MASS), _unit("t", 1000, MASS), _unit("s", 1, TIME),
        _unit("ms", Fraction(1, 1000), TIME), _unit("min", 60, TIME), _unit("h", 3600, TIME),
        _unit("K", 1, TEMPERATURE), Unit("degC", Fraction(1), TEMPERATURE, 0, 273.15), _unit("Pa", 1, MODULUS),
        _unit("kPa", 1000, MODULUS), _unit("MPa", 10**6, MODULUS), _unit("GPa", 10**9, MODULUS),
    ]  # fmt: skip
    return {unit.text: unit for unit in units}


UNITS = _table()  # all that there are

_ALIASES = {"µm": "um", "μm": "um", "µrad": "urad", "μrad": "urad", "°": "deg", "°C": "degC", "inch": "in"}
_CONVERTED = dict.fromkeys(("degf", "°f", "f"), ("degC", "degrees Fahrenheit: (F - 32)/1.8"))
_CONVERTED |= dict.fromkeys(("gon", "grad"), ("deg", "gon, or grad: 1 gon is 0.9 deg"))
_WORDS = tuple(alias for alias in _ALIASES if alias.isascii())
_TOKEN = re.compile(r"\s*(?:[A-Za-zµμ°%]+|\*\*|[*·/^()²³]|-?\d+)")


class UnitError(ValueError):
    """A text is no unit; `hint` says what may have been meant."""

    def __init__(self, message: str, hint: str | None = None) -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint


@lru_cache(maxsize=1024)
def parse_unit(text: str, fitting: tuple[Dimension, ...] = ()) -> Unit:
    """The unit that `text` names: "mm", "kN/mm", "N mm/rad", "kg/m^3", "J" is not in the table.

    Products by space or *, quotients by /, powers by ^ or **. "step=1.25 um" is a unit with a name of its own.
    `fitting`: the dimensions of which a unit is expected, where that is known; the hint of an error names only units
    that fit. A known unit of another dimension is no error. Raises `UnitError`.
    """
    stripped = text.strip()
    name, equals, size = stripped.partition("=")
    if equals:
        return _named(name.strip(), size.strip())
    known = UNITS.get(_ALIASES.get(stripped, stripped))
    if known is not None:
        return known
    if not stripped or len(stripped) > 40:
        raise UnitError("expected a unit", _EXAMPLE)
    return _UnitParser(stripped, fitting).parse()


_EXAMPLE = 'write, for example, "mm", "kN/mm" or "N*m/rad"; combine units with `*`, `/`, `^` or `**`'
_SHORT = 2  # letters: almost every unit is near to a name as short as that
_NEAR = 0.75  # likeness (`difflib`): most units are so short that one is in many a word, as `in` is in `minn`
_NAME = re.compile(r"[A-Za-z]{1,20}")
_DIGITS = r"[+-]?(?:\d{1,30}\.?\d{0,30}|\.\d{1,30})(?:[eE][+-]?\d{1,3})?"
_SIZE = re.compile(rf"(?P<above>{_DIGITS})\s*(?:/\s*(?P<below>{_DIGITS})\s*)?(?P<unit>[A-Za-zµμ°%].{{0,20}})")
_SIZE_HINT = "write, for example, `{step: 1.25 um}` or `{count: 1/4096 rev}`"


def _named(name: str, size: str) -> Unit:
    """A unit with a name of its own and a size such as "1.25 um" or "1/4096 rev". Raises `UnitError`."""
    if not _NAME.fullmatch(name):
        raise UnitError(f"`{name}` is not a name for a unit", "use a word of letters, for example `step` or `count`")
    if name in UNITS:
        raise UnitError(f"`{name}` is a unit already", "use another word, for example `step` or `count`")
    match = _SIZE.fullmatch(size)
    below = Fraction(1) if match is None else Fraction(match["below"] or "1")
    if match is None or not below:
        raise UnitError(f"`{size}` is not the size of a unit", _SIZE_HINT)
    unit = parse_unit(match["unit"])
    factor = unit.factor * Fraction(match["above"]) / below
    if not SMALLEST < factor < LARGEST:
        message = f"the size `{size}` of a unit must be positive, and neither too large nor too small"
        raise UnitError(message, _SIZE_HINT)
    return Unit(name, factor, unit.dimension, unit.pi_power, size=size)


def _as_written_here(text: str) -> str:
    """What may have been meant by "kN.m/rad" or "N/mm2", which are written otherwise; else an example."""
    meant = re.sub(r"(?<=[A-Za-z])(?=\d)", "^", re.sub(r"(?<=[A-Za-z])\.(?=[A-Za-z])", "*", text))
    with suppress(UnitError):
        return f"did you mean `{meant}`?" if meant != text and parse_unit(meant) else _EXAMPLE
    return _EXAMPLE


class _UnitParser:
    def __init__(self, text: str, fitting: tuple[Dimension, ...] = ()) -> None:
        self.text = text
        self.fitting = fitting
        self.tokens: list[str] = []
        at = 0
        while at < len(text):
            match = _TOKEN.match(text, at)
            if match is None:
                raise self.fault()
            self.tokens.append(match.group().strip())
            at = match.end()
        self.all = tuple(self.tokens)

    def fault(self, name: str | None = None) -> UnitError:
        if name is None:
            return UnitError(f"`{self.text}` is not a unit", _as_written_here(self.text))
        whole = "" if name == self.text else f" in `{self.text}`"
        return UnitError(f"unknown unit `{name}`{whole}", self.suggestion(name))

    def suggestion(self, name: str) -> str | None:
        """What may have been meant by the token `name`, the last one taken; None where no unit in its place fits."""
        meant, formula = _CONVERTED.get(name.lower(), ("", ""))
        if meant and self.would_fit(meant):
            return f"did you mean `{meant}`? Convert {formula}"
        names = [unit for unit in (*UNITS, *_WORDS) if self.would_fit(unit)]
        if not names:
            return None
        near = [unit for unit in names if unit.lower() == name.lower()]
        if not near and len(name) > _SHORT:
            near = difflib.get_close_matches(name, names, n=1, cutoff=_NEAR)
        if near:
            return f"did you mean `{near[0]}`?"
        listed = "use one of " + ", ".join(unit for unit in names if unit in UNITS and unit != "1")
        return f"write a plain number, or {listed}" if self.fitting and "1" in names and name == self.text else listed

    def would_fit(self, unit: str) -> bool:
        """Whether the text has a dimension that is expected with `unit` in the place of the last token taken."""
        if not self.fitting:
            return True
        last = len(self.all) - len(self.tokens) - 1
        try:
            made = parse_unit(" ".join((*self.all[:last], unit, *self.all[last + 1 :])))
        except UnitError:
            return False
        return any(made.dimension.fits(dimension) for dimension in self.fitting)

    def parse(self) -> Unit:
        unit = self.product()
        if self.tokens:
            raise self.fault()
        if not SMALLEST < unit.factor < LARGEST:
            raise UnitError(f"the unit `{self.text}` is too large or too small to compute with", "check its powers")
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
        known = UNITS.get(_ALIASES.get(token, token))
        if known is None:
            raise self.fault(token)
        return known.difference


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


def parse_value(text: str, fitting: tuple[Dimension, ...] = ()) -> tuple[float, Unit]:
    """A text "12 um" as number and unit ("1" when there is none); `fitting` as in `parse_unit`. Raises UnitError."""
    if (parts := split_value(text)) is None:
        hint = " a decimal point, not a comma" if split_value(text.replace(",", ".", 1)) else ', for example, "12 um"'
        raise UnitError(f"`{text}` is not a number with a unit", f"write{hint}")
    try:
        return parts[0], parse_unit(parts[1], fitting) if parts[1] else UNITS["1"]
    except UnitError as error:
        raise UnitError(error.message, digits_hint(text) or error.hint) from None
