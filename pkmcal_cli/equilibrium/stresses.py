"""The constitutive law: stress S e + s0 of elastic strains, multipliers of rigid ones; ropes pull and never push.

A rope's stress max(0, k e + s0) has a kink where it goes slack: its derivative is k on the taut side, 0 on the other.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.equilibrium.group_map import GroupMap
from pkmcal_cli.equilibrium.kinematics import State
from pkmcal_cli.equilibrium.system_numbers import GroupNumbers, natural_lengths

_KINK = 1e-11  # elongation, relative to the length, below which a rope counts as taut


def stresses_of(group: GroupMap, numbers: GroupNumbers, e: Array, state: State) -> Array:
    """Compute the stress of every strain: S e + s0, or the multiplier of a constraint, (N, E, m); ropes may push."""
    if numbers.stiffness is None:
        stress = np.zeros(e.shape, dtype=e.dtype, order="F")
    else:
        stress = numbers.stress(e)
    if numbers.prestress is not None:
        stress += numbers.prestress
    for k, (link, strain) in enumerate(zip(*group.rigid, strict=True), start=group.rows.start):
        stress[:, link, strain] = state.multiplier[:, k]
    return stress


def carrying_ropes(group: GroupMap, numbers: GroupNumbers, e: Array) -> NDArray[np.bool_] | None:
    """Tell which elements (N, E) act: all but slack ropes; None where no element of the group can go slack.

    A rope between taut and slack counts as taut: where nothing strains a machine, the signs of stresses are rounding.
    """
    if group.ropes is None or numbers.stiffness is None:
        return None
    stiffness = numbers.stiffness[..., 0, 0].real
    pull = stiffness * (e[..., 0].real + _KINK * natural_lengths(group, numbers.rest).real)
    if numbers.prestress is not None:
        pull = pull + numbers.prestress[..., 0].real
    return np.asarray((pull > 0) | ~group.ropes)
