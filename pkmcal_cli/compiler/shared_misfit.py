"""Rigid machines with more drives than freedoms: all drives yield alike, so the pose is that of least misfit.

Where nothing in a closed loop yields, its drives cannot all be where their readings say. Each drive then has a spring,
the same for all in machine sizes (an angle counts as an arc of the machine's size), and no load acts: the equilibrium
minimises the sum of squares of all misfits. Forces mean nothing there.
"""

from __future__ import annotations

from pkmcal_cli.language.machine import Machine
from pkmcal_cli.language.quantities import Quantity
from pkmcal_cli.units.dimensions import ROTATIONAL_STIFFNESS, STIFFNESS

STIFF = 1e8  # N/m: any value gives the same pose; with this one numbers are those of ordinary machines


def with_yielding_drives(machine: Machine, length: float) -> Machine:
    """The machine of a size, m, with springs in its drives that hold positions, and without loads."""
    linear = Quantity.constant(STIFF, STIFFNESS)
    angular = Quantity.constant(STIFF * length**2, ROTATIONAL_STIFFNESS)
    drives = {
        name: actuator.model_copy(
            update={"stiffness": angular if actuator.turns is not None else linear, "force_limit": None}
        )
        if actuator.holds and actuator.stiffness is None
        else actuator
        for name, actuator in machine.actuators.items()
    }
    return machine.model_copy(update={"actuators": drives, "loads": {}, "gravity": ()})


def yields(machine: Machine) -> bool:
    """Whether any part of the machine is elastic."""
    bars, ropes, drives = machine.bars.values(), machine.ropes.values(), machine.actuators.values()
    return (
        bool(machine.beams)
        or any(not bar.spring and (bar.k is not None or bar.EA is not None) for bar in bars)
        or any(rope.EA is not None for rope in ropes)
        or any(joint.stiffness is not None for joint in machine.joints.values())
        or any(guide.stiffness is not None for guide in machine.guides.values())
        or any(drive.stiffness is not None for drive in drives)
    )
