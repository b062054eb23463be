"""Whether the reference configuration is where the file draws it."""

from __future__ import annotations

import numpy as np

from pkmcal_cli.base.errors import Fault
from pkmcal_cli.compiler.paths import path_of
from pkmcal_cli.equilibrium.kinematics import State
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.mechanism.topology import Topology

_FAR = 0.1  # of the machine's size; shipped machines close within a twentieth of theirs
_HINT = "correct the lengths of the members there, or their unit, or the places (`at`) that they connect"


def far_from_drawing(machine: Machine, topology: Topology, closed: State, length: float) -> tuple[Fault, ...]:
    """A warning of what is farthest from its place in the file, if it is far, once lengths are as the file has them."""
    moved = closed.translation[0] - topology.translation_reference
    if not len(moved) or np.abs(moved).max() <= _FAR * length:
        return ()
    farthest = int(np.abs(moved).argmax())
    name = topology.translation_names[farthest].partition(".")[0]
    size = machine.file_units.length.format(float(np.abs(moved[farthest])))
    message = f"with the lengths of this file, `{name}` is {size} from where the file draws it"
    return (machine.source.fault("drawing", message, path_of(machine, name), _HINT, at_key=True, warning=True),)
