"""Numbers far from what machines of this size have, so that a unit may be wrong: warnings, with the unit meant.

The bands hold all shipped machines; docs/decisions.md says where they come from, tests/hostile/unit_slips.py what they
find.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from pkmcal_cli.base.errors import Fault
from pkmcal_cli.language.checks.magnitudes import MAX_WARNINGS, unit_meant
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.language.quantities import Quantity
from pkmcal_cli.units.dimensions import ACCELERATION, ANGLE, DENSITY, FORCE, LENGTH, MASS, MODULUS, STIFFNESS, Dimension
from pkmcal_cli.yaml_source.tree import Path

Band = tuple[float, float]
_SIGMA = (1e-8, 1e-3)  # of the machine's size
_COARSE = 5.0  # as much more of a drive: belts, ropes
_SMALL = 0.02  # m: of smaller machines nothing is usual
_ANGULAR_SIGMA = (1e-8, 3e-3)  # rad
_RANGE = (1e-6, 0.05)  # of the machine's size
_ANGULAR_RANGE = (1e-9, 0.35)  # rad
_OWN_RANGE = (1e-6, 2.0)  # of a nominal stiffness, modulus, force
_SECTION = (5e-4, 0.5)  # of the machine's size
_MODULUS = (1e9, 1e12)  # Pa: polymers to ceramics
_DENSITY = (10.0, 25e3)  # kg/m^3: foam to tungsten
_STIFFNESS = (1e6, 1e11)  # N/m, of bars and drives
_AXIAL = (1e3, 1e9)  # N, from cords on
_GRAVITY = (9.7, 9.9)  # m/s^2; in the plane its part in that plane
_MASS = 2000.0  # kg, and as much more for the cube of the machine's size in m
_LIKE = 100.0  # ratio of a stiffness to the median of its kind
_ROUND = (math.pi / 12, 1e-4)  # angles of drawings in degrees are multiples of 15: in radians that shows


@dataclass(frozen=True)
class _Number:
    """A quantity of the file, with the name of what it is, its place and what is usual."""

    label: str
    path: Path
    quantity: Quantity
    band: Band


def unit_slips(machine: Machine, size: float) -> list[Fault]:
    """Warnings of numbers outside their bands; `size`: of the machine, m."""
    if size < _SMALL:
        return []
    values, reported, faults = machine.nominal_values(), set[Path](), list[Fault]()
    for number in _numbers(machine, size):
        value, path = abs(number.quantity.number(values)), _written_at(machine, number)
        low, high = number.band
        if value and not low <= value <= high and path not in reported:
            reported.add(path)
            faults.append(_warning(machine, number, path, value))
    return [*faults, *_unlike(machine, reported), *_gravity(machine), *_ranges(machine, size), *_angles(machine)][
        :MAX_WARNINGS
    ]


def _numbers(machine: Machine, size: float) -> Iterator[_Number]:
    """Everything that has a band."""
    for name, actuator in machine.actuators.items():
        if actuator.sigma is not None:
            low, high = _sigma(actuator.sigma, size)
            band = (low, _COARSE * high)
            yield _Number(f"sigma of {name}", ("actuators", name, "sigma"), actuator.sigma, band)
        stiffness = getattr(actuator, "stiffness", None)
        if isinstance(stiffness, Quantity) and stiffness.dimension == STIFFNESS:
            yield _Number(f"stiffness of {name}", ("actuators", name, "stiffness"), stiffness, _STIFFNESS)
    for name, sensor in machine.sensors.items():
        for key, sigma in sensor.sigma.items():
            if sigma.constant.dimension in (LENGTH, ANGLE):
                path: Path = ("sensors", name, "sigma", *((key,) if key else ()))
                yield _Number(f"sigma of {name}", path, sigma.constant, _sigma(sigma.constant, size))
    for name, material in machine.materials.items():
        yield from _keys(("materials", name), material, {"E": _MODULUS, "G": (0.2 * _MODULUS[0], _MODULUS[1])})
        yield from _keys(("materials", name), material, {"density": _DENSITY})
    band = (_SECTION[0] * size, _SECTION[1] * size)
    for name, section in machine.sections.items():
        sides = dict.fromkeys(("square", "round", "tube", "rectangle"), band)
        yield from _keys(("sections", name), section, sides | {"area": (band[0] ** 2, band[1] ** 2)})
    for kind in ("bars", "telescopes", "ropes", "beams", "springs"):
        for name, member in getattr(machine, kind, {}).items():
            driven = {"k": _STIFFNESS} if len(machine.actuators) > 1 else {}  # others: springs, fixtures
            yield from _keys((kind, name), member, driven | {"EA": _AXIAL})
    for kind in ("bodies", "nodes"):
        for name, body in getattr(machine, kind).items():
            yield from _keys((kind, name), body, {"mass": (0.0, _MASS * max(size, size**3))})


def _keys(path: Path, entity: Any, bands: dict[str, Band]) -> Iterator[_Number]:
    """Those keys of an entity that are given."""
    for key, band in bands.items():
        value = getattr(entity, key, None)
        for quantity in value if isinstance(value, tuple) else (value,):
            if isinstance(quantity, Quantity):
                yield _Number(f"{key} of {path[-1]}", (*path, key), quantity, band)


def _sigma(quantity: Quantity, size: float) -> Band:
    return _ANGULAR_SIGMA if quantity.dimension == ANGLE else (_SIGMA[0] * size, _SIGMA[1] * size)


def _written_at(machine: Machine, number: _Number) -> Path:
    """The place of a number: of the parameter that it is, else its own."""
    text = number.quantity.text.strip()
    return ("parameters", text, "nominal") if text in machine.parameters else number.path


def _warning(machine: Machine, number: _Number, path: Path, value: float) -> Fault:
    return _doubt(machine, number.label, path, value, number.quantity.dimension, number.band)


def _doubt(machine: Machine, label: str, path: Path, value: float, dimension: Dimension, band: Band) -> Fault:
    """The warning: the number, the unit that would make it usual, and what is usual."""
    unit = machine.file_units.unit(dimension)
    likely = unit_meant(value / unit.scale, unit, band, dimension)
    message = f"{label} = {unit.format(value, 3)}"
    message += f": did you mean {value / unit.scale:g} {likely}?" if likely else " is far outside the usual range"
    band_text = (
        f"{unit.format(band[0], 3)} to {unit.format(band[1], 3)}" if band[0] else f"up to {unit.format(band[1], 3)}"
    )
    hint = f"check the unit; typical: {band_text}"
    return machine.source.fault("magnitude", message, _there(machine, path), hint, warning=True)


def _there(machine: Machine, path: Path) -> Path:
    """The path, or the nearest one above it that the file has."""
    while path:
        try:
            machine.source[path]
        except (KeyError, IndexError, TypeError):
            path = path[:-1]
        else:
            break
    return path


def _unlike(machine: Machine, reported: set[Path]) -> Iterator[Fault]:
    """Stiffnesses far from those of the other members of their kind."""
    values = machine.nominal_values()
    for kind in ("bars", "ropes", "telescopes"):
        for key in ("k", "EA"):
            members = getattr(machine, kind, {}).items()
            numbers = [n for name, m in members for n in _keys((kind, name), m, {key: (0.0, math.inf)})]
            stated = [number.quantity.number(values) for number in numbers]
            for number, value in zip(numbers, stated, strict=True) if len(stated) > 2 else ():
                median, path = sorted(stated)[len(stated) // 2], _written_at(machine, number)
                if not median / _LIKE <= value <= median * _LIKE and path not in reported:
                    reported.add(path)
                    band = (median / _LIKE, median * _LIKE)
                    yield _doubt(machine, number.label, path, value, number.quantity.dimension, band)


def _gravity(machine: Machine) -> Iterator[Fault]:
    """Gravity of another size than that of the earth, or that points up."""
    values = machine.nominal_values()
    pull = [q.number(values) for q in machine.gravity]
    size = math.hypot(*pull)
    if not size:
        return
    least = 0.0 if machine.space == "planar" else _GRAVITY[0]
    unit = machine.file_units.unit(ACCELERATION)
    if not least <= size <= _GRAVITY[1]:
        message = f"gravity is {unit.format(size, 3)}"
        message += ": did you mean 9.81 m/s^2?" if size > 2 * _GRAVITY[1] else ", not that of the earth"
        hint = "bare numbers are in m/s^2; `gravity: [0, 0, -9.81]`"
        yield machine.source.fault("magnitude", message, ("gravity",), hint, warning=True)
    if pull[-1] > 0.5 * size:
        message = f"gravity points along +{'y' if machine.space == 'planar' else 'z'}: weight acts upwards"
        hint = "give a negative number where this axis points up; a machine that is drawn upside down may ignore this"
        yield machine.source.fault("gravity-up", message, ("gravity",), hint, warning=True)


def _ranges(machine: Machine, size: float) -> Iterator[Fault]:
    """Ranges that are large beside the machine or nominal, or next to nothing; one warning for a default."""
    reported: set[tuple[Dimension, float]] = set()
    for name, parameter in machine.parameters.items():
        dimension, value = parameter.dimension, parameter.range
        band = _band_of_range(dimension, size, abs(parameter.nominal))
        if band is None or not value or not math.isfinite(value) or band[0] <= value <= band[1]:
            continue
        if (dimension, value) not in reported:
            reported.add((dimension, value))
            yield _doubt(machine, f"range of {name}", ("parameters", name, "range"), value, dimension, band)


def _band_of_range(dimension: Dimension, size: float, nominal: float) -> Band | None:
    if dimension == LENGTH:
        return (_RANGE[0] * size, _RANGE[1] * size)
    if dimension == ANGLE:
        return _ANGULAR_RANGE
    if dimension in (STIFFNESS, MODULUS, FORCE, MASS, DENSITY) and nominal:
        return (_OWN_RANGE[0] * nominal, _OWN_RANGE[1] * nominal)
    return None


def _angles(machine: Machine) -> Iterator[Fault]:
    """Angles of more than a turn in a file in radians; in one in degrees, multiples of 15 degrees in radians."""
    values, radians = machine.nominal_values(), machine.file_units.angle.scale == 1.0
    reported: set[str] = set()
    for label, path, written in _orientations(machine, values):
        number = abs(written / machine.file_units.angle.scale)
        steps = number / _ROUND[0]
        slipped = number > 2 * math.pi + 1e-9 if radians else steps > 0.9 and abs(steps - round(steps)) < _ROUND[1]
        if slipped and label not in reported:
            reported.add(label)
            likely_unit, file_unit = ("deg", "rad") if radians else ("rad", machine.file_units.angle.text)
            message = f"{label} = {number:g} {file_unit}: did you mean {number:g} {likely_unit}?"
            hint = f"bare angles are in {file_unit}; write `{number:g} {likely_unit}`, if that is meant"
            yield machine.source.fault("magnitude", message, _there(machine, path), hint, warning=True)


def _orientations(machine: Machine, values: dict[str, float]) -> Iterator[tuple[str, Path, float]]:
    """Angles as drawn."""
    for name, parameter in machine.parameters.items():
        if parameter.dimension == ANGLE:
            yield f"nominal of {name}", ("parameters", name, "nominal"), parameter.nominal
    for kind in ("frames", "bodies"):
        for name, entity in getattr(machine, kind).items():
            orientation: Sequence[Quantity] = entity.turn
            for quantity in orientation:
                yield f"turn of {name}", (kind, name, "turn"), quantity.number(values)
