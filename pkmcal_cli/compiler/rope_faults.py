"""What is wrong with ropes: pulleys that cannot be where they are, ropes of one drive that do not make one cable."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from pkmcal_cli.base.errors import Fault
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.compiler.coefficient_values import unit
from pkmcal_cli.compiler.rope_path import RopePath, pulley_axis, rope_path, swivels_towards
from pkmcal_cli.compiler.ropes import Cable, cables
from pkmcal_cli.compiler.structure import Structure
from pkmcal_cli.elements import PlanarPulleyElement, SwivelPulleyElement
from pkmcal_cli.language.machine import Machine, Rope
from pkmcal_cli.language.quantities import Quantity
from pkmcal_cli.mechanism.topology import RotationKind

_FLEET = np.deg2rad(5.0)  # angle to the axis of a pulley at which a rope may come to it
_DOUBTFUL = np.deg2rad(240.0)  # a rope that goes further round a pulley is likely on its other side


def rope_faults(machine: Machine) -> list[Fault]:
    """Faults that are seen without building the machine."""
    faults = [fault for cable in cables(machine).values() for fault in _cable_faults(machine, cable)]
    if machine.space == "spatial":
        faults += [fault for name, rope in machine.ropes.items() for fault in _guidance_faults(machine, name, rope)]
    return faults


def _cable_faults(machine: Machine, cable: Cable) -> Iterator[Fault]:
    """What the ropes of one cable state together."""
    drive = next(iter(n for n, a in machine.actuators.items() if a.winds is not None and a.target == cable.name), "")
    names = list(cable.ropes)
    for key in ("EA", "k"):
        other = {"EA": "k", "k": "EA"}[key]
        stated = {n: value for n, rope in cable.ropes.items() if (value := getattr(rope, key)) is not None}
        for first, second in pairwise(stated):
            if not _same(stated[first], stated[second]):
                message = f"`{first}` and `{second}` are one cable of `{drive}`, but differ in `{key}`"
                hint = "give it once, for the whole cable"
                yield machine.source.fault("value", message, ("ropes", second, key), hint, at_key=True)
        if key == "k" and stated and (mixed := [n for n in names if getattr(cable.ropes[n], other) is not None]):
            message = f"`{mixed[0]}` and `{next(iter(stated))}` are one cable of `{drive}`: one has `EA`, the other `k`"
            yield machine.source.fault(
                "value", message, ("ropes", next(iter(stated)), "k"), "give one of them, once", at_key=True
            )
    lengths = [n for n in names if cable.ropes[n].length is not None]
    if lengths and len(lengths) < len(names):
        missing = next(n for n in names if n not in lengths)
        message = f"`{lengths[0]}` and `{missing}` are one cable of `{drive}`: one has a `length`, the other has none"
        hint = "give the length of every rope of a cable, or of none"
        yield machine.source.fault("value", message, ("ropes", missing), hint, at_key=True)


def _same(first: Quantity, second: Quantity) -> bool:
    """Whether two quantities are the same number, or the same expression."""
    if first.is_constant and second.is_constant:
        return first.number({}) == second.number({})
    return first.term == second.term


def _guidance_faults(machine: Machine, name: str, rope: Rope) -> Iterator[Fault]:
    """Pulleys in space to which the rope does not come from a point of their own body, or from two."""
    guided = {}
    for visit, point in enumerate(rope.between):
        if point not in rope.pulleys:
            continue
        path = ("ropes", name, "pulleys", point)
        if point in machine.nodes and not machine.nodes[point].fixed:
            message, hint = f"node `{point}` has no axis about which a pulley could swivel", "use a point of a body"
            yield machine.source.fault("pulley", message, path, hint, at_key=True)
            continue
        side = guided[visit] = swivels_towards(machine, rope, visit)
        if side is None:
            neighbours = [rope.between[v] for v in (visit - 1, visit + 1) if 0 <= v < len(rope.between)]
            both = " or ".join(f"`{n}`" for n in neighbours)
            message = f"the pulley at `{point}` swivels, but whether towards {both} is not clear"
            hint = f"the rope must come along the axis from exactly one point of the part that carries `{point}`"
            yield machine.source.fault("pulley", message, path, hint, at_key=True)
        elif side == -1 and guided.get(visit - 1) == 1:
            before = rope.between[visit - 1]
            message = f"between `{before}` and `{point}` the rope would lie on two pulleys that swivel"
            yield machine.source.fault(
                "pulley", message, path, "give a pulley to one of the two points only", at_key=True
            )


def drawn_faults(structure: Structure) -> list[Fault]:
    """Faults and warnings of ropes as drawn: no tangent, a rope that misses its pulley's axis, a doubtful side."""
    return [
        fault
        for name, rope in structure.machine.ropes.items()
        if rope.pulleys
        for fault in _path_faults(structure, name, rope_path(structure, rope))
    ]


def pull_faults(structure: Structure) -> list[Fault]:
    """Ropes whose drives are stated to push, or to pull with nothing."""
    return [
        fault
        for name, drive in structure.machine.actuators.items()
        if drive.winds is not None and drive.force is not None and drive.force.otherwise is not None
        for fault in _pull_faults(structure, name, drive.force.otherwise.number(structure.nominal))
    ]


def _pull_faults(structure: Structure, name: str, force: float) -> Iterator[Fault]:
    source, path = structure.machine.source, ("actuators", name, "force")
    if force < 0:
        message = f"a negative force pushes, but `{name}` winds a rope, which can only pull"
        yield source.fault("value", message, path, "write the tension as a positive number")
    elif force == 0:
        message, hint = f"`{name}` pulls with no force: its rope is slack", "write the tension as a positive number"
        yield source.fault("value", message, path, hint, warning=True)


def _path_faults(structure: Structure, name: str, path: RopePath) -> Iterator[Fault]:
    rope = path.rope
    for (first, last), free in zip(path.ends, path.free, strict=True):
        if not np.isfinite(free):
            yield _no_tangent(structure, name, rope, [rope.between[first], rope.between[last]])
            return
    if isinstance(path.shape, PlanarPulleyElement):
        yield from _planar_faults(structure, name, path)
    elif isinstance(path.shape, SwivelPulleyElement):
        yield from _axis_faults(structure, name, rope)


def _no_tangent(structure: Structure, name: str, rope: Rope, ends: list[str]) -> Fault:
    """A rope between two points of which one is within the pulley at the other, or whose pulleys are in the way."""
    length = structure.machine.file_units.length
    way = _place(structure, ends[1]) - _place(structure, ends[0])
    held = [point for point in ends if point in rope.pulleys]
    radii = [length.format(rope.pulleys[p].radius.number(structure.nominal), 4) for p in held]
    sizes = f"the radii are {radii[0]} and {radii[1]}" if len(held) == 2 else f"the pulley has a radius of {radii[0]}"
    apart = length.format(float(np.sqrt(way @ way)), 4)
    message = f"no tangent for rope `{name}` from `{ends[0]}` to `{ends[1]}`: they are {apart} apart, {sizes}"
    hint = "correct the radius, the side of the rope, or the points"
    return structure.machine.source.fault("pulley", message, ("ropes", name, "pulleys", held[-1]), hint, at_key=True)


def _planar_faults(structure: Structure, name: str, path: RopePath) -> Iterator[Fault]:
    source, rope = structure.machine.source, path.rope
    for visit, point in enumerate(rope.between):
        if point not in rope.pulleys:
            continue
        where = ("ropes", name, "pulleys", point)
        if visit in (0, len(rope.between) - 1) and _rotates(structure, point):
            message = f"rope `{name}` ends on a pulley at `{point}`, which rotates: the rope on it would rotate too"
            hint = "end the rope at the point, or let the pulley's point be fixed or on a carriage"
            yield source.fault("pulley", message, where, hint, at_key=True)
        wrap = abs(float(path.geometry.sizes[0, visit, 3])) if 0 < visit < len(rope.between) - 1 else 0.0
        if wrap > _DOUBTFUL:
            message = f"rope `{name}` goes round the pulley at `{point}` by {np.rad2deg(wrap):.0f} deg"
            other = "right" if rope.pulleys[point].side == "left" else "left"
            hint = f"if it only touches it, write `side: {other}`"
            yield source.fault("pulley", message, (*where, "side"), hint, warning=True)


def _rotates(structure: Structure, point: str) -> bool:
    """Whether a point belongs to something that turns against the base."""
    rotation = structure.rotations.get(structure.owner.get(point, point))
    return rotation is not None and structure.builder.rotations[rotation][0] != RotationKind.FIXED


def _axis_faults(structure: Structure, name: str, rope: Rope) -> Iterator[Fault]:
    """Ropes that do not come to a pulley along its axis."""
    for visit, point in enumerate(rope.between):
        pulley = rope.pulleys.get(point)
        side = swivels_towards(structure.machine, rope, visit)
        if pulley is None or side is None or not 0 <= visit - side < len(rope.between):
            continue
        neighbour = rope.between[visit - side]
        way = _place(structure, point) - _place(structure, neighbour)
        angle = float(np.arccos(np.clip(unit(way) @ pulley_axis(structure, pulley), -1, 1)))
        if angle > _FLEET:
            message = (
                f"the rope comes to the pulley at `{point}` from `{neighbour}` at {np.rad2deg(angle):.0f} deg to `axis`"
            )
            hint = (
                f"it must come along the axis, which points from `{neighbour}` to `{point}`; correct one of the three"
            )
            path = ("ropes", name, "pulleys", point, "axis")
            yield structure.machine.source.fault("pulley", message, path, hint)


def _place(structure: Structure, point: str) -> Array:
    return structure.position(structure.point(point))
