"""Energies of all members are summed at a state, and its slack ropes named.

U = sum 1/2 e^T S e + s0^T e is the potential of which the forces b^T (S e + s0) are the derivatives (see `assembly`).
A rope of stiffness k and prestress s0 has stress max(0, k e + s0), so U stays at -s0^2 / (2 k) while it is slack.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.equilibrium.group_map import GroupMap
from pkmcal_cli.equilibrium.kinematics import State
from pkmcal_cli.equilibrium.stresses import carrying_ropes
from pkmcal_cli.equilibrium.system import System
from pkmcal_cli.equilibrium.system_numbers import GroupNumbers, SystemNumbers


def _members(
    system: System, numbers: SystemNumbers, strains: tuple[Array, ...], state: State
) -> Iterator[tuple[GroupMap, GroupNumbers, Array]]:
    """Groups with what coefficients say at a state, and its strains (N, E, m)."""
    for group, own, e in zip(system.groups, numbers.groups, strains, strict=True):
        yield group, own.at(state.translation), e


def strain_energy(
    system: System, numbers: SystemNumbers, strains: tuple[Array, ...], state: State, *, taut: bool = False
) -> Array:
    """Sum 1/2 e^T S e over all members (N,), J; slack ropes hold none, unless `taut`."""
    out = np.zeros(len(state))
    for group, own, e in _members(system, numbers, strains, state):
        if own.stiffness is not None:
            stress = own.stress(e)
            carrying = None if taut else carrying_ropes(group, own, e)
            energy = 0.5 * (e * stress).sum(axis=2)
            out += (energy if carrying is None else energy * carrying).sum(axis=1)
    return out


def potential_energy(system: System, numbers: SystemNumbers, strains: tuple[Array, ...], state: State) -> Array:
    """Sum 1/2 e^T S e + s0^T e (N,), J, of which forces are the derivatives; constant while a rope is slack."""
    out = np.zeros(len(state))
    for group, own, e in _members(system, numbers, strains, state):
        stress = np.zeros(e.shape) if own.stiffness is None else own.stress(e)
        prestress = np.zeros(e.shape) if own.prestress is None else own.prestress
        energy = (e * (0.5 * stress + prestress)).sum(axis=2)
        if group.ropes is not None and own.stiffness is not None:
            stiffness = np.where(own.stiffness[..., 0, 0] > 0, own.stiffness[..., 0, 0], 1.0)
            slack = group.ropes & (stress + prestress < 0)[..., 0]
            energy = np.where(slack, -0.5 * prestress[..., 0] ** 2 / stiffness, energy)
        out += energy.sum(axis=1)
    return out


def slack_ropes(
    system: System, numbers: SystemNumbers, strains: tuple[Array, ...], state: State
) -> tuple[NDArray[np.bool_], ...]:
    """Tell which elements (N, E) of each group are slack ropes at a state with these strains."""
    out = []
    for group, own, e in _members(system, numbers, strains, state):
        carrying = carrying_ropes(group, own, e)
        out.append(np.zeros(e.shape[:2], dtype=bool) if carrying is None else ~carrying)
    return tuple(out)
