"""Assembly mode of a pose: the sign of the determinant of the rigid Jacobian, compared with the drawing's."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.base.sparse_map import pick
from pkmcal_cli.equilibrium.assembly import group_view
from pkmcal_cli.equilibrium.given import given
from pkmcal_cli.equilibrium.kinematics import State, turned_arms, views
from pkmcal_cli.equilibrium.mobility import pivot_columns
from pkmcal_cli.equilibrium.system import System
from pkmcal_cli.mechanism.topology import Index


def strain_jacobian(system: System, slots: Array, state: State, length: float) -> Array:
    """Derivative of all acting strains with respect to the unknowns, lengths relative to `length`: (N, m, n)."""
    maps, numbers = system.strain_maps, given(system, slots)
    stacked = views(system, state, turned_arms(system.layout, numbers.bodies, state))
    gradients = np.empty((maps.jacobian.columns, len(state)))
    for index, (own, varying) in maps.groups.items():
        group, view = system.groups[index], group_view(system, index, stacked)
        _, b = group.group.element.evaluate(view.delta, view.ti, view.tj, numbers.groups[index].rest)
        own.of(gradients)[...] = b
        directions, part = view.directions, pick(b, group.map.moving)[..., :3]
        np.einsum("nmxd,nmkd->nmkx", directions, part, out=varying.of(gradients))
    out = np.zeros((len(state), maps.count * system.unknowns))
    out[:, maps.filled] = maps.jacobian(gradients).T
    unit = np.where(system.free < len(system.layout.travel_slots), length, 1.0)
    return np.asarray(out.reshape(len(state), maps.count, system.unknowns) * unit)


def independent_strains(jacobian: Array) -> Index:
    """Strains (n,) of a Jacobian (m, n) that are independent at the drawing, by pivoted QR."""
    return np.sort(np.array(pivot_columns(jacobian.T, jacobian.shape[1]), dtype=np.intp))


@dataclass(frozen=True)
class Mode:
    """An assembly mode: independent strains (n,) of a pose and the sign of their Jacobian's determinant."""

    strains: Index
    sign: float


def drawn_mode(system: System, slots: Array, state: State, length: float) -> Mode | None:
    """The mode of the drawing (one row); None where the strains do not hold it."""
    home = strain_jacobian(system, slots, state, length)[0]
    if home.shape[0] < system.unknowns or system.unknowns == 0:
        return None
    strains = independent_strains(home)
    return Mode(strains, float(np.linalg.slogdet(home[strains])[0]))


def left_mode(system: System, mode: Mode | None, slots: Array, state: State, length: float) -> NDArray[np.bool_]:
    """Rows (N,) whose pose lies in another assembly mode."""
    if mode is None:
        return np.zeros(len(state), dtype=bool)
    jacobian = strain_jacobian(system, slots, state, length)
    now = np.linalg.slogdet(jacobian[:, mode.strains])[0]
    return np.asarray(now * mode.sign < 0)
