"""What can be drawn of a machine, in any state: its named points, guides and members, and where joints are.

Of joints also the axes along which they turn or slide; ends of beams and pulleys are among them.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.compiler.joints import joint_triad
from pkmcal_cli.compiler.rope_path import pulley_axis
from pkmcal_cli.compiler.structure import Structure
from pkmcal_cli.language.machine import End, Joint, Machine
from pkmcal_cli.language.quantities import Quantity
from pkmcal_cli.mechanism.connection_points import Member
from pkmcal_cli.mechanism.topology import GROUND
from pkmcal_cli.model.layout import Axis, JointPlace, Layout, Piece

_OWN_AXES = {
    "revolute": ((0, 2),), "cylindrical": ((0, 2),), "planar": ((0, 2),), "prismatic": ((0, 0),),
    "universal": ((0, 0), (1, 1)),
}  # fmt: skip
"""The axes of each type of joint: the side that carries it, and the column of the joint's triad that it is."""


def layout_of(structure: Structure, vectors: int) -> Layout:
    """The layout of a structure whose members are linked; points that nothing uses, beyond its offset vectors, are
    left out.
    """
    machine = structure.machine
    names = [*machine.nodes, *machine.bodies, *machine.ground, *structure.owner]
    pieces: dict[str, list[Piece]] = {name: [] for name in members(machine)}
    for member in structure.builder.members:
        rope, _, number = member.name.partition(".")
        if rope in pieces and (not number or number.isdigit()) and _joins(member):
            bends = any(s.startswith("bend") for s in member.element.strains)
            pieces[rope].append(Piece(member.name, member.links[0], bends))
    whole = {name: tuple(parts) for name, parts in pieces.items()}
    points = {n: structure.point(n) for n in names}
    used = {n: p for n, p in points.items() if all(offset < vectors for _, _, offset in p.offsets)}
    joints = {n: j for n, j in _joint_places(structure).items() if j.between[0] in used}
    return Layout(used, dict(structure.rails.guides), whole, joints)


def members(machine: Machine[Quantity, float]) -> dict[str, tuple[str, ...]]:
    """The points that each member runs through, of all sections of what joins points, but for joints."""
    out: dict[str, tuple[str, ...]] = {}
    for section in type(machine).model_fields:
        entries = getattr(machine, section)
        if section != "joints" and isinstance(entries, dict):
            out |= {n: e.between for n, e in entries.items() if hasattr(e, "between")}
    return out


def _joins(member: Member) -> bool:
    """Whether an element is drawn between its ends: no rope, whose links may be those of several, nor what is in one
    place, whose strains begin with a gap.
    """
    return not member.rope and member.element.strains[0] not in ("x", "y", "z", "rx", "ry", "rz", "angle", "length")


def _joint_places(structure: Structure) -> dict[str, JointPlace]:
    """Joints by name, ends of beams by beam and end (`NAME.i`, `NAME.j`; also fixed ones), pulleys by rope and
    point (`NAME.POINT`).
    """
    frames = {entry[4]: number for number, entry in enumerate(structure.builder.rotations)}
    out = {}
    for name, kind, joint, between in _all(structure):
        nodes = between if isinstance(joint, Joint) else (between[0], between[0])
        columns = _OWN_AXES.get(kind, ())
        triad = _triad(structure, joint, between) if columns else np.eye(3)
        axes = tuple(_axis(structure, frames, (name, side), nodes[side], triad[:, k]) for side, k in columns)
        out[name] = JointPlace(kind, structure.point(between[0]), axes, tuple(dict.fromkeys(nodes)))
    for rope, spec in structure.machine.ropes.items():
        for at, pulley in spec.pulleys.items():
            about = () if pulley.axis is None else (_carried(structure, at, pulley_axis(structure, pulley)),)
            out[f"{rope}.{at}"] = JointPlace("pulley", structure.point(at), about, (at,))
    return out


def _all(structure: Structure) -> Iterator[tuple[str, str, Joint | End, tuple[str, str]]]:
    """Name, type, joint, and its two points; of a beam's end, that at its node and the beam's other one."""
    for name, joint in structure.machine.joints.items():
        yield name, joint.type, joint, joint.between
    for name, beam in structure.machine.beams.items():
        for side, end in enumerate(beam.ends):
            yield f"{name}.{'ij'[side]}", end.joint, end, (beam.between[side], beam.between[1 - side])


def _triad(structure: Structure, joint: Joint | End, between: tuple[str, str]) -> Array:
    chord = structure.position(structure.point(between[1])) - structure.position(structure.point(between[0]))
    return joint_triad(structure, joint, chord if chord.any() else np.array([0.0, 0.0, 1.0]))


def _axis(structure: Structure, frames: dict[str, int], side: tuple[str, int], node: str, axis: Array) -> Axis:
    """An axis (3,), base axes in the reference configuration, as what carries it has it: also what parameters turn."""
    name, number = side
    labels = (f"{name}.axis", f"{name}.{'ij'[number]}.axis")
    tilted = next((frames[label] for label in labels if label in frames), None)
    if tilted is None:
        return _carried(structure, node, axis)
    carrier = structure.builder.carriers[tilted]
    return tilted, structure.orientation(carrier).T @ axis


def _carried(structure: Structure, node: str, axis: Array) -> Axis:
    rotation = structure.rotations.get(structure.owner.get(node, node), GROUND)
    return rotation, structure.orientation(rotation).T @ axis
