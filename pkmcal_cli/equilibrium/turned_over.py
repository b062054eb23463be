"""States in which an end of a beam, or a member of a joint, is turned over: their strains vanish there as well.

Components of axes in other directions are sines of angles, which are zero at half a turn too. No machine gets there
without tearing itself apart, but a step of Newton's method may.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.equilibrium.kinematics import State, geometries, rotated_offset_vectors
from pkmcal_cli.equilibrium.strains import group_geometry
from pkmcal_cli.equilibrium.system import System
from pkmcal_cli.equilibrium.system_numbers import SystemNumbers


def turned_over_rows(system: System, numbers: SystemNumbers, state: State) -> NDArray[np.bool_]:
    """Rows (N,) in which something is turned over by more than a quarter of a turn."""
    out = np.zeros(len(state), dtype=bool)
    if not any(group.group.element.turns_over for group in system.groups):
        return out
    stacked = geometries(system, state, rotated_offset_vectors(system.topology, numbers.bodies, state))
    for index, (group, here) in enumerate(zip(system.groups, numbers.groups, strict=True)):
        cosines = group.group.element.upright(group_geometry(system, index, stacked).links(here.sizes))
        if cosines is not None:
            out |= (cosines < 0.0).any(axis=(1, 2))
    return out
