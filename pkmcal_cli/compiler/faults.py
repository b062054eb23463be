"""What is wrong with a mechanism, as faults with a place and a remedy."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pkmcal_cli.base.errors import Fault
from pkmcal_cli.compiler.assemble import BadConfiguration, Gap, Mobility
from pkmcal_cli.compiler.axes import depends, parallel
from pkmcal_cli.compiler.build import Compiled
from pkmcal_cli.compiler.coefficient_values import constant_vector, is_zero
from pkmcal_cli.compiler.connection import unconnected_parts
from pkmcal_cli.compiler.limit_faults import beyond_beams, outside_limits
from pkmcal_cli.compiler.paths import path_of
from pkmcal_cli.compiler.physical import section_faults
from pkmcal_cli.compiler.placed_effects import weightless
from pkmcal_cli.compiler.rope_faults import rope_faults
from pkmcal_cli.compiler.stiffness_faults import stiffness_faults
from pkmcal_cli.compiler.workspaces import workspace_faults
from pkmcal_cli.effects import catalogue
from pkmcal_cli.language.machine import End, Joint, Machine
from pkmcal_cli.language.quantities import Quantity
from pkmcal_cli.units.limits import SMALLEST
from pkmcal_cli.yaml_source.tree import Path

GAP = 0.01  # a configuration that does not close by more than this share of the machine's size is a fault


def structure_faults(machine: Machine) -> list[Fault]:
    """Faults that are seen without building the machine."""
    if not machine.nodes and not machine.bodies:
        hint = "add `bodies:` or `nodes:`"
        return [machine.source.fault("empty", "the machine has neither bodies nor nodes", (), hint)]
    unconnected = [_unconnected_fault(machine, name) for name in unconnected_parts(machine)]
    return [
        *_frozen_directions(machine),
        *_no_directions(machine),
        *_rotated_carriages(machine),
        *_unhinged(machine),
        *_reversed_limits(machine),
        *stiffness_faults(machine),
        *rope_faults(machine),
        *section_faults(machine),
        *unconnected,
    ]


def configuration_fault(machine: Machine, error: BadConfiguration) -> Fault:
    """a configuration from which nothing can be built."""
    return machine.source.fault("drawing", str(error), path_of(machine, error.element), error.hint, at_key=True)


def _mobility_faults(machine: Machine, mobility: Mobility) -> list[Fault]:
    if mobility.matched and not mobility.special and not mobility.rigid_loops:
        return []
    from pkmcal_cli.compiler.mobility_faults import mobility_faults  # most machines have none

    return mobility_faults(machine, mobility)


def mechanism_faults(machine: Machine, compiled: Compiled) -> list[Fault]:
    """Faults (errors and warnings) of mobility, closed loops and the reference assembly."""
    faults = [_gap_fault(machine, gap, compiled.model.length) for gap in _worst_gaps(compiled.gaps)]
    if any(f.severity == "error" for f in faults):
        return faults  # ranks of a configuration that does not close mean nothing
    return [
        *faults,
        *compiled.doubts,
        *_mobility_faults(machine, compiled.mobility),
        *_shared_misfit(machine, compiled.shared_by),
        *outside_limits(machine, compiled.model),
        *beyond_beams(machine, compiled.model),
        *workspace_faults(machine, compiled.model),
        *_weightless_effects(machine),
    ]


def _frozen_directions(machine: Machine) -> list[Fault]:
    """Directions that must not depend on parameters: they are drawn once and for all."""
    frozen: list[tuple[Path, tuple[Quantity, ...], str]] = [
        (("beams", name, "up"), beam.up, "give numbers") for name, beam in machine.beams.items()
    ]
    for name, body in machine.bodies.items():
        if any(direction.startswith("r") for direction in body.fixed):
            frozen.append((("bodies", name, "turn"), body.turn, "give numbers; to turn a body, move its points"))
    if machine.workspace is not None and machine.workspace.cylinder is not None:
        axis = machine.workspace.cylinder.axis
        if isinstance(axis, tuple):
            frozen.append((("workspace", "cylinder", "axis"), axis, "give numbers"))
    return [
        machine.source.fault("direction", f"`{path[-1]}` must not depend on parameters", path, hint)
        for path, direction, hint in frozen
        if depends(direction)
    ]


def _no_directions(machine: Machine) -> list[Fault]:
    """Directions of length 0 at nominal parameters, and pairs of axes that are one."""
    nominal = machine.nominal_values()
    hint = "write, for example, " + ("[1, 0]" if machine.space == "planar" else "[0, 0, 1]")
    faults = [
        machine.source.fault("direction", f"direction `{_key(path)}` has length 0", path, hint)
        for path, axis in _directions(machine)
        if isinstance(axis, tuple) and axis and not np.abs(constant_vector(axis, nominal)).max() >= SMALLEST
    ]
    for path, joint in () if faults else _joints(machine):
        if joint.axes is not None and parallel(*joint.axes, nominal):
            message = "the two axes of a universal joint must not be parallel"
            faults.append(
                machine.source.fault("direction", message, (*path, "axes"), "write, for example, `axes: [x, y]`")
            )
    return faults


def _directions(machine: Machine) -> Iterator[tuple[Path, object]]:
    """Every direction of the reference configuration, and its place in the file."""
    for name, guide in machine.guides.items():
        yield ("guides", name, "along"), guide.along
    for name, beam in machine.beams.items():
        yield ("beams", name, "up"), beam.up
    for path, joint in _joints(machine):
        yield (*path, "axis"), joint.axis
        yield from (((*path, "axes", k), axis) for k, axis in enumerate(joint.axes or ()))
    for name, rope in machine.ropes.items():
        for point, pulley in rope.pulleys.items():
            yield ("ropes", name, "pulleys", point, "axis"), pulley.axis
    for name, sensor in machine.sensors.items():
        yield ("sensors", name, "axis"), sensor.axis
    if machine.workspace is not None and machine.workspace.cylinder is not None:
        yield ("workspace", "cylinder", "axis"), machine.workspace.cylinder.axis


def _joints(machine: Machine) -> Iterator[tuple[Path, Joint | End]]:
    """Joints and the ends of beams, with their places in the file."""
    for name, joint in machine.joints.items():
        yield ("joints", name), joint
    for name, beam in machine.beams.items():
        for side, end in enumerate(beam.ends):
            yield ("beams", name, "ends", side), end


def _key(path: Path) -> str:
    """The last key of a path that is a word."""
    return next(str(part) for part in reversed(path) if isinstance(part, str))


def _rotated_carriages(machine: Machine) -> list[Fault]:
    """A carriage has the axes of its guide's frame: a turn of its own would be ignored."""
    hint = "delete `turn`; turn the guide's frame, or give the carriage's points in the axes of that frame"
    return [
        machine.source.fault(
            "turn",
            f"carriage `{name}` cannot have `turn`: it has the axes of its guide's frame",
            ("bodies", name, "turn"),
            hint,
        )
        for name, body in machine.bodies.items()
        if body.guide is not None and not is_zero(body.turn)
    ]


def _unhinged(machine: Machine) -> list[Fault]:
    """Cranks that nothing lets turn."""
    owner = {point: name for name, body in machine.bodies.items() for point in body.points}
    ends = {owner.get(e, e) for joint in machine.joints.values() if joint.type == "revolute" for e in joint.between}
    hint = "connect it to the base with a joint: `{between: [POINT, BODY], type: revolute}`"
    return [
        machine.source.fault(
            "value", f"`{actuator.turns}` has no revolute joint to turn about", ("actuators", name, "turns"), hint
        )
        for name, actuator in machine.actuators.items()
        if actuator.turns in machine.bodies and actuator.turns not in ends
    ]


def _reversed_limits(machine: Machine) -> list[Fault]:
    nominal, hint = machine.nominal_values(), "write `limits: [low, high]`"
    return [
        machine.source.fault(
            "value", "the lower limit must be below the upper limit", ("actuators", name, "limits"), hint
        )
        for name, actuator in machine.actuators.items()
        if actuator.limits is not None and not actuator.limits[0].number(nominal) < actuator.limits[1].number(nominal)
    ]


def _weightless_effects(machine: Machine) -> list[Fault]:
    """Effects that act by a gravity that the machine has not: warnings."""
    hint = "add `gravity: [" + ("0, -9.81]`" if machine.space == "planar" else "0, 0, -9.81]`")
    hint += (", without `own_weight: false`" if not machine.own_weight else "") + ", or delete the effect"
    return [
        machine.source.fault(
            "no-gravity", f"`{name}` does nothing: no gravity acts", ("effects", name), hint, at_key=True, warning=True
        )
        for name in machine.effects
        if (effect := catalogue().get(name.partition("@")[0])) is not None and weightless(machine, effect)
    ]


def _unconnected_fault(machine: Machine, name: str) -> Fault:
    section = "bodies" if name in machine.bodies else "nodes"
    hint = "connect it with a member, a joint or a guide, fix it (`fixed`), or remove it"
    message = f"`{name}` is not connected to the base"
    return machine.source.fault("connection", message, (section, name), hint, at_key=True)


def _worst_gaps(gaps: tuple[Gap, ...]) -> list[Gap]:
    """The largest gap of each element."""
    seen: dict[str, Gap] = {}
    for gap in gaps:
        seen.setdefault(gap.element, gap)
    return list(seen.values())[:10]


_BAR_GAP = "correct `at:` of the nodes and bodies that it connects, or its length"
_JOINT_GAP = "correct `at:` and `turn:` of the bodies that it connects, or its axis; all are drawn in base axes"


def _gap_fault(machine: Machine, gap: Gap, length: float) -> Fault:
    path = path_of(machine, gap.element)
    lengthwise = gap.lengthwise
    size = machine.file_units.length.format(gap.value) if lengthwise else f"{gap.value:.3g} rad"
    large = abs(gap.value) > GAP * (length if lengthwise else 1.0)
    message = f"the reference configuration does not close: gap of {size} at `{gap.element}` ({gap.strain})"
    bar = machine.bars.get(gap.element)
    hint = _BAR_GAP if gap.element not in machine.joints else _JOINT_GAP
    hint += "; if it is a spring, mark it `spring: true`" if bar is not None and bar.k is not None else ""
    return machine.source.fault("drawing", message, path, hint if large else None, at_key=True, warning=not large)


def _shared_misfit(machine: Machine, members: tuple[str, ...]) -> list[Fault]:
    """A warning that a rigid machine takes the least squares of its drives' misfits."""
    if not members:
        return []
    named = ", ".join(f"`{n}`" for n in members)
    message = (
        f"nothing yields in the loop of {named}: the pose is the least squares of all drives' misfits, without loads"
    )
    hint = "forces mean nothing there; give one of them, or a joint or actuator of the loop, a stiffness"
    return [machine.source.fault("rigid-loop", message, path_of(machine, members[0]), hint, at_key=True, warning=True)]
