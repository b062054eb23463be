"""Actuators: which coefficient each drive sets, its law, and how it is released or force-controlled."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from pkmcal_cli.base.rotation import Array, log
from pkmcal_cli.compiler.axes import CONSTANT, Tilts, nominal_axis
from pkmcal_cli.compiler.coefficient_values import combined, number, triad_about, triad_along
from pkmcal_cli.compiler.joints import add_joint_link, sliding_axis, tilts_of
from pkmcal_cli.compiler.rope_path import reference_length
from pkmcal_cli.compiler.ropes import Cable, cables, stated_length
from pkmcal_cli.compiler.structure import Structure
from pkmcal_cli.elements import BarElement
from pkmcal_cli.language.instruments import ONE
from pkmcal_cli.language.machine import Actuator, Bar
from pkmcal_cli.language.quantities import Quantity
from pkmcal_cli.language.step_units import in_steps
from pkmcal_cli.mechanism.connection_points import ConnectionPoint, Link, Number, Point
from pkmcal_cli.mechanism.topology import GROUND, Drive, DriveKind, RotationKind


@dataclass(frozen=True)
class PlacedDrive:
    """A drive for the topology with the element and strain that it sets, coefficients of its gain and of its force."""

    drive: Drive
    element: str
    strain: str
    gain_coefficient: int
    force_coefficient: int


def leg_lengths(structure: Structure) -> dict[str, Number]:
    """Lengths at reading zero of the bars and cables that drives change."""
    machine, out = structure.machine, {}
    wound = cables(machine)
    for actuator in machine.actuators.values():
        target = actuator.target
        if actuator.winds is not None:
            out[target] = _wound_at_zero(structure, actuator, wound[target])
        elif actuator.drives is not None and target in machine.bars:
            out[target] = _leg_at_zero(structure, actuator, machine.bars[target])
    return out


def _leg_at_zero(structure: Structure, actuator: Actuator, leg: Bar) -> Number:
    connections = (structure.connection(leg.between[0]), structure.connection(leg.between[1]))
    if actuator.zero == "home":
        return reference_length(structure, BarElement(), [Link(connections=connections)])
    base = number(actuator.offset) if actuator.offset is not None else 0.0
    if actuator.offset is None and leg.length is not None:
        base = number(leg.length)
    return combined(lambda a, b: a + b, number(actuator.zero), base)  # type: ignore[arg-type]


def _wound_at_zero(structure: Structure, actuator: Actuator, cable: Cable) -> Number:
    if actuator.zero == "home":
        paths = cable.paths(structure)
        return reference_length(structure, paths[0].shape, [link for path in paths for link in path.links])
    lengths_stated = any(rope.length is not None for rope in cable.ropes.values())
    base = stated_length(structure, cable) if lengths_stated else 0.0
    return combined(lambda a, b: a + b, number(actuator.zero), base)  # type: ignore[arg-type]


def gain(actuator: Actuator) -> Number:
    """Travel (m or rad) per unit of reading (SI): scale, ratio and, for a spool, its radius and the rope's folds."""
    return combined(_gain, *_factors(actuator))


def _gain(scale: complex, ratio: complex, radius: complex, folds: complex) -> complex:
    return scale * ratio * radius / folds


def _factors(actuator: Actuator) -> tuple[Quantity, ...]:
    return actuator.scale, actuator.ratio, actuator.radius or ONE, actuator.folds or ONE


def as_travel(quantity: Quantity, actuator: Actuator, nominal: Mapping[str, float]) -> float:
    """A length or angle of travel, SI, that may be given as one of the reading: in its dimension or in steps of it."""
    value = quantity.number(nominal)
    if quantity.dimension == actuator.travel_dimension and not in_steps(quantity):
        return value
    return value * abs(_gain(*(factor.number(nominal) for factor in _factors(actuator))))


def period_of_travel(actuator: Actuator, nominal: Mapping[str, float]) -> float:
    """Travel (SI) after which the errors of a screw, encoder or drum come again: as stated, else a turn of the drum.

    NaN where neither is known.
    """
    if actuator.period is not None:
        return as_travel(actuator.period, actuator, nominal)
    if actuator.radius is None:
        return math.nan
    folds = 1.0 if actuator.folds is None else actuator.folds.number(nominal)
    return 2.0 * math.pi * actuator.radius.number(nominal) / folds


def add_drive(structure: Structure, name: str, actuator: Actuator) -> PlacedDrive:
    """One actuator; its element exists already, or a drive spring is added here."""
    gain_coefficient = structure.builder.coefficient(gain(actuator), f"{name}.gain")
    force = None if actuator.force is None else actuator.force.otherwise
    force_coefficient = structure.builder.coefficient(number(force), f"{name}.force.given")
    if actuator.moves is not None or (actuator.drives in structure.carriage_travel):
        made = _travel_drive(structure, name, actuator)
    elif actuator.turns is not None:
        made = _rotary_drive(structure, name, actuator)
    elif actuator.drives is not None and actuator.drives in structure.machine.joints:
        made = (_drive(name, actuator, DriveKind.STRAIN, -1, (), -1.0), actuator.drives, "x")
    else:
        sign = 1.0 if actuator.winds is not None else -1.0
        made = (_drive(name, actuator, DriveKind.STRAIN, -1, (), sign), actuator.target, "elongation")
    drive, element, strain = made
    return PlacedDrive(drive, element, strain, gain_coefficient, force_coefficient)


def _drive(
    name: str, actuator: Actuator, kind: DriveKind, coefficient: int, target: tuple[int, ...], sign: float
) -> Drive:
    forced = not actuator.holds
    return Drive(
        name=name,
        kind=kind,
        coefficient=coefficient,
        target=target,
        force_coefficient=-1,
        force_sign=sign,
        redundant=actuator.redundant,
        force_controlled=forced,
        rigid=actuator.stiffness is None,
    )


def _travel_drive(structure: Structure, name: str, actuator: Actuator) -> tuple[Drive, str, str]:
    """A carriage or telescope: its travel is prescribed, or held by the drive's own spring."""
    b = structure.builder
    travel = structure.carriage_travel[actuator.target]
    base = number(actuator.zero) if actuator.zero != "home" else b.translations[travel][1]  # type: ignore[arg-type]
    if actuator.offset is not None:
        base = combined(lambda z, o: z + o, base, number(actuator.offset))
    if actuator.stiffness is None:
        _, reference, free, label = b.translations[travel]
        b.translations[travel] = (b.coefficient(base, f"{name}.position"), reference, free, label)
        drive = _drive(name, actuator, DriveKind.TRAVEL, b.translations[travel][0], (travel,), 1.0)
        if not actuator.holds:
            force = b.coefficient(0.0, f"{name}.force")
            b.force("translation", travel, force)
            drive = replace(drive, force_coefficient=force)
        return drive, "", ""
    connections, axis, tilts = _driven_connections(structure, actuator)
    element = f"{name}.drive"
    add_joint_link(
        structure,
        element,
        "prismatic",
        rows=("x",),
        connections=connections,
        triad=triad_along(axis),
        stiffness=None,
        rest={"x": base},
        extra={"x": number(actuator.stiffness)},
        tilts=tilts,
    )
    return _drive(name, actuator, DriveKind.STRAIN, -1, (), -1.0), element, "x"


def _driven_connections(
    structure: Structure, actuator: Actuator
) -> tuple[tuple[ConnectionPoint, ConnectionPoint], Array, Tilts]:
    """Connection points between which a drive spring acts, its axis in the reference configuration, and its turns."""
    if actuator.moves is not None:
        rail = structure.rails.of(actuator.moves)
        if actuator.moves in structure.rails.stations:  # on a beam the travel is a natural length
            along = np.array([1.0, 0.0, 0.0])
            travel = Point((), ((GROUND, structure.carriage_travel[actuator.moves], tuple(along)),))
            return (ConnectionPoint(Point(), GROUND), ConnectionPoint(travel, GROUND)), along, CONSTANT
        axis = structure.orientation(rail.rotation) @ rail.along
        ends = ConnectionPoint(rail.origin, rail.rotation), structure.connection(actuator.moves)
        return ends, axis, (rail.tilt, rail.tilt)
    joint = structure.machine.joints[actuator.target]
    connections = (structure.connection(joint.between[0], True), structure.connection(joint.between[1], True))
    return connections, sliding_axis(structure, joint), tilts_of(structure, joint)


def _rotary_drive(structure: Structure, name: str, actuator: Actuator) -> tuple[Drive, str, str]:
    """A crank: the angle of its body against the other side is prescribed, or held by the drive's own spring."""
    b, target = structure.builder, actuator.target
    body = target if target in structure.machine.bodies else _rotated_body(structure, target)
    joint = structure.machine.joints[_joint_of(structure, body, target)]
    other, driven = sorted(joint.between, key=lambda end: structure.owner.get(end, end) == body)
    rotation, base = structure.rotation(body), structure.rotation(other)
    kind, axis, reference, _, label = b.rotations[rotation]
    about = nominal_axis(joint.axis or "z", structure.nominal)
    offset = _reference_angle(structure, base, rotation, about)
    zero = number(actuator.zero) if actuator.zero != "home" else offset  # type: ignore[arg-type]
    if actuator.stiffness is None and kind == RotationKind.AXIS and base == GROUND:
        coefficient = b.coefficient(combined(lambda z: z - offset, zero), f"{name}.angle")
        b.rotations[rotation] = (kind, axis, reference, (coefficient, -1, -1), label)
        drive = _drive(name, actuator, DriveKind.ROTATION, coefficient, (rotation,), 1.0)
        if not actuator.holds:
            force = b.coefficient(0.0, f"{name}.force")
            b.force("rotation", 3 * rotation, force)
            drive = replace(drive, force_coefficient=force)
        return drive, "", ""
    connections = (structure.connection(other, True), structure.connection(driven, True))
    stiffness = {} if actuator.stiffness is None else {"angle": number(actuator.stiffness)}
    rest_angle = {"angle": combined(lambda z: z - offset, zero)}
    element = f"{name}.drive"
    add_joint_link(
        structure,
        element,
        "revolute",
        rows=("angle",),
        connections=connections,
        triad=triad_about(about),
        stiffness=None,
        rest=rest_angle,
        extra=stiffness,
        tilts=tilts_of(structure, joint),
    )
    return _drive(name, actuator, DriveKind.STRAIN, -1, (), -1.0), element, "angle"


def _reference_angle(structure: Structure, base: int, rotation: int, about: Array) -> float:
    """Angle (rad) of a crank against its base in the reference configuration; in space against what is filed."""
    reference = structure.orientation(base).T @ structure.orientation(rotation)
    if structure.planar:
        return float(log(reference)[2])
    first, second = (structure.builder.filed.get(r, structure.orientation(r)) for r in (base, rotation))
    return float(log(reference @ second.T @ first) @ first.T @ about)


def _rotated_body(structure: Structure, joint: str) -> str:
    """The body or node that a revolute joint places, else its second member."""
    for child, (by, _) in structure.placed_by.items():
        if by == joint:
            return child
    end = structure.machine.joints[joint].between[1]
    return structure.owner.get(end, end)


def _joint_of(structure: Structure, body: str, target: str) -> str:
    """The revolute joint that a crank turns."""
    if target in structure.machine.joints:
        return target
    for name, joint in structure.machine.joints.items():
        if joint.type == "revolute" and body in (structure.owner.get(e, e) for e in joint.between):
            return name
    raise KeyError(f"{body} turns on no revolute joint")
