"""Assembly mode of a pose: the sign of det J of the rigid Jacobian J, against that of the reference configuration.

Modes meet only where det J = 0 (singularity of the second kind: Gosselin and Angeles 1990), so a pose with the other
sign closes, but the machine cannot have gone there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.base.sparse_map import pick
from pkmcal_cli.equilibrium.kinematics import State, geometries, rotated_offset_vectors
from pkmcal_cli.equilibrium.mobility import pivot_columns
from pkmcal_cli.equilibrium.strains import group_geometry, group_strains
from pkmcal_cli.equilibrium.system import System
from pkmcal_cli.equilibrium.system_numbers import SystemNumbers, system_numbers
from pkmcal_cli.mechanism.topology import Index


def strain_jacobian(system: System, coefficients: Array | SystemNumbers, state: State, length: float) -> Array:
    """Differentiate all acting strains by the unknowns, lengths relative to `length`: (N, m, n)."""
    maps = system.strain_maps
    out = np.zeros((len(state), maps.count * system.unknowns))
    out[:, maps.filled] = _entries(system, coefficients, state, length)
    return out.reshape(len(state), maps.count, system.unknowns)


def strains_exceed(
    system: System, coefficients: Array | SystemNumbers, state: State, length: float, bound: Array
) -> NDArray[np.bool_]:
    """Tell where (N,) all squared singular values of that Jacobian, of a system with fronts, are above a bound (N,)."""
    fronts = system.strain_fronts
    assert fronts is not None
    values = _entries(system, coefficients, state, length)
    finite = np.asarray(np.isfinite(values).all(axis=1))
    return finite & fronts.exceed(np.where(finite[:, None], values, 0.0), bound)


def _entries(system: System, coefficients: Array | SystemNumbers, state: State, length: float) -> Array:
    """The entries of that Jacobian that may be other than zero, (N, entries)."""
    maps, numbers = system.strain_maps, system_numbers(system, coefficients)
    stacked = geometries(system, state, rotated_offset_vectors(system.topology, numbers.bodies, state))
    gradients = np.empty((maps.jacobian.columns, len(state)))
    for index, (own, varying) in maps.groups.items():
        group, geometry = system.groups[index], group_geometry(system, index, stacked)
        given = numbers.groups[index].at(state.translation)
        _, b = group_strains(group.group, geometry.links(given.sizes), given.rest)
        own.of(gradients)[...] = b
        directions, part = geometry.directions, pick(b, group.map.moving)[..., :3]
        np.einsum("nmxd,nmkd->nmkx", directions, part, out=varying.of(gradients))
    unit = np.where(system.free < len(system.topology.translation_coefficients), length, 1.0)
    return np.asarray(maps.jacobian(gradients).T * unit[maps.filled % max(system.unknowns, 1)])


def independent_strains(jacobian: Array) -> Index:
    """Choose strains (n,) of a Jacobian (m, n), independent at the reference configuration, by pivoted QR."""
    return np.sort(np.array(pivot_columns(jacobian.T, jacobian.shape[1]), dtype=np.intp))


@dataclass(frozen=True)
class Mode:
    """An assembly mode: independent strains (n,) of a pose, sign and logarithm of their Jacobian's determinant."""

    strains: Index
    sign: float
    size: float


def reference_mode(system: System, coefficients: Array, state: State, length: float) -> Mode | None:
    """Give the mode of the reference configuration (one row); None where the strains do not hold it."""
    home = strain_jacobian(system, coefficients, state, length)[0]
    if home.shape[0] < system.unknowns or system.unknowns == 0:
        return None
    strains = independent_strains(home)
    return Mode(strains, *(float(x) for x in np.linalg.slogdet(home[strains])))


def regularity(
    system: System, mode: Mode | None, coefficients: Array | SystemNumbers, state: State, length: float
) -> Array:
    """Give det J over that of the reference configuration, (N,): < 0 in another assembly mode, 0 where singular."""
    if mode is None:
        return np.ones(len(state))
    jacobian = strain_jacobian(system, coefficients, state, length)
    sign, size = np.linalg.slogdet(jacobian[:, mode.strains])
    return np.asarray(sign * mode.sign * np.exp(np.minimum(size - mode.size, 0.0)))
