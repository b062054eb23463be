"""The places that are fixed to the base, and what stands on them or looks at them.

A guide of a driven carriage has its place where the drive reads zero: moving the base moves the scale of the drive too.
A frame has a place of its own only for a sensor that looks at it; else its guides have.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.compiler.structure import Structure
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.mechanism.connection_points import Point
from pkmcal_cli.mechanism.topology import GROUND, Drive
from pkmcal_cli.model.base import Base, Index, PlaceVector


def base_of(
    structure: Structure, drives: Sequence[Drive], supports: frozenset[tuple[str, str]], machine: Machine
) -> Base:
    """Everything that is fixed to the base; `supports`: the anchors that something stands on."""
    builder = structure.builder
    standing = [name for name, frame in machine.frames.items() if frame.body is None]
    rotations = [builder.rotations[structure.rails.frames[name][1]][3] for name in standing]
    carrying = {guide.frame for guide in machine.guides.values()}
    seen_frames = {name: _looking(machine, name) for name in standing}
    anchors = [a for a in structure.anchors if a[0] in ("ground", "fixed") or (a[0] == "frame" and seen_frames[a[1]])]
    seen_places = [() if a in supports and a[0] != "frame" else _looking(machine, a[1]) for a in anchors]
    places = [(_offset(structure, GROUND, 1.0, structure.anchors[a]),) for a in anchors]
    guides = _guide_places(structure, drives, machine)
    return Base(
        places=(*places, *guides),
        rotations=np.array(rotations, dtype=np.intp).reshape(-1, 3),
        only_seen_by=(*seen_places, *(() for _ in guides)),
        rotations_only_seen_by=tuple(() if name in carrying else seen_frames[name] for name in standing),
    )


def _guide_places(structure: Structure, drives: Sequence[Drive], machine: Machine) -> list[tuple[PlaceVector, ...]]:
    """Of guides on the base: where each drive of a carriage reads zero; where travel begins if none drives one."""
    standing = {name for name, guide in machine.guides.items() if guide.on_base or _frame_stands(machine, guide.frame)}
    driven: dict[str, list[int]] = {name: [] for name in standing}
    for drive, actuator in zip(drives, machine.actuators.values(), strict=True):
        guide = machine.bodies[actuator.moves].guide if actuator.moves is not None else None
        if guide in driven:
            driven[guide].append(drive.coefficient)
    places: list[tuple[PlaceVector, ...]] = []
    for name, coefficients in driven.items():
        rail = structure.rails.guides[name]
        origin = _origin(structure, rail.origin)
        turned, along = _rotations(structure, rail.tilted), rail.along[:, None]
        places += [(*origin, PlaceVector(np.array([k], dtype=np.intp), along, turned)) for k in coefficients]
        if not coefficients:
            places.append(origin)
    return places


def _frame_stands(machine: Machine, frame: str | None) -> bool:
    return frame is not None and machine.frames[frame].body is None


def _origin(structure: Structure, point: Point) -> tuple[PlaceVector, ...]:
    return tuple(_offset(structure, rotation, sign, k) for rotation, sign, k in point.offsets)


def _offset(structure: Structure, rotation: int, sign: float, number: int) -> PlaceVector:
    coefficients: Index = np.array(structure.builder.offsets[number], dtype=np.intp)
    return PlaceVector(coefficients, sign * np.eye(3), _rotations(structure, rotation))


def _rotations(structure: Structure, rotation: int) -> tuple[tuple[Index, Array], ...]:
    """What turns a frame on the base, the outermost first."""
    out: list[tuple[Index, Array]] = []
    while rotation != GROUND:
        _, _, reference, coefficients, _ = structure.builder.rotations[rotation]
        out.append((np.array(coefficients, dtype=np.intp), reference))
        rotation = structure.builder.carriers[rotation]
    return tuple(reversed(out))


def _looking(machine: Machine, name: str) -> tuple[str, ...]:
    """Sensors that look at a ground point or frame."""
    return tuple(s for s, sensor in machine.sensors.items() if name in (sensor.to, sensor.surface))
