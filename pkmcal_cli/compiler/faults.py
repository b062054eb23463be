"""What is wrong with a mechanism, as faults with a place and a remedy."""

from __future__ import annotations

from ..errors import Fault
from ..machine import Machine
from .assemble import Gap, Mobility
from .build import Compiled
from .connection import loose_parts

GAP = 0.01  # a drawing that does not close by more than this share of the machine's size is a fault


def mechanism_faults(machine: Machine, compiled: Compiled) -> list[Fault]:
    """Faults (errors and warnings) of mobility, closed loops and the drawing's assembly."""
    frozen = _frozen_directions(machine)
    if frozen:
        return frozen
    loose = [_loose_fault(machine, name) for name in loose_parts(machine)]
    if loose:
        return loose
    faults = [_gap_fault(machine, gap, compiled.model.length) for gap in _worst_gaps(compiled.gaps)]
    if any(f.severity == "error" for f in faults):
        return faults  # ranks of a drawing that does not close mean nothing
    return faults + _mobility_faults(machine, compiled.mobility)


def _frozen_directions(machine: Machine) -> list[Fault]:
    """Directions that depend on parameters: they are drawn once and for all; frames turn instead."""
    hint = "give numbers here, and turn the guide's frame or the body by the parameter"
    places = [("guides", n, "along", g.along) for n, g in machine.guides.items()]
    places += [("joints", n, "axis", j.axis) for n, j in machine.joints.items()]
    return [
        machine.source.fault("direction", f"`{key}` must not depend on parameters", (section, name, key), hint)
        for section, name, key, axis in places
        if isinstance(axis, tuple) and any(q.names for q in axis)
    ]


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
    path = _path(machine, gap.element)
    lengthwise = gap.strain in ("elongation", "x", "y", "z")
    size = machine.file_units.length.format(gap.value) if lengthwise else f"{gap.value:.3g} rad"
    large = abs(gap.value) > GAP * (length if lengthwise else 1.0)
    what = f"the drawing does not close: `{gap.element}` is off by {size} ({gap.strain})"
    hint = "correct `at:` of the nodes and bodies that it joins, or its length" if large else None
    return machine.source.fault("drawing", what, path, hint, warning=not large)


def _mobility_faults(machine: Machine, found: Mobility) -> list[Fault]:
    counts = (
        f"{found.degrees_of_freedom} degrees of freedom, {found.actuators} actuators, "
        f"{max(found.redundancy, 0)} times redundant, {found.self_stress} self-stresses"
    )
    at = ("actuators",) if machine.actuators else ()
    faults = []
    if found.uncontrolled:
        moved = ", ".join(found.uncontrolled)
        hint = "add an actuator, or a joint or stiffness that holds it"
        faults.append(machine.source.fault("mobility", f"nothing holds the {moved} ({counts})", at, hint))
    elif found.undetermined:
        what = f"the drives not marked redundant leave {found.undetermined} degrees of freedom open ({counts})"
        hint = "take `redundant: true` (or `control: force`) from as many drives"
        faults.append(machine.source.fault("mobility", what, at, hint))
    if found.overdetermined > 0:
        what = (
            f"{found.overdetermined} drives more than the mechanism has freedom for are not marked redundant ({counts})"
        )
        hint = f"mark {found.overdetermined} of them `redundant: true`"
        faults.append(machine.source.fault("mobility", what, at, hint))
    if found.nearby != found.degrees_of_freedom:
        what = (
            f"the drawing is a special position: {found.degrees_of_freedom} degrees of freedom there, "
            f"{found.nearby} beside it ({counts})"
        )
        faults.append(machine.source.fault("mobility", what, at, "draw the machine in an ordinary pose"))
    if found.rigid_loops:
        members = ", ".join(f"`{n}`" for n in found.rigid_loops)
        path = _path(machine, found.rigid_loops[0])
        hint = "give one of them, a joint or a drive in the loop a stiffness"
        faults.append(machine.source.fault("rigid-loop", f"closed loop in which nothing yields: {members}", path, hint))
    return faults


def _path(machine: Machine, element: str) -> tuple[str, ...]:
    """The place of an element in the machine file."""
    name = element.split(".")[0]
    for section in ("beams", "bars", "ropes", "joints", "actuators", "bodies", "nodes"):
        if name in getattr(machine, section):
            return (section, name)
    return ()
