"""Balance of forces and its tangent for all rows at once.

The Lagrangian is 1/2 e^T S e + s0^T e + mu^T e_rigid - f^T u; its gradient with respect to the unknowns and the
multipliers is the residual, and the derivative of the residual the tangent (n + c square, multipliers scaled by
`System`-wide stiffness so that both blocks have the same magnitude).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..layout import Layout
from ..elements.base import turned
from ..rotation import Array, cross, dot
from .kinematics import State, arm_vectors, input_jacobian, link_vectors
from .system import GroupMap, Layers, LinkMap, System


@dataclass(frozen=True)
class Balance:
    """Residual (N, n + c), tangent (N, n + c, n + c) or None, and per group strains and stresses (N, E, m)."""

    residual: Array
    tangent: Array | None
    strains: tuple[Array, ...]
    stresses: tuple[Array, ...]


def stiffness_matrices(system: System, group: GroupMap, slots: Array) -> Array:
    """S of every element, (1 or N, E, m, m), zero where a strain is rigid or released."""
    count, width = group.group.shape
    patterns = group.group.element.patterns
    numbers = slots[:, group.group.stiffness].reshape(len(slots), count, len(patterns))
    if group.group.element.per_length:
        numbers = numbers / slots[:, group.group.rest].reshape(len(slots), count, width)[..., :1]
    full = (
        np.tensordot(numbers, patterns, axes=(2, 0))
        if len(patterns)
        else np.zeros((len(slots), count, width, width))
    )
    return np.asarray(full * group.elastic[:, :, None] * group.elastic[:, None, :])


def typical_stiffness(system: System, slots: Array) -> float:
    """A stiffness (N/m) that scales multipliers: the largest of the machine's, or 1 where nothing yields."""
    largest = [
        float(np.abs(stiffness_matrices(system, g, slots[:1])).max(initial=0.0)) for g in system.groups
    ]
    return max(largest, default=0.0) or 1.0


@dataclass(frozen=True)
class _Context:
    """What all groups of one evaluation share."""

    system: System
    slots: Array
    state: State
    arms: Array
    deltas: Array
    scale: float
    curved: bool  # include the stress term of the tangent
    slack: tuple[NDArray[np.bool_], ...] | None


def balance(
    system: System,
    slots: Array,
    state: State,
    scale: float,
    *,
    tangent: bool = True,
    curved: bool = True,
    slack: tuple[NDArray[np.bool_], ...] | None = None,
) -> Balance:
    """Residual and tangent at a state. `curved=False` leaves the stress term out (Gauss-Newton)."""
    arms = arm_vectors(system.layout, slots, state)
    context = _Context(system, slots, state, arms, link_vectors(system.layout, arms), scale, curved, slack)
    size, rows = system.size, len(state)
    residual = np.zeros((rows, size))
    matrix = np.zeros((rows, size * size)) if tangent else None
    strains, stresses = [], []
    for index, group in enumerate(system.groups):
        e, s = _add_group(context, index, group, residual, matrix)
        strains.append(e)
        stresses.append(s)
    if system.loaded and len(system.layout.force_dofs):
        where = system.place[system.layout.force_dofs]
        acting = np.nonzero(where >= 0)[0]
        np.subtract.at(residual, (slice(None), where[acting]), slots[:, system.layout.force_slots[acting]])
    square = None if matrix is None else matrix.reshape(rows, size, size)
    return Balance(residual, square, tuple(strains), tuple(stresses))


def port_triads(system: System, group: GroupMap, state: State) -> tuple[Array, Array]:
    """Carried triads of both ends, (N, E, 3, 3) each; empty for elements that ignore them."""
    if not group.group.element.uses_triads:
        return np.empty(0), np.empty(0)
    ri, rj = group.group.rotation
    ti, tj = group.group.triads
    return np.asarray(state.rotation[:, ri] @ ti), np.asarray(state.rotation[:, rj] @ tj)


def stresses_of(
    context_slots: Array, system: System, group: GroupMap, e: Array, state: State, stiffness: Array
) -> Array:
    """Stress of every strain: S e + s0, or the multiplier of a constraint, (N, E, m)."""
    stress = (stiffness @ e[..., None])[..., 0]
    if system.loaded:
        stress = (
            stress + context_slots[:, group.group.prestress].reshape(-1, *group.group.shape) * group.stressed
        )
    if len(group.rigid[0]):
        stress[:, group.rigid[0], group.rigid[1]] = state.multiplier[:, group.rows]
    return np.asarray(stress)


def _add_group(
    context: _Context, index: int, group: GroupMap, residual: Array, matrix: Array | None
) -> tuple[Array, Array]:
    """Add one group's forces, constraints and tangent; returns its strains and stresses."""
    system, state = context.system, context.state
    element, inputs = group.group.element, _inputs(system.layout, group)
    delta = context.deltas[:, group.group.links]
    ti, tj = port_triads(system, group, state)
    rest = context.slots[:, group.group.rest].reshape(-1, *group.group.shape)
    e, b = element.evaluate(delta, ti, tj, rest)
    stiffness = stiffness_matrices(system, group, context.slots)
    if context.slack is not None and group.group.rope.any():
        stiffness = stiffness * ~context.slack[index][:, :, None, None]
    stress = stresses_of(context.slots, system, group, e, state, stiffness)
    jacobian, directions = input_jacobian(system.layout, group.map, state, context.arms)
    b = b[..., inputs]
    force = (stress[..., None, :] @ b)[..., 0, :]  # (N, E, I)
    _scatter(residual, (jacobian @ force[..., None])[..., 0], group.map.gradient)
    if len(group.rigid[0]):
        rows = system.unknowns + np.arange(group.rows.start, group.rows.stop)
        residual[:, rows] = context.scale * e[:, group.rigid[0], group.rigid[1]]
    if matrix is not None:
        local = np.swapaxes(b, -1, -2) @ (stiffness @ b)  # (N, E, I, I)
        if context.curved:
            local = local + element.curvature(delta, ti, tj, stress)[..., inputs[:, None], inputs]
        reduced = (jacobian @ local) @ np.swapaxes(jacobian, -1, -2)
        if context.curved:
            _add_arm_curvature(context, group.map, force, directions, reduced)
        _scatter(matrix, reduced, group.map.tangent)
        _add_constraints(context, group, jacobian, b, matrix)
    return e, stress


def _inputs(layout: Layout, group: GroupMap) -> NDArray[np.intp]:
    return layout.inputs[layout.inputs < group.group.element.inputs]


def _scatter(target: Array, local: Array, layers: Layers) -> None:
    flat = local.reshape(len(local), -1)
    for source, where in layers:
        target[:, where] += flat[:, source]


def _add_constraints(context: _Context, group: GroupMap, jacobian: Array, b: Array, matrix: Array) -> None:
    """Rows and columns of the multipliers, scaled."""
    e, m = group.rigid
    if not len(e):
        return
    size = context.system.size
    local = context.scale * (jacobian[:, e] @ b[:, e, m, :, None])[..., 0]  # (N, rigid, L)
    unknowns = group.map.unknowns[e]
    r, column = np.nonzero(unknowns >= 0)
    row = context.system.unknowns + group.rows.start + r
    values = local[:, r, column]
    where = unknowns[r, column]
    matrix[:, row * size + where] += values
    matrix[:, where * size + row] += values


def _add_arm_curvature(
    context: _Context, links: LinkMap, force: Array, directions: Array, reduced: Array
) -> None:
    """Second derivatives of the arms contracted with the link force f: turning an arm w adds w f^T - (w . f) I."""
    full = np.zeros((*force.shape[:-1], 3))
    width = 2 if context.system.layout.planar else 3
    full[..., :width] = force[..., :width]
    e, column, arm = links.about
    if len(e):
        blocks = turned(context.arms[:, arm], full[:, e])
        for k in range(3):
            for l in range(3):
                reduced[:, e, column + k, column + l] += blocks[..., k, l]
    e, column, arm, axis = links.axial
    if len(e):
        w = context.arms[:, arm]
        reduced[:, e, column, column] += dot(axis, cross(cross(axis, w), full[:, e]))
    _add_mixed_curvature(links, full, directions, reduced)


def _add_mixed_curvature(links: LinkMap, force: Array, directions: Array, reduced: Array) -> None:
    """A travel direction u carried by a rotation couples the two unknowns by u x f."""
    fill, e, column = links.along_about
    if len(fill):
        moment, along = cross(directions[:, fill], force[:, e]), links.along[1][fill]
        for k in range(3):
            reduced[:, e, column + k, along] += moment[..., k]
            reduced[:, e, along, column + k] += moment[..., k]
    fill, e, column, axis = links.along_axial
    if len(fill):
        single, along = dot(axis, cross(directions[:, fill], force[:, e])), links.along[1][fill]
        reduced[:, e, column, along] += single
        reduced[:, e, along, column] += single
