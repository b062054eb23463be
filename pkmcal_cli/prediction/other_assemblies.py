"""Whether another assembly of the machine may fit a row better: how far its parts are apart there says so.

Two assemblies lie on either side of a singular pose (Gosselin and Angeles 1990); see `freedoms.is_sole`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.equilibrium.branch import strain_jacobian, strains_exceed
from pkmcal_cli.equilibrium.energy import slack_ropes
from pkmcal_cli.equilibrium.kinematics import State
from pkmcal_cli.equilibrium.strains import all_strains
from pkmcal_cli.equilibrium.system_numbers import SystemNumbers
from pkmcal_cli.model.freedoms import LEAST_MISFIT, NO_MISFIT, REGULAR, is_sole
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction.rigid_pose import largest_strain

_OVER = 0.5 * np.pi  # rad: a quarter turn
_NEAR = REGULAR / 10  # a pose that moved less, in sizes or rad, is as far from singular ones as it was


def largest_gap(model: Model, numbers: SystemNumbers, state: State) -> Array:
    """How far parts that should meet are apart (N,), in sizes of the machine; slack ropes need not reach."""
    strains = all_strains(model.exact, numbers, state)
    slack = slack_ropes(model.exact, numbers, strains, state)
    gaps = [
        e * (group.elastic * group.group.gaps) * ~is_slack[:, :, None]
        for group, e, is_slack in zip(model.exact.groups, strains, slack, strict=True)
    ]
    return largest_strain(gaps, len(state)) / model.length


def still_compared(model: Model, misfit: Array, before: State, after: State) -> Array:
    """Misfit (N,), in sizes, up to which poses need no comparison, after they have moved.

    Up to `misfit` (N,) they were compared with others, or seen to be far from singular ones: that holds nearby only.
    """
    far = np.abs(after.translation - before.translation).max(axis=1, initial=0.0) > _NEAR * model.length
    far |= np.abs(after.rotation - before.rotation).max(axis=(1, 2, 3), initial=0.0) > _NEAR
    return np.where(far & (misfit <= LEAST_MISFIT), 0.0, misfit)


def turned_over(model: Model, state: State, other: State) -> NDArray[np.bool_]:
    """Tell in which rows (N,) a part is turned from the reference by a quarter turn more than in another state.

    Tensions keep the ropes of a pretensioned platform from their lengths, so one that is turned over, with ropes slack
    and crossed, may have less energy; but no platform goes there: its legs or ropes would pass through it.
    """
    reference = model.topology.rotations.reference
    angles = [
        np.arccos(np.clip(0.5 * (np.einsum("nrij,rij->nr", s.rotation, reference) - 1.0), -1.0, 1.0))
        for s in (state, other)
    ]
    return np.asarray((angles[0] - angles[1] > _OVER).any(axis=1))


def no_other_near(model: Model, numbers: SystemNumbers, state: State, apart: Array) -> NDArray[np.bool_]:
    """Tell where (N,) parts that should meet are less apart, in sizes, than two assemblies of the machine would be."""
    out = np.asarray(apart <= NO_MISFIT)
    near = np.nonzero(~out & (apart <= LEAST_MISFIT))[0]
    if not len(near):
        return out
    if len(near) < len(out):
        numbers, state = numbers.take(near), state.take(near)
    if model.exact.strain_fronts is None:
        out[near] = is_sole(strain_jacobian(model.exact, numbers, state, model.length), apart[near])
    else:  # the same, of many unknowns
        bound = apart[near] * (REGULAR**2 / NO_MISFIT)
        out[near] = strains_exceed(model.exact, numbers, state, model.length, bound)
    return out
