"""Ranks: how a mechanism can move, what holds it, and where it stresses itself.

With the Jacobian J = de/du of all strains that act (m strains, n unknowns) and r = rank J there are n - r degrees of
freedom and m - r states of self-stress (Maxwell 1864; Pellegrino and Calladine 1986). Counting joints (Gruebler) would
miss parallel guides and special positions; a rank sees them. Lengths are in sizes of the machine, so that the rank
does not depend on units.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.elements import LoadElement
from pkmcal_cli.equilibrium.kinematics import State, geometries, input_jacobian, offset_vectors_at
from pkmcal_cli.equilibrium.strains import group_geometry, group_strains
from pkmcal_cli.equilibrium.system import System
from pkmcal_cli.equilibrium.system_numbers import link_sizes, rest_at, rest_values

_RANK = 1e-8  # singular values below this share of the largest count as zero


@dataclass(frozen=True)
class StrainRows:
    """Strains of one configuration, scaled: lengths relative to the machine's size."""

    names: tuple[tuple[str, str], ...]  # element, strain
    values: Array  # (m,)
    lengthwise: NDArray[np.bool_]  # (m,) lengths, not angles
    jacobian: Array  # (m, n) with respect to scaled unknowns
    rigid: NDArray[np.bool_]  # (m,)


def strain_rows(system: System, coefficients: Array, state: State, length: float) -> StrainRows:
    """Evaluate and differentiate all strains that act in a system at the first row of `state`."""
    offset_vectors = offset_vectors_at(system.topology, coefficients, state)
    stacked = geometries(system, state, offset_vectors)
    unit = np.where(system.free < len(system.topology.translation_coefficients), length, 1.0)
    names, values, lengthwise, rows, rigid = [], [], [], [], []
    for index, group in enumerate(system.groups):
        spec = group.group
        if isinstance(spec.element, LoadElement):
            continue
        links = group_geometry(system, index, stacked).links(link_sizes(group, coefficients))
        e, b = group_strains(spec, links, rest_at(group, rest_values(group, coefficients), state.translation))
        jacobian, _ = input_jacobian(system.topology, group.map, state, offset_vectors)
        active = group.elastic > 0
        active[group.rigid] = True
        for k, m in zip(*np.nonzero(active), strict=True):
            strain = spec.element.strains[m]
            scale = length if spec.element.lengths[m] else 1.0
            row = np.zeros(system.unknowns)
            for link in np.nonzero(spec.owners == k)[0]:
                where = group.map.unknowns[link]
                local = jacobian[0, link] @ b[0, link, m, group.inputs]
                np.add.at(row, where[where >= 0], local[where >= 0])
            names.append((spec.names[k], strain))
            values.append(e[0, k, m] / scale)
            lengthwise.append(bool(spec.element.lengths[m]))
            rows.append(row * unit / scale)
            rigid.append(bool(spec.rigid[k, m]))
    jacobian = np.array(rows).reshape(len(rows), system.unknowns)
    return StrainRows(tuple(names), np.array(values), np.array(lengthwise), jacobian, np.array(rigid, dtype=bool))


def null_space(matrix: Array) -> Array:
    """Compute an orthonormal basis (n, k) of the null space by singular values."""
    if matrix.shape[1] == 0:
        return np.zeros((0, 0))
    if matrix.shape[0] == 0:
        return np.eye(matrix.shape[1])
    _, s, vt = np.linalg.svd(matrix, full_matrices=True)
    rank = int((s > _RANK * max(s[0], 1e-300)).sum())
    return np.asarray(vt[rank:].T)


def rank(matrix: Array, share: float = _RANK) -> int:
    """Compute the numerical rank: singular values above this share of the largest."""
    if 0 in matrix.shape:
        return 0
    s = np.linalg.svd(matrix, compute_uv=False)
    return int((s > share * max(s[0], 1e-300)).sum())


def pivots(basis: Array) -> list[int]:
    """Choose coordinates (one per basis vector) that, held, stop all motions of a null space basis (n, k)."""
    return pivot_columns(basis.T, basis.shape[1])


def pivot_columns(matrix: Array, count: int) -> list[int]:
    """Choose the `count` columns that a QR decomposition with column pivoting takes first."""
    remainder = np.array(matrix, dtype=float)
    order: list[int] = []
    for _ in range(count):
        norms = np.sqrt((remainder**2).sum(axis=0))
        norms[order] = -1.0
        order.append(int(np.argmax(norms)))
        column = remainder[:, order[-1]]
        size = float(np.sqrt(column @ column))
        if size > 0:
            unit = column / size
            remainder -= np.outer(unit, unit @ remainder)
    return order
