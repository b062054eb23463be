"""Actuators: which slot each drive sets, its law, and how it is released or force-controlled."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pkmcal_cli.base.rotation import Array, log
from pkmcal_cli.compiler.bars import rest_length
from pkmcal_cli.compiler.joints import add_joint_link
from pkmcal_cli.compiler.numbers import combined, constant_vector, number, triad_about, triad_along, unit
from pkmcal_cli.compiler.structure import Structure
from pkmcal_cli.language.machine import Actuator, axis_vector
from pkmcal_cli.mechanism.coefficients import Formula
from pkmcal_cli.mechanism.connection_points import Number, Port
from pkmcal_cli.mechanism.topology import GROUND, Drive, DriveKind, Turn


@dataclass(frozen=True)
class PlacedDrive:
    """A drive for the layout with the element and strain that it sets, slots of its gain and of its force."""

    drive: Drive
    element: str
    strain: str
    gain_slot: int
    force_slot: int


def leg_lengths(structure: Structure) -> dict[str, Number]:
    """Rest lengths at reading zero of the bars and ropes that drives change."""
    out: dict[str, Number] = {}
    for actuator in structure.machine.actuators.values():
        target = actuator.target
        members = {**structure.machine.bars, **structure.machine.ropes}
        if target in members and (actuator.drives or actuator.winds):
            out[target] = _length_at_zero(structure, actuator, target)
    return out


def _length_at_zero(structure: Structure, actuator: Actuator, target: str) -> Number:
    member = {**structure.machine.bars, **structure.machine.ropes}[target]
    ports = (structure.port(member.between[0]), structure.port(member.between[1]))
    if actuator.zero == "home":
        return _home_length(structure, ports)
    zero = number(actuator.zero)  # type: ignore[arg-type]
    base = number(actuator.offset) if actuator.offset is not None else 0.0
    if actuator.offset is None and member.length is not None:
        base = rest_length(structure, member, ports)
    return combined(lambda a, b: a + b, zero, base)


def _home_length(structure: Structure, ports: tuple[Port, Port]) -> Number:
    """Distance of the ports in the drawing as a function of the parameters that place them."""
    b = structure.builder
    formulas = dict(b.formulas)
    used = {k for p in ports for _, _, index in p.point.offsets for k in b.offsets[index]}
    names = tuple(dict.fromkeys(n for k in sorted(used) if k in formulas for n in formulas[k].names))
    fixed = {k: b.constants[k] for k in used}

    def length(parameters: dict[str, complex]) -> complex:
        delta = np.zeros(3, dtype=complex)
        for factor, port in ((-1.0, ports[0]), (1.0, ports[1])):
            for r, sign, index in port.point.offsets:
                slots = b.offsets[index]
                value = [formulas[k].function(parameters) if k in formulas else fixed[k] for k in slots]
                delta = delta + factor * sign * (structure.orientation(r) @ np.array(value))
            for r, t, axis in port.point.travels:
                delta = delta + factor * b.travels[t][1] * (structure.orientation(r) @ np.array(axis))
        return complex(np.sqrt((delta * delta).sum()))

    return Formula(names, length) if names else float(np.real(length({})))  # type: ignore[arg-type]


def gain(actuator: Actuator) -> Number:
    """Travel (m or rad) per unit of reading (SI): scale, ratio and, for a spool, its radius."""
    if actuator.radius is not None:
        return combined(lambda s, r, radius: s * r * radius, actuator.scale, actuator.ratio, actuator.radius)
    return combined(lambda s, r: s * r, actuator.scale, actuator.ratio)


def add_drive(structure: Structure, name: str, actuator: Actuator) -> PlacedDrive:
    """One actuator; its element exists already, or a drive spring is added here."""
    gain_slot = structure.builder.slot(gain(actuator), f"{name}.gain")
    given = None if actuator.force is None else actuator.force.otherwise
    force_slot = structure.builder.slot(number(given), f"{name}.force.given")
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
    return PlacedDrive(drive, element, strain, gain_slot, force_slot)


def _drive(name: str, actuator: Actuator, kind: DriveKind, slot: int, target: tuple[int, ...], sign: float) -> Drive:
    forced = not actuator.holds
    return Drive(
        name=name,
        kind=kind,
        slot=slot,
        target=target,
        force_slot=-1,
        force_sign=sign,
        redundant=actuator.redundant,
        force_controlled=forced,
        rigid=actuator.stiffness is None,
    )


def _travel_drive(structure: Structure, name: str, actuator: Actuator) -> tuple[Drive, str, str]:
    """A carriage or telescope: its travel is prescribed, or held by the drive's own spring."""
    b = structure.builder
    travel = structure.carriage_travel[actuator.target]
    base = number(actuator.zero) if actuator.zero != "home" else b.travels[travel][1]  # type: ignore[arg-type]
    if actuator.offset is not None:
        base = combined(lambda z, o: z + o, base, number(actuator.offset))
    if actuator.stiffness is None:
        _, drawn, free, label = b.travels[travel]
        b.travels[travel] = (b.slot(base, f"{name}.position"), drawn, free, label)
        drive = _drive(name, actuator, DriveKind.TRAVEL, b.travels[travel][0], (travel,), 1.0)
        if not actuator.holds:
            force = b.slot(0.0, f"{name}.force")
            b.force("travel", travel, force)
            drive = replace(drive, force_slot=force)
        return drive, "", ""
    ports, axis = _driven_ports(structure, actuator)
    element = f"{name}.drive"
    add_joint_link(
        structure,
        element,
        "prismatic",
        rows=("x",),
        ports=ports,
        triad=triad_along(axis),
        stiffness=None,
        rest={"x": base},
        extra={"x": number(actuator.stiffness)},
    )
    return _drive(name, actuator, DriveKind.STRAIN, -1, (), -1.0), element, "x"


def _driven_ports(structure: Structure, actuator: Actuator) -> tuple[tuple[Port, Port], np.ndarray]:  # type: ignore[type-arg]
    """Ports between which a drive spring acts, and its axis in the drawing."""
    if actuator.moves is not None:
        body = structure.machine.bodies[actuator.moves]
        assert body.on is not None
        rail = structure.rails[body.on]
        axis = structure.orientation(rail.rotation) @ rail.along
        return (Port(rail.origin, rail.rotation), structure.port(actuator.moves)), axis
    joint = structure.machine.joints[actuator.target]
    ports = (structure.port(joint.between[0], True), structure.port(joint.between[1], True))
    return ports, structure.sliding_axis(joint)


def _rotary_drive(structure: Structure, name: str, actuator: Actuator) -> tuple[Drive, str, str]:
    """A crank: the angle of its body against the other side is prescribed, or held by the drive's own spring."""
    b, target = structure.builder, actuator.target
    body = target if target in structure.machine.bodies else _turned_body(structure, target)
    joint = structure.machine.joints[_joint_of(structure, body, target)]
    other, mine = sorted(joint.between, key=lambda end: structure.owner.get(end, end) == body)
    rotation, base = structure.rotation(body), structure.rotation(other)
    kind, axis, drawn, _, label = b.rotations[rotation]
    about = unit(constant_vector(axis_vector(joint.axis or "z", 3), structure.nominal))
    offset = _drawn_angle(structure, base, rotation, about)
    zero = number(actuator.zero) if actuator.zero != "home" else offset  # type: ignore[arg-type]
    if actuator.stiffness is None and kind == Turn.AXIS and base == GROUND:
        slot = b.slot(combined(lambda z: z - offset, zero), f"{name}.angle")
        b.rotations[rotation] = (kind, axis, drawn, (slot, -1, -1), label)
        drive = _drive(name, actuator, DriveKind.ROTATION, slot, (rotation,), 1.0)
        if not actuator.holds:
            force = b.slot(0.0, f"{name}.force")
            b.force("rotation", 3 * rotation, force)
            drive = replace(drive, force_slot=force)
        return drive, "", ""
    ports = (structure.port(other, True), structure.port(mine, True))
    stiffness = {} if actuator.stiffness is None else {"angle": number(actuator.stiffness)}
    rest = {"angle": combined(lambda z: z - offset, zero)}
    element = f"{name}.drive"
    add_joint_link(
        structure,
        element,
        "revolute",
        rows=("angle",),
        ports=ports,
        triad=triad_about(about),
        stiffness=None,
        rest=rest,
        extra=stiffness,
    )
    return _drive(name, actuator, DriveKind.STRAIN, -1, (), -1.0), element, "angle"


def _drawn_angle(structure: Structure, base: int, rotation: int, about: Array) -> float:
    """Angle (rad) of a crank against its base in the assembled drawing; in space against the file's drawing."""
    drawn = structure.orientation(base).T @ structure.orientation(rotation)
    if structure.planar:
        return float(log(drawn)[2])
    first, second = (structure.builder.filed.get(r, structure.orientation(r)) for r in (base, rotation))
    return float(log(drawn @ second.T @ first) @ first.T @ about)


def _turned_body(structure: Structure, joint: str) -> str:
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
