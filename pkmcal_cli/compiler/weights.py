"""Loads: forces and moments at points, masses, members' weights half and half at their ends (Ecorchard 2010, 2.2)."""

from __future__ import annotations

from dataclasses import dataclass

from pkmcal_cli.compiler.coefficient_values import combined, is_zero, number, vector
from pkmcal_cli.compiler.structure import Structure
from pkmcal_cli.elements import LoadElement, SpanWeight
from pkmcal_cli.language.quantities import Quantity
from pkmcal_cli.mechanism.connection_points import ConnectionPoint, Number, Point
from pkmcal_cli.mechanism.topology import GROUND, RotationKind

_BASE = ConnectionPoint(Point(), GROUND)


@dataclass(frozen=True, kw_only=True)
class Weight:
    """A mass (kg) lumped at a connection point; with a power, a mass over that power of a natural length.

    origin: point from which the place counts; length (m), slides: the natural length and travels that add to it.
    """

    name: str
    connection: ConnectionPoint
    mass: Number
    origin: ConnectionPoint = _BASE
    power: int = 0
    length: Number = 0.0
    slides: tuple[tuple[int, float], ...] = ()


def halves(name: str, connections: tuple[ConnectionPoint, ConnectionPoint], mass: Number) -> list[Weight]:
    """A member's mass, half at each end."""
    half = combined(lambda m: 0.5 * m, mass)
    return [
        Weight(name=f"{name}.{side}", connection=end, mass=half) for side, end in zip("ij", connections, strict=True)
    ]


def add_loads(structure: Structure, weights: list[Weight]) -> None:
    """Nodal forces and moments, masses of nodes and bodies, and lumped weights."""
    machine = structure.machine
    for name, load in machine.loads.items():
        if not is_zero(load.force):
            force = [number(q) for q in load.force]
            _add_force(structure, f"{name}.force", structure.connection(load.at), force)
        if not is_zero(load.moment):
            _add_moment(structure, f"{name}.moment", structure.rotation(load.at), load.moment)
    if not machine.own_weight or not machine.gravity:
        return
    for name, node in machine.nodes.items():
        if node.mass is not None:
            weights = [*weights, Weight(name=name, connection=structure.connection(name), mass=number(node.mass))]
    for name, body in machine.bodies.items():
        if body.mass is not None:
            weights = [*weights, Weight(name=name, connection=_centre(structure, name), mass=number(body.mass))]
    for weight in weights:
        force = [combined(lambda m, a: m * a, weight.mass, a) for a in machine.gravity]
        if weight.power:
            _add_spread_force(structure, weight, force)
        else:
            _add_force(structure, f"{weight.name}.weight", weight.connection, force)


def _add_moment(structure: Structure, name: str, rotation: int, moment: tuple[Quantity, ...]) -> None:
    """A moment on a rotation: its part about the axis of one that turns about one, none on a fixed one."""
    b = structure.builder
    kind, axis = b.rotations[rotation][:2]
    if kind == RotationKind.AXIS:
        parts = [number(q) for q in moment]
        about = axis if len(parts) == 3 else axis[2:]
        share = combined(lambda *m: sum(a * v for a, v in zip(about.tolist(), m, strict=True)), *parts)
        b.force("rotation", 3 * rotation, b.coefficient(share, name))
    elif kind == RotationKind.FREE:
        for k, q in enumerate(moment):
            b.force("rotation", 3 * rotation + k, b.coefficient(number(q), f"{name}.{k}"))


def _centre(structure: Structure, name: str) -> ConnectionPoint:
    """Centre of mass of a body."""
    connection, centre = structure.connection(name), structure.machine.bodies[name].centre
    if is_zero(centre):
        return connection

    return ConnectionPoint(
        connection.point + structure.builder.offset(connection.rotation, vector(centre), f"{name}.centre"),
        connection.rotation,
    )


def _add_force(structure: Structure, name: str, connection: ConnectionPoint, force: list[Number]) -> None:
    structure.builder.link(
        LoadElement(),
        name,
        (_BASE, connection),
        rest=[0.0] * 3,
        stiffness=[],
        rigid=[False] * 3,
        prestress=_pull(force),
    )


def _add_spread_force(structure: Structure, weight: Weight, force: list[Number]) -> None:
    """A force times a power of the natural length of a span."""
    structure.builder.link(
        SpanWeight(weight.power),
        f"{weight.name}.weight",
        (weight.origin, weight.connection),
        rest=[weight.length, 0.0, 0.0, 0.0],
        stiffness=[],
        rigid=[False] * 4,
        prestress=[0.0, *_pull(force)],
        slides=weight.slides,
    )


def _pull(force: list[Number]) -> list[Number]:
    """Prestress (3,) of a force in the space's axes."""
    return [combined(lambda f: -f, f) for f in (list(force) + [0.0] * 3)[:3]]
