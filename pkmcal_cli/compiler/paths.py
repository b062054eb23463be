"""Where in the machine file a part of the compiled machine stands."""

from __future__ import annotations

from pkmcal_cli.language.machine import Machine
from pkmcal_cli.language.sections import sections_with
from pkmcal_cli.yaml_source.tree import Path

_OTHERS = ("actuators", "bodies", "nodes", "loads", "sensors", "frames", "guides", "ground")


def path_of(machine: Machine, element: str) -> Path:
    """The entry that an element (NAME, NAME.i, ROPE+ROPE, ...), a body's point or a coefficient's label belongs to."""
    name = element.split(".")[0].split("+")[0]
    for section in (*sections_with("between"), *_OTHERS):
        if name in getattr(machine, section):
            return (section, name)
    for body, spec in machine.bodies.items():
        if name in spec.points:
            return ("bodies", body, "points", name)
    return ()
