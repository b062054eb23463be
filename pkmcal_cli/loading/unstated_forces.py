"""Forces of force-controlled drives that neither the machine file nor a table states."""

from __future__ import annotations

from pkmcal_cli.base.plural import listed
from pkmcal_cli.language.machine import Machine


def unstated_forces(machine: Machine) -> list[str]:
    """What is to be said of poses that no table gives, at which such a drive has no force; empty without one."""
    names = [
        name
        for name, drive in machine.actuators.items()
        if drive.control == "force" and (drive.force is None or drive.force.otherwise is None)
    ]
    if not names:
        return []
    drives = listed([f"`{name}`" for name in names])
    text = f"force of {drives}: 0, as nothing states it; state `force` in the machine file, or give a table with"
    return [f"{text} {listed([f'`{name}.force`' for name in names])}"]
