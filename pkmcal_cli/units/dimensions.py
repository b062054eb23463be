"""Dimensions of quantities: exponents of length, mass, time, angle and temperature.

Angle is a dimension for the checks (rad = 1), so that an angle is not taken for a length or a
plain number.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Dimension:
    """Exponents of length, mass, time, angle and temperature."""

    length: float = 0.0
    mass: float = 0.0
    time: float = 0.0
    angle: float = 0.0
    temperature: float = 0.0

    @property
    def exponents(self) -> tuple[float, float, float, float, float]:
        """(length, mass, time, angle, temperature)."""
        return (self.length, self.mass, self.time, self.angle, self.temperature)

    def __mul__(self, other: Dimension) -> Dimension:
        return Dimension(*(a + b for a, b in zip(self.exponents, other.exponents, strict=True)))

    def __truediv__(self, other: Dimension) -> Dimension:
        return Dimension(*(a - b for a, b in zip(self.exponents, other.exponents, strict=True)))

    def __pow__(self, power: float) -> Dimension:
        return Dimension(*(round(a * power * 60) / 60 for a in self.exponents))

    @property
    def without_angle(self) -> Dimension:
        """The same with rad = 1."""
        return Dimension(self.length, self.mass, self.time, 0.0, self.temperature)

    def fits(self, other: Dimension) -> bool:
        """Equal; between compound dimensions rad = 1 (an arc r*angle is a length)."""
        if self == other:
            return True
        plain = self.without_angle
        return plain != NUMBER and plain == other.without_angle

    @property
    def name(self) -> str:
        """What a person calls it: "length", "stiffness", else its SI unit."""
        return _NAMES.get(self) or _si_text(self)

    def __str__(self) -> str:
        return self.name


NUMBER = Dimension()
LENGTH = Dimension(length=1)
MASS = Dimension(mass=1)
TIME = Dimension(time=1)
ANGLE = Dimension(angle=1)
TEMPERATURE = Dimension(temperature=1)
AREA = LENGTH**2
SECOND_MOMENT = LENGTH**4
ACCELERATION = LENGTH / TIME**2
FORCE = MASS * ACCELERATION
TORQUE = FORCE * LENGTH
STIFFNESS = FORCE / LENGTH
COUPLING_STIFFNESS = FORCE / ANGLE
ROTATIONAL_STIFFNESS = TORQUE / ANGLE
MODULUS = FORCE / AREA
DENSITY = MASS / LENGTH**3
BENDING_STIFFNESS = FORCE * AREA

DIMENSIONS: dict[str, Dimension] = {
    "scale": NUMBER,
    "length": LENGTH,
    "angle": ANGLE,
    "force": FORCE,
    "torque": TORQUE,
    "mass": MASS,
    "time": TIME,
    "temperature": TEMPERATURE,
    "stiffness": STIFFNESS,
    "rotational_stiffness": ROTATIONAL_STIFFNESS,
    "coupling_stiffness": COUPLING_STIFFNESS,
    "bending_stiffness": BENDING_STIFFNESS,
    "modulus": MODULUS,
    "density": DENSITY,
    "area": AREA,
    "second_moment": SECOND_MOMENT,
    "acceleration": ACCELERATION,
}
"""The dimensions that have a name (keys of `ranges:`)."""

_NAMES = {dimension: name.replace("_", " ") for name, dimension in DIMENSIONS.items()}
_NAMES[NUMBER] = "plain number"


def _si_text(dimension: Dimension) -> str:
    """A dimension without a name, "m^3*kg/s^2"."""
    parts = []
    for symbol, power in zip(("m", "kg", "s", "rad", "K"), dimension.exponents, strict=True):
        if power:
            parts.append(symbol if power == 1 else f"{symbol}^{power:g}")
    return "*".join(parts)
