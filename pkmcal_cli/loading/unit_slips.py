"""Numbers far from what machines of this size have, so that a unit may be wrong: warnings, with the unit meant.

The bands hold all shipped machines; docs/decisions.md says where they come from, tests/hostile/unit_slips.py what they
find.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Iterator
from typing import Any

from pkmcal_cli.base.errors import Fault
from pkmcal_cli.language.checks.magnitudes import MAX_WARNINGS
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.language.quantities import Quantity
from pkmcal_cli.loading.doubts import Band, Doubts, Number, numbers_of
from pkmcal_cli.loading.unlike_figures import unlike_figures
from pkmcal_cli.units.dimensions import (
    ACCELERATION,
    ANGLE,
    DENSITY,
    FORCE,
    LENGTH,
    MASS,
    MODULUS,
    NUMBER,
    STIFFNESS,
    Dimension,
)  # fmt: skip
from pkmcal_cli.yaml_source.tree import Path

_SIGMA = (1e-8, 1e-3)  # of the machine's size
_COARSE = 5.0  # as much more of a drive: belts, ropes
_SMALL = 0.02  # m: of smaller machines nothing is usual
_ANGULAR_SIGMA = (1e-8, 3e-3)  # rad
_RANGE = (1e-6, 0.05)  # of the machine's size
_ANYWHERE = 1.0  # the same of what only an instrument looks at, a ball on the table
_ANGULAR_RANGE = (1e-9, 0.35)  # rad
_OWN_RANGE = (1e-6, 2.0)  # of a nominal force, mass, density
_COMPLIANT_RANGE = (1e-4, 2.0)  # of a nominal stiffness, modulus: never known as well as what a balance tells
_FACTOR, _FACTOR_RANGE = 0.5, (1e-9, 0.5)  # numbers from here on are scales and ratios; of their nominal
_SECTION = (5e-4, 0.5)  # of the machine's size
_MODULUS = (1e9, 1e12)  # Pa: polymers to ceramics
_DENSITY = (10.0, 25e3)  # kg/m^3: foam to tungsten
_STIFFNESS = (1e6, 1e11)  # N/m, of bars and drives
_AXIAL = (1e3, 1e9)  # N, from cords on
_GRAVITY = (9.7, 9.9)  # m/s^2; in the plane its part in that plane
_LIGHT = 0.02  # kg of a body for each m of the machine's size
_MASS = 2000.0  # kg, and as much more for the cube of the machine's size in m
_ROUND = (math.pi / 12, 1e-4)  # angles of drawings in degrees are multiples of 15: in radians that shows


def unit_slips(machine: Machine, size: float, targets: Collection[str] = ()) -> list[Fault]:
    """Warnings of numbers outside their bands; `size`: of the machine, m; targets: parameters of places that only
    instruments look at, which may be anywhere."""
    if size < _SMALL:
        return []
    doubts = Doubts(machine)
    faults = [fault for number, band in _numbers(machine, size) for fault in doubts.outside(number, band)]
    others = (unlike_figures(doubts, size), _gravity(doubts), _ranges(doubts, size, targets), _angles(doubts))
    every = [*faults, *itertools.chain(*others)]
    places = {fault.where: fault for fault in reversed(every)}  # the first of a place, which all of an `each` share
    return list(reversed(places.values()))[:MAX_WARNINGS]


def _numbers(machine: Machine, size: float) -> Iterator[tuple[Number, Band]]:
    """Everything that has a band."""
    for name, actuator in machine.actuators.items():
        if actuator.sigma is not None:
            low, high = _sigma(actuator.sigma, size)
            yield Number(f"sigma of {name}", ("actuators", name, "sigma"), actuator.sigma), (low, _COARSE * high)
        for number in numbers_of(("actuators", name), actuator, ("stiffness",)):
            if number.quantity.dimension == STIFFNESS:
                yield number, _STIFFNESS
    for name, sensor in machine.sensors.items():
        for key, sigma in sensor.sigma.items():
            if sigma.constant.dimension in (LENGTH, ANGLE):
                path: Path = ("sensors", name, "sigma", *((key,) if key else ()))
                yield Number(f"sigma of {name}", path, sigma.constant), _sigma(sigma.constant, size)
    for name, material in machine.materials.items():
        bands = {"E": _MODULUS, "G": (0.2 * _MODULUS[0], _MODULUS[1]), "density": _DENSITY}
        yield from _banded(("materials", name), material, bands)
    band = (_SECTION[0] * size, _SECTION[1] * size)
    for name, section in machine.sections.items():
        sides = dict.fromkeys(("square", "round", "tube", "rectangle"), band)
        yield from _banded(("sections", name), section, sides | {"area": (band[0] ** 2, band[1] ** 2)})
    for kind in ("bars", "telescopes", "ropes", "beams", "springs"):
        for name, member in getattr(machine, kind, {}).items():
            spring = len(machine.actuators) < 2 or getattr(member, "spring", False)  # or a fixture: as soft as may be
            driven = {} if spring else {"k": _STIFFNESS}
            yield from _banded((kind, name), member, driven | {"EA": _AXIAL})
    for kind, least in (("bodies", _LIGHT * size), ("nodes", 0.0)):  # a node may be a mark, or the end of a wire
        for name, body in getattr(machine, kind).items():
            yield from _banded((kind, name), body, {"mass": (least, _MASS * max(size, size**3))})


def _banded(path: Path, entity: Any, bands: dict[str, Band]) -> Iterator[tuple[Number, Band]]:
    """Those keys of an entity that are numbers."""
    for key, band in bands.items():
        for number in numbers_of(path, entity, (key,)):
            yield number, band


def _sigma(quantity: Quantity, size: float) -> Band:
    return _ANGULAR_SIGMA if quantity.dimension == ANGLE else (_SIGMA[0] * size, _SIGMA[1] * size)


def _gravity(doubts: Doubts) -> Iterator[Fault]:
    """Gravity of another size than that of the earth, or that points up."""
    machine = doubts.machine
    pull = [q.number(doubts.values) for q in machine.gravity]
    size = math.hypot(*pull)
    if not size:
        return
    least = 0.0 if machine.space == "planar" else _GRAVITY[0]
    unit = machine.file_units.unit(ACCELERATION)
    if not least <= size <= _GRAVITY[1]:
        message = f"gravity is {unit.format(size, 3)}"
        message += ": did you mean 9.81 m/s^2?" if size > 2 * _GRAVITY[1] else ", not that of the earth"
        hint = "bare numbers are in m/s^2; `gravity: [0, 0, -9.81]`"
        yield doubts.fault("magnitude", message, ("gravity",), hint)
    if pull[-1] > 0.5 * size:
        message = f"gravity points along +{'y' if machine.space == 'planar' else 'z'}: weight acts upwards"
        hint = "give a negative number where this axis points up; a machine that is drawn upside down may ignore this"
        yield doubts.fault("gravity-up", message, ("gravity",), hint)


def _ranges(doubts: Doubts, size: float, targets: Collection[str]) -> Iterator[Fault]:
    """Ranges that are large beside the machine or nominal, or next to nothing; one warning for a default."""
    reported: set[tuple[Dimension, float]] = set()
    for name, parameter in doubts.machine.parameters.items():
        dimension, value = parameter.dimension, parameter.range
        band = _band_of_range(dimension, size, abs(parameter.nominal))
        if dimension == LENGTH and name in targets:
            band = (_RANGE[0] * size, _ANYWHERE * size)
        if band is None or not value or not math.isfinite(value) or band[0] <= value <= band[1]:
            continue
        if (dimension, value) not in reported:
            reported.add((dimension, value))
            yield doubts.of_value(f"range of {name}", ("parameters", name, "range"), value, dimension, band)


def _band_of_range(dimension: Dimension, size: float, nominal: float) -> Band | None:
    if dimension == LENGTH:
        return (_RANGE[0] * size, _RANGE[1] * size)
    if dimension == ANGLE:
        return _ANGULAR_RANGE
    share = None
    if dimension in (STIFFNESS, MODULUS):
        share = _COMPLIANT_RANGE
    elif dimension in (FORCE, MASS, DENSITY):
        share = _OWN_RANGE
    elif dimension == NUMBER and nominal >= _FACTOR:
        share = _FACTOR_RANGE
    return (share[0] * nominal, share[1] * nominal) if share and nominal else None


def _angles(doubts: Doubts) -> Iterator[Fault]:
    """Bare angles of more than a turn in a file in radians; in others, multiples of 15 degrees in radians."""
    machine, radians = doubts.machine, doubts.machine.file_units.angle.scale == 1.0
    reported: set[str] = set()
    for label, path, written in _orientations(machine, doubts):
        number = abs(written / machine.file_units.angle.scale)
        steps, more = number / _ROUND[0], number > 2 * math.pi + 1e-9
        slipped = more if radians else not more and steps > 0.9 and abs(steps - round(steps)) < _ROUND[1]
        if slipped and label not in reported:
            reported.add(label)
            likely_unit, file_unit = ("deg", "rad") if radians else ("rad", machine.file_units.angle.text)
            message = f"{label} = {number:g} {file_unit}: did you mean {number:g} {likely_unit}?"
            hint = f"bare angles are in {file_unit}; write `{number:g} {likely_unit}`, if that is meant"
            yield doubts.fault("magnitude", message, path, hint)


def _orientations(machine: Machine, doubts: Doubts) -> Iterator[tuple[str, Path, float]]:
    """Angles as drawn, rad, that are written without a unit."""
    for name, parameter in machine.parameters.items():
        if parameter.dimension == ANGLE:
            yield f"nominal of {name}", ("parameters", name, "nominal"), parameter.nominal
    for kind in ("frames", "bodies"):
        for name, entity in getattr(machine, kind).items():
            for number in numbers_of((kind, name), entity, ("turn",)):
                if doubts.unit_of(number) is None:
                    yield number.label, number.path, number.quantity.number(doubts.values)
