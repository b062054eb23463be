"""Exact derivatives of readings with respect to slots, by the adjoint of the implicit function theorem.

At a solution g(y, x) = 0 (y: unknowns and multipliers, x: slots), a reading z(y, x) has
dz/dx = z_x - l^T g_x with K^T l = z_y. The product l^T g_x is the derivative along l of the Lagrangian's gradient
with respect to the slots: one complex step of size `_STEP` along l through that gradient gives it for all slots at
once, exact to rounding.
"""

from __future__ import annotations

import numpy as np

from ..layout import Layout, Turn
from ..rotation import Array, cross, left_jacobian
from .assembly import port_triads, stiffness_matrices, stresses_of
from .kinematics import State, advance, arm_vectors, link_vectors
from .newton import Slack
from .system import System

_STEP = 1e-30


def slot_gradient(
    system: System, slots: Array, state: State, slack: Slack | None, point_forces: Array | None = None
) -> Array:
    """Derivative of the Lagrangian with respect to every slot, (N, S), at a possibly complex state.

    With `point_forces` (N, points, 3), instead that of the sum of force . reading point: the direct dependence of
    point readings on slots.
    """
    layout = system.layout
    arms = arm_vectors(layout, slots, state)
    deltas = link_vectors(layout, arms)
    kind = np.result_type(state.travel, state.rotation)
    out = np.zeros((len(state), slots.shape[1]), dtype=kind)
    force = np.zeros_like(deltas)  # (N, links, 3)
    moment = np.zeros((*state.rotation.shape[:2], 3), dtype=kind)  # (N, B, 3)
    if point_forces is not None:
        force[:, layout.points] = point_forces
    else:
        for index, group in enumerate(system.groups):
            delta = deltas[:, group.group.links]
            ti, tj = port_triads(system, group, state)
            rest = slots[:, group.group.rest].reshape(-1, *group.group.shape)
            e, b = group.group.element.evaluate(delta, ti, tj, rest)
            stiffness = stiffness_matrices(system, group, slots)
            loose = 1.0
            if slack is not None and group.group.rope.any():
                loose = ~slack[index][:, :, None]  # type: ignore[assignment]
                stiffness = stiffness * ~slack[index][:, :, None, None]
            stress = stresses_of(slots, system, group, e, state, stiffness)
            pull = (stress[..., None, :] @ b)[..., 0, :]
            force[:, group.group.links] = pull[..., :3]
            if group.group.element.uses_triads:
                np.add.at(moment, (slice(None), group.group.rotation[0]), pull[..., 3:6])
                np.add.at(moment, (slice(None), group.group.rotation[1]), pull[..., 6:9])
            acting = e * group.elastic * loose
            energy = 0.5 * np.einsum("pkl,nek,nel->nep", group.group.element.patterns, acting, acting)
            out[:, group.group.stiffness] = energy.reshape(len(state), -1)
            out[:, group.group.rest] = -stress.reshape(len(state), -1)
            if system.loaded:
                out[:, group.group.prestress] = (e * group.stressed).reshape(len(state), -1)
    _arm_slots(layout, state, arms, force, moment, out)
    return out


def _arm_slots(layout: Layout, state: State, arms: Array, force: Array, moment: Array, out: Array) -> None:
    """Chain link forces and port moments to offsets, prescribed travels, frames and driven angles."""
    table = layout.arms
    pull = force[:, table.link]  # (N, A, 3)
    local = (np.swapaxes(state.rotation[:, table.rotation], -1, -2) @ pull[..., None])[..., 0]
    for p in range(table.offset.shape[1]):
        where = table.offset_slots[table.offset[:, p]]  # (A, 3)
        np.add.at(out, (slice(None), where), table.sign[:, p, None] * local)
    driven = np.nonzero(layout.travel_slots >= 0)[0]
    along = local.reshape(len(local), -1) @ table.travel[driven].T
    np.add.at(out, (slice(None), layout.travel_slots[driven]), along)
    np.add.at(moment, (slice(None), table.rotation), cross(arms, pull))
    rotations = layout.rotations
    for r in np.nonzero(rotations.slots[:, 0] >= 0)[0]:
        if rotations.kind[r] == Turn.FIXED:
            vector = _frame_vector(layout, state, int(r))
            out[:, rotations.slots[r]] += (
                np.swapaxes(left_jacobian(vector), -1, -2) @ moment[:, r, :, None]
            )[..., 0]
        else:
            out[:, rotations.slots[r, 0]] += moment[:, r] @ rotations.axis[r]


def _frame_vector(layout: Layout, state: State, r: int) -> Array:
    """Rotation vector that turns a frame from its drawn orientation, (N, 3)."""
    from ..rotation import log

    return log(state.rotation[:, r].real @ layout.rotations.drawn[r].T)


def adjoint_derivative(
    system: System, slots: Array, state: State, slack: Slack | None, multipliers: Array, scale: float
) -> Array:
    """l^T dg/dslots for C adjoint vectors l (N, C, n + c), the last c of each in scaled form: (N, C, S)."""
    channels = [
        slot_gradient(
            system, slots, advance(system, state, 1j * _STEP * multipliers[:, c], scale), slack
        ).imag
        / _STEP
        for c in range(multipliers.shape[1])
    ]
    out = np.stack(channels, axis=1)
    layout = system.layout
    if system.loaded and len(layout.force_dofs):
        where = system.place[layout.force_dofs]
        acting = np.nonzero(where >= 0)[0]
        np.subtract.at(
            out, (slice(None), slice(None), layout.force_slots[acting]), multipliers[:, :, where[acting]]
        )
    return out
