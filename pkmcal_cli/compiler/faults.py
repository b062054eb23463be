"""What is wrong with a mechanism, as faults with a place and a remedy."""

from __future__ import annotations

from collections.abc import Iterator

from pkmcal_cli.base.errors import Fault
from pkmcal_cli.base.plural import count
from pkmcal_cli.compiler.assemble import BadDrawing, Gap, Mobility
from pkmcal_cli.compiler.build import Compiled
from pkmcal_cli.compiler.connection import loose_parts
from pkmcal_cli.compiler.numbers import is_zero
from pkmcal_cli.compiler.paths import path_of
from pkmcal_cli.compiler.physical import section_faults
from pkmcal_cli.compiler.springs import stiffness_faults
from pkmcal_cli.language.machine import End, Joint, Machine
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.travel_limits import limit_excess
from pkmcal_cli.units.unit_text import parse_unit
from pkmcal_cli.yaml_source.tree import Path

GAP = 0.01  # a drawing that does not close by more than this share of the machine's size is a fault


def structure_faults(machine: Machine) -> list[Fault]:
    """Faults that are seen without building the machine."""
    if not machine.nodes and not machine.bodies:
        hint = "describe what moves in `bodies:` and `nodes:`"
        return [machine.source.fault("empty", "the machine has neither bodies nor nodes", (), hint)]
    loose = [_loose_fault(machine, name) for name in loose_parts(machine)]
    return [
        *_frozen_directions(machine),
        *_no_directions(machine),
        *_turned_carriages(machine),
        *_unhinged(machine),
        *_reversed_limits(machine),
        *stiffness_faults(machine),
        *section_faults(machine),
        *loose,
    ]


def drawing_fault(machine: Machine, error: BadDrawing) -> Fault:
    """A drawing from which nothing can be built."""
    return machine.source.fault(
        "drawing", str(error), path_of(machine, error.element), "draw its ends apart", at_key=True
    )


def mechanism_faults(machine: Machine, compiled: Compiled) -> list[Fault]:
    """Faults (errors and warnings) of mobility, closed loops and the drawing's assembly."""
    faults = [_gap_fault(machine, gap, compiled.model.length) for gap in _worst_gaps(compiled.gaps)]
    if any(f.severity == "error" for f in faults):
        return faults  # ranks of a drawing that does not close mean nothing
    return faults + _mobility_faults(machine, compiled.mobility) + _drawn_outside(machine, compiled.model)


def _frozen_directions(machine: Machine) -> list[Fault]:
    """Directions that depend on parameters: they are drawn once and for all; frames turn instead."""
    hint = "give numbers here; a guide is turned by its frame, a body by where its points are"
    return [
        machine.source.fault("direction", f"`{_key(path)}` must not depend on parameters", path, hint)
        for path, axis in _directions(machine)
        if isinstance(axis, tuple) and any(q.names for q in axis)
    ]


def _no_directions(machine: Machine) -> list[Fault]:
    """Directions of length 0."""
    hint = "for example " + ("[1, 0]" if machine.space == "planar" else "[0, 0, 1]")
    return [
        machine.source.fault("direction", f"`{_key(path)}` has length 0: it is no direction", path, hint)
        for path, axis in _directions(machine)
        if isinstance(axis, tuple) and axis and path[-1] != "turn" and is_zero(axis)
    ]


def _directions(machine: Machine) -> Iterator[tuple[Path, object]]:
    """Every direction that the drawing fixes, and its place in the file."""
    for name, guide in machine.guides.items():
        yield ("guides", name, "along"), guide.along
    joined: list[tuple[Path, Joint | End]] = [(("joints", n), joint) for n, joint in machine.joints.items()]
    for name, beam in machine.beams.items():
        yield ("beams", name, "up"), beam.up
        joined += [(("beams", name, "ends", side), end) for side, end in enumerate(beam.ends)]
    for path, joint in joined:
        yield (*path, "axis"), joint.axis
        yield from (((*path, "axes", k), axis) for k, axis in enumerate(joint.axes or ()))
    for name, body in machine.bodies.items():
        if any(direction.startswith("r") for direction in body.fixed):
            yield ("bodies", name, "turn"), body.turn


def _key(path: Path) -> str:
    """The last key of a path that is a word."""
    return next(str(part) for part in reversed(path) if isinstance(part, str))


def _turned_carriages(machine: Machine) -> list[Fault]:
    """A carriage has the axes of its guide's frame: a turn of its own would be ignored."""
    hint = "turn the guide's frame, or give the carriage's points in the axes of that frame; delete `turn`"
    return [
        machine.source.fault(
            "turn", f"carriage `{name}` has the axes of its guide's frame", ("bodies", name, "turn"), hint
        )
        for name, body in machine.bodies.items()
        if body.on is not None and not is_zero(body.turn)
    ]


def _unhinged(machine: Machine) -> list[Fault]:
    """Cranks that nothing lets turn."""
    owner = {point: name for name, body in machine.bodies.items() for point in body.points}
    ends = {owner.get(e, e) for joint in machine.joints.values() if joint.type == "revolute" for e in joint.between}
    hint = "join it to the base by a joint: {between: [POINT, BODY], type: revolute}"
    return [
        machine.source.fault(
            "value", f"`{actuator.turns}` is at no revolute joint: nothing turns", ("actuators", name, "turns"), hint
        )
        for name, actuator in machine.actuators.items()
        if actuator.turns in machine.bodies and actuator.turns not in ends
    ]


def _reversed_limits(machine: Machine) -> list[Fault]:
    nominal, hint = machine.nominal_values(), "limits: [low, high]"
    return [
        machine.source.fault(
            "value", "the lower limit must be below the upper one", ("actuators", name, "limits"), hint
        )
        for name, actuator in machine.actuators.items()
        if actuator.limits is not None and not actuator.limits[0].number(nominal) < actuator.limits[1].number(nominal)
    ]


def _drawn_outside(machine: Machine, model: Model) -> list[Fault]:
    """Drives that are outside their limits in the drawing: warnings."""
    faults = []
    for actuator, reading in zip(model.actuators, model.drawn_readings, strict=True):
        if limit_excess(reading, actuator.limits) > 0:
            unit = parse_unit(actuator.unit)
            low, high, drawn = (unit.format(float(v), 6) for v in (*actuator.limits, reading))
            what = f"in the drawing `{actuator.name}` reads {drawn}, outside its limits ({low} to {high})"
            hint = "correct the limits, or the drive's zero, scale or sign; or draw the machine within its travel"
            faults.append(
                machine.source.fault("limits", what, ("actuators", actuator.name, "limits"), hint, warning=True)
            )
    return faults


def _loose_fault(machine: Machine, name: str) -> Fault:
    section = "bodies" if name in machine.bodies else "nodes"
    hint = "join it by a member, a joint or a guide, hold it (`fixed`), or take it out"
    what = f"nothing joins `{name}` to the base: the bodies are not connected"
    return machine.source.fault("connection", what, (section, name), hint, at_key=True)


def _worst_gaps(gaps: tuple[Gap, ...]) -> list[Gap]:
    """The largest gap of each element."""
    seen: dict[str, Gap] = {}
    for gap in gaps:
        seen.setdefault(gap.element, gap)
    return list(seen.values())[:10]


def _gap_fault(machine: Machine, gap: Gap, length: float) -> Fault:
    path = path_of(machine, gap.element)
    lengthwise = gap.strain in ("elongation", "x", "y", "z")
    size = machine.file_units.length.format(gap.value) if lengthwise else f"{gap.value:.3g} rad"
    large = abs(gap.value) > GAP * (length if lengthwise else 1.0)
    what = f"the drawing does not close: `{gap.element}` is off by {size} ({gap.strain})"
    hint = "correct `at:` of the nodes and bodies that it joins, or its length" if large else None
    return machine.source.fault("drawing", what, path, hint, at_key=True, warning=not large)


def _mobility_faults(machine: Machine, found: Mobility) -> list[Fault]:
    at = ("actuators",) if machine.actuators else ()
    told = f"{_mobility_text(machine, found)} ({_counts(found)})"
    if found.nearby != found.degrees_of_freedom:
        what = f"the drawing is a special position: {count(found.nearby, 'degree')} of freedom beside it"
        hint = "draw the machine in an ordinary pose"
        faults = [machine.source.fault("mobility", f"{what} ({_counts(found)})", at, hint)]
    else:
        faults = [machine.source.fault("mobility", told, at, _mobility_hint(found))] if _immobile(found) else []
    if found.rigid_loops:
        members = ", ".join(f"`{n}`" for n in found.rigid_loops)
        path = path_of(machine, found.rigid_loops[0])
        hint = "give one of them, a joint or a drive in the loop a stiffness"
        what = f"closed loop in which nothing yields: {members}"
        faults.append(machine.source.fault("rigid-loop", what, path, hint, at_key=True))
    return faults


def _immobile(found: Mobility) -> bool:
    return bool(found.uncontrolled or found.undetermined or found.overdetermined > 0)


def _mobility_text(machine: Machine, found: Mobility) -> str:
    """What the drives do not hold, or hold twice."""
    if found.uncontrolled:
        times = {name: found.uncontrolled.count(name) for name in found.uncontrolled}
        moved = (name if n == 1 else f"{name} ({count(n, 'motion')})" for name, n in times.items())
        return f"nothing holds the {', '.join(moved)}"
    unmarked = [n for n, a in machine.actuators.items() if not a.redundant and a.holds]
    named = f"not marked redundant ({', '.join(unmarked)})" if unmarked else "(all redundant or force-controlled)"
    drives = f"the drives {named}"
    open_, twice = found.undetermined, found.overdetermined
    if open_ and twice > 0:
        return f"{drives} hold {count(twice, 'motion')} twice and leave {count(open_, 'degree')} of freedom open"
    if open_:
        return f"{drives} leave {count(open_, 'degree')} of freedom open"
    return f"{drives} are {twice} more than the mechanism has freedom for"


def _mobility_hint(found: Mobility) -> str:
    if found.uncontrolled:
        return "add an actuator, or a joint or stiffness that holds it"
    if found.undetermined and found.overdetermined > 0:
        return "mark other drives `redundant: true`, or draw the machine in another pose"
    if found.undetermined:
        what = "it" if found.undetermined == 1 else "each of them"
        return f"let one more drive hold {what}: take out a `redundant: true` or `control: force`"
    return f"mark {found.overdetermined} of them `redundant: true`"


def _counts(found: Mobility) -> str:
    return (
        f"{count(found.degrees_of_freedom, 'degree')} of freedom, {count(found.actuators, 'actuator')}, "
        f"{count(max(found.redundancy, 0), 'time')} redundant, {count(found.self_stress, 'self-stress')}"
    )
