"""Ranks: how a mechanism can move, what holds it, and where it stresses itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.elements import Load
from pkmcal_cli.equilibrium.assembly import group_view
from pkmcal_cli.equilibrium.given import rest_values
from pkmcal_cli.equilibrium.kinematics import State, arm_vectors, input_jacobian, views
from pkmcal_cli.equilibrium.system import System

_RANK = 1e-8  # singular values below this share of the largest count as zero


@dataclass(frozen=True)
class StrainRows:
    """Strains of one configuration, scaled: lengths relative to the machine's size."""

    names: tuple[tuple[str, str], ...]  # element, strain
    values: Array  # (m,)
    jacobian: Array  # (m, n) with respect to scaled unknowns
    rigid: NDArray[np.bool_]  # (m,)


def strain_rows(system: System, slots: Array, state: State, length: float) -> StrainRows:
    """All strains that act in a system, at the first row of `state`."""
    arms = arm_vectors(system.layout, slots, state)
    stacked = views(system, state, arms)
    unit = np.where(system.free < len(system.layout.travel_slots), length, 1.0)
    names, values, rows, rigid = [], [], [], []
    for index, group in enumerate(system.groups):
        spec = group.group
        if isinstance(spec.element, Load):
            continue
        ti, tj, delta, _ = group_view(system, index, stacked)
        e, b = spec.element.evaluate(delta, ti, tj, rest_values(group, slots))
        jacobian, _ = input_jacobian(system.layout, group.map, state, arms)
        active = group.elastic > 0
        active[group.rigid] = True
        for k, m in zip(*np.nonzero(active), strict=True):
            strain = spec.element.strains[m]
            scale = length if strain in ("elongation", "x", "y", "z") else 1.0
            row = np.zeros(system.unknowns)
            where = group.map.unknowns[k]
            local = jacobian[0, k] @ b[0, k, m, group.inputs]
            np.add.at(row, where[where >= 0], local[where >= 0])
            names.append((spec.names[k], strain))
            values.append(e[0, k, m] / scale)
            rows.append(row * unit / scale)
            rigid.append(bool(spec.rigid[k, m]))
    jacobian = np.array(rows).reshape(len(rows), system.unknowns)
    return StrainRows(tuple(names), np.array(values), jacobian, np.array(rigid, dtype=bool))


def null_space(matrix: Array) -> Array:
    """Orthonormal basis (n, k) of the null space by singular values."""
    if matrix.shape[1] == 0:
        return np.zeros((0, 0))
    if matrix.shape[0] == 0:
        return np.eye(matrix.shape[1])
    _, s, vt = np.linalg.svd(matrix, full_matrices=True)
    rank = int((s > _RANK * max(s[0], 1e-300)).sum())
    return np.asarray(vt[rank:].T)


def rank(matrix: Array) -> int:
    """Numerical rank."""
    if 0 in matrix.shape:
        return 0
    s = np.linalg.svd(matrix, compute_uv=False)
    return int((s > _RANK * max(s[0], 1e-300)).sum())


def pivots(basis: Array) -> list[int]:
    """Coordinates (one per basis vector) that, held, stop all motions of a null space basis (n, k)."""
    return pivot_columns(basis.T, basis.shape[1])


def pivot_columns(matrix: Array, count: int) -> list[int]:
    """The `count` columns that a QR decomposition with column pivoting takes first."""
    rest = np.array(matrix, dtype=float)
    order: list[int] = []
    for _ in range(count):
        norms = np.sqrt((rest**2).sum(axis=0))
        norms[order] = -1.0
        order.append(int(np.argmax(norms)))
        column = rest[:, order[-1]]
        size = float(np.sqrt(column @ column))
        if size > 0:
            unit = column / size
            rest -= np.outer(unit, unit @ rest)
    return order
