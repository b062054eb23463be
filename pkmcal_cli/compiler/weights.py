"""Loads: forces and moments at points, masses, members' weights half and half at their ends (Ecorchard 2010, 2.2)."""

from __future__ import annotations

from dataclasses import dataclass

from pkmcal_cli.compiler.numbers import combined, is_zero, number, vector
from pkmcal_cli.compiler.structure import Structure
from pkmcal_cli.elements import Load
from pkmcal_cli.language.quantities import Quantity
from pkmcal_cli.mechanism.connection_points import Number, Point, Port
from pkmcal_cli.mechanism.topology import GROUND, Turn


@dataclass(frozen=True)
class Weight:
    """A mass (kg) lumped at a port."""

    name: str
    port: Port
    mass: Number


def halves(name: str, ports: tuple[Port, Port], mass: Number) -> list[Weight]:
    """A member's mass, half at each end."""
    half = combined(lambda m: 0.5 * m, mass)
    return [Weight(f"{name}.{side}", port, half) for side, port in zip("ij", ports, strict=True)]


def add_loads(structure: Structure, weights: list[Weight]) -> None:
    """Nodal forces and moments, masses of nodes and bodies, and lumped weights."""
    machine = structure.machine
    for name, load in machine.loads.items():
        if not is_zero(load.force):
            force = [number(q) for q in load.force]
            _add_force(structure, f"{name}.force", structure.port(load.at), force)
        if not is_zero(load.moment):
            _add_moment(structure, f"{name}.moment", structure.rotation(load.at), load.moment)
    if not machine.own_weight or not machine.gravity:
        return
    for name, node in machine.nodes.items():
        if node.mass is not None:
            weights = [*weights, Weight(name, structure.port(name), number(node.mass))]
    for name, body in machine.bodies.items():
        if body.mass is not None:
            weights = [*weights, Weight(name, _centre(structure, name), number(body.mass))]
    for weight in weights:
        force = [combined(lambda m, a: m * a, weight.mass, a) for a in machine.gravity]
        _add_force(structure, f"{weight.name}.weight", weight.port, force)


def _add_moment(structure: Structure, name: str, rotation: int, moment: tuple[Quantity, ...]) -> None:
    """A moment on a rotation: its part about the axis of one that turns about one, none on a fixed one."""
    b = structure.builder
    kind, axis = b.rotations[rotation][:2]
    if kind == Turn.AXIS:
        parts = [number(q) for q in moment]
        about = axis if len(parts) == 3 else axis[2:]
        share = combined(lambda *m: sum(a * v for a, v in zip(about.tolist(), m, strict=True)), *parts)
        b.force("rotation", 3 * rotation, b.slot(share, name))
    elif kind == Turn.FREE:
        for k, q in enumerate(moment):
            b.force("rotation", 3 * rotation + k, b.slot(number(q), f"{name}.{k}"))


def _centre(structure: Structure, name: str) -> Port:
    """Centre of mass of a body."""
    port, centre = structure.port(name), structure.machine.bodies[name].centre
    if is_zero(centre):
        return port

    return Port(port.point + structure.builder.offset(port.rotation, vector(centre), f"{name}.centre"), port.rotation)


def _add_force(structure: Structure, name: str, port: Port, force: list[Number]) -> None:
    full = (list(force) + [0.0] * 3)[:3]
    pull = [combined(lambda f: -f, f) for f in full]
    base = Port(Point(), GROUND)
    structure.builder.link(Load(), name, (base, port), rest=[0.0] * 3, stiffness=[], rigid=[False] * 3, prestress=pull)
