"""Elements see the geometry of their links and give strains: of one link each, or sums over the links of a path.

Generalised strains are e = e(delta, T_i, T_j) - e_0 with the rest value e_0 (Besseling 1974); of a path, the rope's
length, e = sum of the links' lengths - e_0, as its tension is the same all along.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.base.sparse_map import pick
from pkmcal_cli.elements import LinkGeometry
from pkmcal_cli.equilibrium.kinematics import State, geometries, rotated_offset_vectors
from pkmcal_cli.equilibrium.system import System
from pkmcal_cli.equilibrium.system_numbers import SystemNumbers, system_numbers
from pkmcal_cli.mechanism.topology import Group

_NOTHING = np.zeros((1, 1, 1))


class Geometry(NamedTuple):
    """What the elements of a group see: triads (N, K, 3, 3), links (N, K, 3), varying directions (N, M, X, 3)."""

    ti: Array
    tj: Array
    delta: Array
    directions: Array

    def links(self, sizes: Array) -> LinkGeometry:
        """The same for the elements; sizes (1 or N, K, p)."""
        return LinkGeometry(self.delta, self.ti, self.tj, sizes)


def group_geometry(system: System, index: int, stacked: Array) -> Geometry:
    """Take one group's part of the stacked geometries (entries, N)."""
    blocks = system.geometry_maps.groups[index]
    parts = (blocks.ti, blocks.tj, blocks.delta, blocks.directions)
    return Geometry(*(part.of(stacked) for part in parts))


def group_strains(group: Group, links: LinkGeometry, rest: Array) -> tuple[Array, Array]:
    """Compute strains (N, E, m) and their gradients by what moves each link (N, K, m, inputs); rest (1 or N, E, m)."""
    if group.path is None:
        return group.element.evaluate(links, rest)
    lengths, gradients = group.element.evaluate(links, _NOTHING)
    total = (group.summing @ lengths[..., 0].T).T[..., None]
    return total - rest, gradients * group.weights[:, None, None]


def all_strains(system: System, coefficients: Array | SystemNumbers, state: State) -> tuple[Array, ...]:
    """Compute the strains (N, E, m) of every group at a state, and nothing else."""
    numbers, out = system_numbers(system, coefficients), []
    stacked = geometries(system, state, rotated_offset_vectors(system.topology, numbers.bodies, state))
    for index, (group, of_group) in enumerate(zip(system.groups, numbers.groups, strict=True)):
        here = of_group.at(state.translation)
        out.append(group_strains(group.group, group_geometry(system, index, stacked).links(here.sizes), here.rest)[0])
    return tuple(out)


def on_links(group: Group, stress: Array) -> Array:
    """Give the stresses (N, K, m) that act on the links of elements with stresses (N, E, m), without weights."""
    return stress if group.path is None else pick(stress, group.path)


def turned_over_rows(system: System, numbers: SystemNumbers, state: State) -> NDArray[np.bool_]:
    """Rows (N,) in which an end of a beam, or a member of a joint, is turned over by more than a quarter of a turn.

    Components of axes in other directions are sines of angles, which are zero at half a turn too. No machine gets there
    without tearing itself apart, but a step of Newton's method may.
    """
    out = np.zeros(len(state), dtype=bool)
    if not any(group.group.element.turns_over for group in system.groups):
        return out
    stacked = geometries(system, state, rotated_offset_vectors(system.topology, numbers.bodies, state))
    for index, (group, here) in enumerate(zip(system.groups, numbers.groups, strict=True)):
        cosines = group.group.element.upright(group_geometry(system, index, stacked).links(here.sizes))
        if cosines is not None:
            out |= (cosines < 0.0).any(axis=(1, 2))
    return out
