"""What can be drawn of a machine: where its named points, guides and members are, in any state."""

from __future__ import annotations

from pkmcal_cli.compiler.structure import Structure
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.language.quantities import Quantity
from pkmcal_cli.mechanism.connection_points import Member
from pkmcal_cli.model.layout import Layout, Piece


def layout_of(structure: Structure) -> Layout:
    """The layout of a structure whose members are linked."""
    machine = structure.machine
    names = [*machine.nodes, *machine.bodies, *machine.ground, *structure.owner]
    pieces = {name: _pieces(structure, name, between) for name, between in members(machine).items()}
    return Layout({n: structure.point(n) for n in names}, dict(structure.rails.guides), pieces)


def members(machine: Machine[Quantity, float]) -> dict[str, tuple[str, ...]]:
    """The points that each member runs through, of all sections of what joins points, but for joints."""
    out: dict[str, tuple[str, ...]] = {}
    for section in type(machine).model_fields:
        entries = getattr(machine, section)
        if section != "joints" and isinstance(entries, dict):
            out |= {n: e.between for n, e in entries.items() if hasattr(e, "between")}
    return out


def _pieces(structure: Structure, name: str, between: tuple[str, ...]) -> tuple[Piece, ...]:
    """The elements of a member, in order; none of a rope: its links may be those of several."""
    found = []
    for member in structure.builder.members:
        own, _, number = member.name.partition(".")
        if own == name and (not number or number.isdigit()) and not member.rope and _joins(member):
            found.append(Piece(member.name, member.links[0], any(s.startswith("bend") for s in member.element.strains)))
    return tuple(found)


def _joins(member: Member) -> bool:
    """Whether an element lies between its ends, not in one place: its strains do not begin with a gap."""
    return member.element.strains[0] not in ("x", "y", "z", "rx", "ry", "rz", "angle", "length")
