"""Sockets of a machine: which slots every port of every place displaces."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.rotation import Array, skew
from pkmcal_cli.compiler.drives import PlacedDrive
from pkmcal_cli.compiler.numbers import number
from pkmcal_cli.compiler.structure import Structure
from pkmcal_cli.effects import Port as EffectPort
from pkmcal_cli.mechanism.topology import Group, Index, Layout
from pkmcal_cli.model.effect_sites import Socket, Sockets
from pkmcal_cli.model.observed import PlacedSensor

_AXES = "xyz"
TOOL, LOAD = "tool", "effect.load"
"""Kind of the offsets of what sensors see, and name of the load at the first of them; both zero without effects."""


@dataclass(frozen=True)
class _Collector:
    structure: Structure
    layout: Layout
    drives: Sequence[PlacedDrive]
    sensors: Sequence[PlacedSensor]
    drawn: Array  # (S,) slots with the drives at the drawing

    @property
    def axes(self) -> int:
        return 2 if self.layout.planar else 3

    def offset(self, kind: str, name: str) -> Index:
        """Slots (3,) of an anchored offset vector."""
        return np.array(self.structure.builder.offsets[self.structure.anchors[kind, name]], dtype=np.intp)

    def found(self, element: str) -> Iterator[tuple[int, int, Group]]:
        """Places of an element of this name, or of its pieces NAME.0, NAME.1 ..."""
        for g, group in enumerate(self.layout.groups):
            for e, name in enumerate(group.names):
                stem, _, piece = name.partition(".")
                if name == element or (stem == element and piece.isdigit()):
                    yield g, e, group


def sockets_of(
    structure: Structure, layout: Layout, drives: Sequence[PlacedDrive], sensors: Sequence[PlacedSensor], drawn: Array
) -> Sockets:
    """All sockets of a machine compiled to take effects; `drawn` (S,): slots with the drives at the drawing."""
    c = _Collector(structure, layout, drives, sensors, drawn)
    out: dict[EffectPort, dict[str, tuple[Socket, ...]]] = {
        "command": dict(_commands(c)),
        "drive_force": dict(_drive_forces(c)),
        "length": dict(_lengths(c)),
        "guide": dict(_guides(c)),
        "carriage": dict(_carriages(c)),
        "base": dict(_base(c)),
        "tool": dict(_tools(c)),
        "stiffness": dict(_stiffnesses(c)),
        "weight": dict(_weights(c)),
        "load": dict(_loads(c)),
        "frame": dict(_instrument_frames(c)),
    }
    return out


Named = Iterator[tuple[str, tuple[Socket, ...]]]
_ONE = np.ones((1, 1))


def _kind(c: _Collector, a: int) -> tuple[str, float]:
    """Kind of a drive and the radius of its spool (m; 1 otherwise)."""
    actuator = c.structure.machine.actuators[c.drives[a].drive.name]
    if actuator.winds is not None and actuator.radius is not None:
        return "spool", actuator.radius.number(c.structure.nominal)
    return ("rotary" if actuator.turns is not None else "linear"), 1.0


def _commands(c: _Collector) -> Named:
    for a, drive in enumerate(c.layout.drives):
        kind, radius = _kind(c, a)
        period = c.structure.machine.actuators[drive.name].period
        repeats = math.nan if period is None else period.number(c.structure.nominal)
        made = Socket(
            part=drive.name, slots=_slots(drive.slot), matrix=_ONE, actuator=a, length=radius, kind=kind, period=repeats
        )
        yield drive.name, (made,)


def _drive_forces(c: _Collector) -> Named:
    for a, drive in enumerate(c.layout.drives):
        if drive.force_controlled:
            yield (
                drive.name,
                (Socket(part=drive.name, slots=_slots(drive.force_slot), matrix=drive.force_sign * _ONE, actuator=a),),
            )


def _lengths(c: _Collector) -> Named:
    machine = c.structure.machine
    for name in (*machine.bars, *machine.ropes, *machine.beams):
        pieces = []
        for g, e, group in c.found(name):
            slot = group.rest.start + e * len(group.element.strains)
            pieces.append((slot, (g, e), float(c.drawn[slot])))
        share = 1.0 / len(pieces)
        total = sum(length for _, _, length in pieces)
        slots = np.array([slot for slot, _, _ in pieces])
        yield (
            name,
            (
                Socket(
                    part=name, slots=slots, matrix=np.full((len(pieces), 1), share), member=pieces[0][1], length=total
                ),
            ),
        )


def _travelling(c: _Collector) -> Iterator[tuple[str, str, int]]:
    """Carriages with their guide and the drive that moves them."""
    machine = c.structure.machine
    for a, drive in enumerate(c.layout.drives):
        body = machine.actuators[drive.name].moves
        if body is not None and (guide := machine.bodies[body].on) is not None:
            yield body, guide, a


def _guides(c: _Collector) -> Named:
    gravity = _gravity(c)
    found: dict[str, list[Socket]] = {}
    for body, guide, a in _travelling(c):
        rail = c.structure.rails[guide]
        triad = c.structure.orientation(rail.rotation)
        for k in range(c.axes):
            if abs(rail.along[k]) < 0.9:
                normal = np.eye(3)[k] - rail.along[k] * rail.along
                normal /= np.sqrt(normal @ normal)
                down = np.array([gravity @ triad @ normal, 0.0, 0.0])
                name = f"{guide}.{_AXES[k]}"
                made = Socket(
                    part=guide, slots=c.offset("carriage", body), matrix=normal[:, None], actuator=a, down=down
                )
                found.setdefault(name, []).append(made)
    for name, made_all in found.items():
        yield name, tuple(made_all)


def _carriages(c: _Collector) -> Named:
    """Turns of carriages: of the rail's side of the springs where they tilt, else as moves of their points.

    Not where members feel the orientation of a carriage that does not tilt.
    """
    machine = c.structure.machine
    for body, guide, a in _travelling(c):
        points = machine.bodies[body].points
        if any(d[0] == "r" for d in c.structure.elastic_directions(guide)):
            yield from _tilts(c, body, a)
            continue
        if not points or _turn_is_felt(c, body):
            continue
        slots = np.concatenate([c.offset("point", p) for p in points])
        arms = c.layout.slots.constants[slots].reshape(-1, 3)
        for k in [2] if c.layout.planar else range(3):
            moved = (skew(np.eye(3)[k]) @ arms.T).T.reshape(-1, 1)
            if moved.any():
                yield f"{body}.r{_AXES[k]}", (Socket(part=body, slots=slots, matrix=moved, actuator=a),)


def _tilts(c: _Collector, body: str, a: int) -> Named:
    """Turns at which the springs of a carriage that tilts are at rest."""
    for _, e, group in c.found(f"{body}.guidance"):
        strains = group.element.strains
        for m, strain in enumerate(strains):
            if strain[0] == "r":
                slot = group.rest.start + e * len(strains) + m
                yield f"{body}.{strain}", (Socket(part=body, slots=_slots(slot), matrix=_ONE, actuator=a),)


def _turn_is_felt(c: _Collector, body: str) -> bool:
    """Whether a beam or joint is fixed to the orientation of a carriage; its guide and drive look along the rail."""
    travel = c.structure.carriage_travel[body]
    return any(
        link.element is not None
        and link.element.uses_triads
        and any(t == travel for port in link.ports for _, t, _ in port.point.travels)
        and link.name not in (f"{body}.guidance", *(f"{d.drive.name}.drive" for d in c.drives))
        for link in c.structure.builder.links
    )


def _base(c: _Collector) -> Named:
    for kind, name in c.structure.anchors:
        inner = kind == "guide" and c.structure.machine.guides[name].frame is not None
        if kind in ("ground", "frame", "guide") and not inner:
            slots = c.offset(kind, name)
            matrix = np.eye(3)
            matrix[c.axes :] = 0.0
            yield name, (Socket(part=name, slots=slots, matrix=matrix, at=c.layout.slots.constants[slots]),)


def _tools(c: _Collector) -> Named:
    for sensor in c.sensors:
        if sensor.name and (TOOL, sensor.name) in c.structure.anchors:
            matrix = np.eye(3)
            matrix[c.axes :] = 0.0
            yield sensor.name, (Socket(part=sensor.name, slots=c.offset(TOOL, sensor.name), matrix=matrix),)


def _instrument_frames(c: _Collector) -> Named:
    for sensor in c.sensors:
        if "motion" in sensor.given and c.structure.receptive:
            slots = sensor.given["motion"].slots
            yield sensor.name, (Socket(part=sensor.name, slots=slots, matrix=np.eye(len(slots))),)


def _stiffnesses(c: _Collector) -> Named:
    """Elements that yield, by name; pieces of a beam together."""
    found: dict[str, list[int]] = {}
    for group in c.layout.groups:
        count = len(group.element.patterns)
        for e, name in enumerate(group.names):
            slots = [group.stiffness.start + e * count + p for p in range(count)]
            used = [s for s in slots if c.layout.slots.constants[s] > 0]
            stem, _, piece = name.partition(".")
            if used:
                found.setdefault(stem if piece.isdigit() else name, []).extend(used)
    for name, every in found.items():
        yield name, (Socket(part=name, slots=np.array(every), matrix=np.ones((len(every), 1)), scales=True),)


def _weights(c: _Collector) -> Named:
    """All weights, by their names."""
    slots = [
        group.prestress.start + e * len(group.element.strains) + k
        for group in c.layout.groups
        for e, name in enumerate(group.names)
        if name.endswith(".weight")
        for k in range(len(group.element.strains))
    ]
    if slots:
        loads = c.layout.slots.constants[slots]
        yield "machine", (Socket(part="machine", slots=np.array(slots), matrix=loads[:, None]),)


def _loads(c: _Collector) -> Named:
    for _, e, group in c.found(LOAD):
        slots = group.prestress.start + e * 3 + np.arange(3)
        matrix = -np.eye(3)
        matrix[c.axes :] = 0.0
        down = _gravity(c)
        name = next((s.name for s in c.sensors if s.kind.sees_tool), "tcp")
        yield name, (Socket(part=name, slots=slots, matrix=matrix, down=down),)


def _gravity(c: _Collector) -> Array:
    """Unit vector of gravity in base axes; zero without."""
    parts = [number(q) for q in c.structure.machine.gravity]
    vector = np.array([float(p) if isinstance(p, float | int) else 0.0 for p in parts] + [0.0] * (3 - len(parts)))
    size = float(np.sqrt(vector @ vector))
    return vector / size if size else vector


def _slots(*numbers: int) -> Index:
    return np.array(numbers, dtype=np.intp)
