"""Units: dimensions, unit texts and the units of a file.

Inside everything is m, rad, N, kg, K, s. The names of `dimensions` and `unit_text` are offered
here too, so that others import from one place.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction

from pkmcal_cli.units.dimensions import (
    ACCELERATION,
    ANGLE,
    AREA,
    BENDING_STIFFNESS,
    COUPLING_STIFFNESS,
    DENSITY,
    DIMENSIONS,
    FORCE,
    LENGTH,
    MASS,
    MODULUS,
    NUMBER,
    ROTATIONAL_STIFFNESS,
    SECOND_MOMENT,
    STIFFNESS,
    TEMPERATURE,
    TIME,
    TORQUE,
    Dimension,
)  # fmt: skip
from pkmcal_cli.units.unit_text import UNITS, Unit, UnitError, parse_unit, parse_value, split_value

__all__ = [
    "ACCELERATION", "ANGLE", "AREA", "BASE_DIMENSIONS", "BENDING_STIFFNESS", "COUPLING_STIFFNESS",
    "DENSITY", "DIMENSIONS", "FORCE", "LENGTH", "MASS", "MODULUS", "NUMBER",
    "ROTATIONAL_STIFFNESS", "SECOND_MOMENT", "SI", "STIFFNESS", "TEMPERATURE", "TIME", "TORQUE",
    "UNITS", "Dimension", "FileUnits", "Unit", "UnitError", "parse_unit", "parse_value",
    "split_value",
]  # fmt: skip

BASE_DIMENSIONS = {
    "length": LENGTH, "angle": ANGLE, "force": FORCE, "mass": MASS, "time": TIME,
    "temperature": TEMPERATURE,
}  # fmt: skip
"""The keys of `units:` and their dimensions."""


@dataclass(frozen=True, kw_only=True)
class FileUnits:
    """The units of bare numbers in a file; the other units are derived from these.

    Stiffness is force/length, torque force*length; compound units take rad; accelerations are
    always m/s^2.
    """

    length: Unit = UNITS["m"]
    angle: Unit = UNITS["rad"]
    force: Unit = UNITS["N"]
    mass: Unit = UNITS["kg"]
    time: Unit = UNITS["s"]
    temperature: Unit = UNITS["degC"]
    _cache: dict[Dimension, Unit] = field(default_factory=dict, init=False, repr=False, compare=False)

    @classmethod
    def of(cls, texts: Mapping[str, str]) -> FileUnits:
        """From unit texts by key; raises `UnitError` for an unknown or unfitting unit."""
        units = {}
        for key, text in texts.items():
            unit = parse_unit(text)
            if unit.dimension != BASE_DIMENSIONS[key]:
                raise UnitError(f"`{text}` is a unit of {unit.dimension}, not of {key}")
            units[key] = unit
        return cls(**units)

    def unit(self, dimension: Dimension) -> Unit:
        """The unit of a bare number of this dimension."""
        known = self._cache.get(dimension)
        if known is None:
            known = self._cache[dimension] = self._derive(dimension)
        return known

    def _derive(self, dimension: Dimension) -> Unit:
        for key, base in BASE_DIMENSIONS.items():
            if dimension == base:
                unit: Unit = getattr(self, key)
                return unit
        if dimension == ACCELERATION:
            return parse_unit("m/s^2")
        forces = -dimension.time / 2
        powers = [
            (self.force, forces),
            (self.mass, dimension.mass - forces),
            (self.length, dimension.length - forces),
            (UNITS["rad"], dimension.angle),
            (self.temperature.difference, dimension.temperature),
        ]
        return _compose(powers, dimension)


def _compose(powers: list[tuple[Unit, float]], dimension: Dimension) -> Unit:
    """The product of powers of units as one unit with a text like "N*mm/rad"."""
    above: list[str] = []
    below: list[str] = []
    factor, pi_power = Fraction(1), 0
    for unit, power in powers:
        if not power:
            continue
        size = f"{abs(power):g}"
        text = unit.text if size == "1" else f"{unit.text}^{size}"
        (above if power > 0 else below).append(text)
        if power == int(power):
            factor *= unit.factor ** int(power)
        else:
            factor *= Fraction(float(unit.factor) ** power)
        pi_power += int(unit.pi_power * power)
    text = "*".join(above) or "1"
    if below:
        text += "/" + ("*".join(below) if len(below) == 1 else f"({'*'.join(below)})")
    return Unit(text, factor, dimension, pi_power)


SI = FileUnits()
"""m, rad, N, kg, s (temperatures in degC)."""
