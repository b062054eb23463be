"""Exact derivatives of readings with respect to slots, by the adjoint of the implicit function theorem.

At a solution g(y, x) = 0 (y: unknowns and multipliers, x: slots), a reading z(y, x) has
dz/dx = z_x - l^T g_x with K^T l = z_y. The product l^T g_x is the derivative along l of the Lagrangian's gradient
with respect to the slots: one complex step of size `_STEP` along l through that gradient gives it for all slots at
once, exact to rounding.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..layout import Turn
from ..rotation import Array, cross, left_jacobian, log
from .assembly import port_triads, stiffness_matrices, stresses_of
from .kinematics import State, advance, arm_vectors, link_vectors
from .newton import Slack
from .system import System

_STEP = 1e-30


@dataclass
class _Sums:
    """Forces on links (N, links, 3), moments on rotations (N, B, 3) and slot gradient (N, S) being collected."""

    arms: Array
    deltas: Array
    force: Array
    moment: Array
    slots: Array


def _start(system: System, slots: Array, state: State) -> _Sums:
    arms = arm_vectors(system.layout, slots, state)
    deltas = link_vectors(system.layout, arms)
    kind = np.result_type(state.travel, state.rotation)
    moment = np.zeros((*state.rotation.shape[:2], 3), dtype=kind)
    return _Sums(
        arms, deltas, np.zeros_like(deltas), moment, np.zeros((len(state), slots.shape[1]), dtype=kind)
    )


def lagrangian_gradient(system: System, slots: Array, state: State, slack: Slack | None) -> Array:
    """Derivative of the Lagrangian with respect to every slot, (N, S), at a possibly complex state.

    At a real solution its entries at drive slots are the drive forces.
    """
    sums = _start(system, slots, state)
    for index, group in enumerate(system.groups):
        loose = slack[index] if slack is not None and group.group.rope.any() else None
        ti, tj = port_triads(system, group, state)
        rest = slots[:, group.group.rest].reshape(-1, *group.group.shape)
        e, b = group.group.element.evaluate(sums.deltas[:, group.group.links], ti, tj, rest)
        stiffness = stiffness_matrices(system, group, slots)
        acting = e * group.elastic
        if loose is not None:
            stiffness, acting = stiffness * ~loose[:, :, None, None], acting * ~loose[:, :, None]
        stress = stresses_of(slots, system, group, e, state, stiffness)
        _pull(sums, system, index, (stress[..., None, :] @ b)[..., 0, :])
        energy = 0.5 * np.einsum("pkl,nek,nel->nep", group.group.element.patterns, acting, acting)
        pull = stress.copy()
        if group.group.element.per_length:
            energy = energy / rest[..., :1]
            numbers = slots[:, group.group.stiffness].reshape(energy.shape)
            pull[..., 0] += (numbers * energy / rest[..., :1]).sum(-1)
        sums.slots[:, group.group.stiffness] = energy.reshape(len(state), -1)
        sums.slots[:, group.group.rest] = -pull.reshape(len(state), -1)
        if system.loaded:
            sums.slots[:, group.group.prestress] = (e * group.stressed).reshape(len(state), -1)
    _arm_slots(system, state, sums)
    return sums.slots


def point_gradient(system: System, slots: Array, state: State, forces: Array) -> Array:
    """Direct dependence on slots of the sum of forces (N, points, 3) times reading points: (N, S)."""
    sums = _start(system, slots, state)
    sums.force[:, system.layout.points] = forces
    _arm_slots(system, state, sums)
    return sums.slots


def strain_gradient(system: System, slots: Array, state: State, target: tuple[int, int, int]) -> Array:
    """Direct dependence on slots of one measured elongation or displacement (strain plus its rest value): (N, S)."""
    sums = _start(system, slots, state)
    index, e, m = target
    group = system.groups[index]
    ti, tj = port_triads(system, group, state)
    rest = slots[:, group.group.rest].reshape(-1, *group.group.shape)
    _, b = group.group.element.evaluate(sums.deltas[:, group.group.links], ti, tj, rest)
    only = np.zeros_like(b[..., 0, :])
    only[:, e] = b[:, e, m]
    _pull(sums, system, index, only)
    _arm_slots(system, state, sums)
    return sums.slots


def _pull(sums: _Sums, system: System, index: int, pull: Array) -> None:
    """Add one group's link forces and port moments (N, E, inputs)."""
    group = system.groups[index].group
    sums.force[:, group.links] = pull[..., :3]
    if group.element.uses_triads:
        np.add.at(sums.moment, (slice(None), group.rotation[0]), pull[..., 3:6])
        np.add.at(sums.moment, (slice(None), group.rotation[1]), pull[..., 6:9])


def _arm_slots(system: System, state: State, sums: _Sums) -> None:
    """Chain link forces and port moments to offsets, prescribed travels, frames and driven angles."""
    layout = system.layout
    table, out, moment = layout.arms, sums.slots, sums.moment
    pull = sums.force[:, table.link]  # (N, A, 3)
    local = (np.swapaxes(state.rotation[:, table.rotation], -1, -2) @ pull[..., None])[..., 0]
    for p in range(table.offset.shape[1]):
        where = table.offset_slots[table.offset[:, p]]  # (A, 3)
        np.add.at(out, (slice(None), where), table.sign[:, p, None] * local)
    held = system.place[: len(layout.travel_slots)] < 0
    driven = np.nonzero(held & (layout.travel_slots >= 0))[0]
    along = local.reshape(len(local), -1) @ table.travel[driven].T
    np.add.at(out, (slice(None), layout.travel_slots[driven]), along)
    np.add.at(moment, (slice(None), table.rotation), cross(sums.arms, pull))
    rotations = layout.rotations
    for r in np.nonzero(rotations.slots[:, 0] >= 0)[0]:
        if rotations.kind[r] == Turn.FIXED:
            vector = log(state.rotation[:, r].real @ rotations.drawn[r].T)
            turned = np.swapaxes(left_jacobian(vector), -1, -2) @ moment[:, r, :, None]
            np.add.at(out, (slice(None), rotations.slots[r]), turned[..., 0])
        elif system.place[layout.rotation_dofs[r]] < 0:
            out[:, rotations.slots[r, 0]] += moment[:, r] @ rotations.axis[r]


def adjoint_derivative(
    system: System, slots: Array, state: State, slack: Slack | None, multipliers: Array, scale: float
) -> Array:
    """l^T dg/dslots for C adjoint vectors l (N, C, n + c), the last c of each in scaled form: (N, C, S)."""
    channels = []
    for c in range(multipliers.shape[1]):
        stepped = advance(system, state, 1j * _STEP * multipliers[:, c], scale)
        channels.append(lagrangian_gradient(system, slots, stepped, slack).imag / _STEP)
    out = np.stack(channels, axis=1)
    layout = system.layout
    if system.loaded and len(layout.force_dofs):
        where = system.place[layout.force_dofs]
        acting = np.nonzero(where >= 0)[0]
        index = (slice(None), slice(None), layout.force_slots[acting])
        np.subtract.at(out, index, multipliers[:, :, where[acting]])
    return out
