"""What can be drawn of a machine: where its named points, guides and members are, in any state."""

from __future__ import annotations

from pkmcal_cli.compiler.joint_places import joint_places
from pkmcal_cli.compiler.structure import Structure
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.language.quantities import Quantity
from pkmcal_cli.mechanism.connection_points import Member
from pkmcal_cli.model.layout import Layout, Piece


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
    joints = {n: j for n, j in joint_places(structure).items() if j.between[0] in used}
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
