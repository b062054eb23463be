"""What drives hold too little or twice, as faults with a remedy."""

from __future__ import annotations

from pkmcal_cli.base.errors import Fault
from pkmcal_cli.base.plural import count
from pkmcal_cli.compiler.assemble import Mobility
from pkmcal_cli.compiler.paths import path_of
from pkmcal_cli.language.machine import Machine


def mobility_faults(machine: Machine, mobility: Mobility) -> list[Fault]:
    """Of degrees of freedom that drives do not match, and of loops in which nothing yields."""
    at = ("actuators",) if machine.actuators else ()
    summary = f"{_mobility_text(machine, mobility)} ({_counts(mobility)})"
    if mobility.special:
        message = (
            f"the reference configuration is singular: {count(mobility.nearby, 'degree')} of freedom in nearby poses"
        )
        hint = _missing(machine, mobility) + "choose a non-singular pose as the reference configuration"
        faults = [machine.source.fault("mobility", f"{message} ({_counts(mobility)})", at, hint)]
    elif not mobility.matched:
        faults = [machine.source.fault("mobility", summary, at, _mobility_hint(machine, mobility))]
    else:
        faults = []
    if mobility.rigid_loops:
        members = ", ".join(f"`{n}`" for n in mobility.rigid_loops)
        path = path_of(machine, mobility.rigid_loops[0])
        hint = "give one of them, or a joint or actuator of the loop, a stiffness"
        message = f"closed loop without compliance: {members}"
        faults.append(machine.source.fault("rigid-loop", message, path, hint, at_key=True))
    return faults


def _mobility_text(machine: Machine, mobility: Mobility) -> str:
    """What the drives do not hold, or hold twice."""
    if mobility.uncontrolled:
        times = {name: mobility.uncontrolled.count(name) for name in mobility.uncontrolled}
        moved = (name if n == 1 else f"{name} ({count(n, 'motion')})" for name, n in times.items())
        return f"no actuator or joint constrains the {', '.join(moved)}"
    unmarked = [n for n, a in machine.actuators.items() if not a.redundant and a.holds]
    named = f"not marked redundant ({', '.join(unmarked)})" if unmarked else "(all redundant or force-controlled)"
    drives = f"the actuators {named}"
    open_, twice = mobility.undetermined, mobility.overdetermined
    free = f"{count(open_, 'degree')} of freedom uncontrolled"
    if open_ and twice > 0:
        return f"{drives} overconstrain {count(twice, 'motion')} and leave {free}"
    if open_:
        return f"{drives} leave {free}"
    return f"{drives} exceed the degrees of freedom by {twice}"


def _missing(machine: Machine, mobility: Mobility) -> str:
    """That the drives are too few also where the pose is not singular."""
    drives = sum(a.holds for a in machine.actuators.values())
    if mobility.nearby <= drives:
        return ""
    held = f"{count(drives, 'drive')} cannot hold {count(mobility.nearby, 'degree')} of freedom"
    return f"{held}: add the joint, member or drive that is missing; then "


def _mobility_hint(machine: Machine, mobility: Mobility) -> str:
    if mobility.uncontrolled:
        return "add an actuator, joint or stiffness that constrains it"
    if mobility.undetermined and mobility.overdetermined > 0:
        return "mark other actuators `redundant: true`, or choose another pose as the reference configuration"
    if mobility.undetermined:
        return f"remove `redundant: true` or `control: force` from {count(mobility.undetermined, 'actuator')}"
    deviations = ""
    if mobility.nearly_free:
        meant = f"; or, if {count(mobility.nearly_free, 'more motion')} should be free, draw parallel guides parallel"
        deviations = f"{meant}, and write deviations as parameters of nominal 0"
    elif machine.joints:
        deviations = "; or, if it should move more freely, look at types and axes of its joints"
    return f"mark {mobility.overdetermined} of them `redundant: true`{deviations}"


def _counts(mobility: Mobility) -> str:
    return (
        f"degrees of freedom: {mobility.degrees_of_freedom}, actuators: {mobility.actuators}, "
        f"degree of redundancy: {max(mobility.redundancy, 0)}, states of self-stress: {mobility.self_stress}"
    )
