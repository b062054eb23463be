"""Exact derivatives of readings with respect to slots, by the adjoint of the implicit function theorem.

At a solution g(y, x) = 0 (y: unknowns and multipliers, x: slots), a reading z(y, x) has
dz/dx = z_x - l^T g_x with K^T l = z_y. The product l^T g_x is the derivative along l of the Lagrangian's gradient
with respect to the slots: one complex step of size `_STEP` along l through that gradient gives it for all slots at
once, exact to rounding.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.rotation import Array, cross, left_jacobian
from pkmcal_cli.base.sparse_map import pick, rows_last
from pkmcal_cli.elements import Element
from pkmcal_cli.equilibrium.assembly import View, group_view, stresses_of
from pkmcal_cli.equilibrium.given import Given, GroupNumbers, given, natural_lengths
from pkmcal_cli.equilibrium.kinematics import State, advance, turned_arms, views
from pkmcal_cli.equilibrium.newton import Slack
from pkmcal_cli.equilibrium.system import System

_STEP = 1e-30


@dataclass
class _Sums:
    """What is collected for all slots; kind real or complex as the state, the row index fastest in memory."""

    arms: Array  # (N, A, 3)
    force: Array  # (N, links, 3) forces on links
    moment: dict[int, Array]  # (N, 3) moments on the rotations that slots set
    slots: Array  # (N, S) gradient


def _start(system: System, numbers: Given, state: State) -> _Sums:
    layout, rows = system.layout, len(state)
    kind = np.result_type(state.travel, state.rotation)
    steered = np.nonzero(layout.rotations.slots[:, 0] >= 0)[0]
    return _Sums(
        turned_arms(layout, numbers.bodies, state),
        np.zeros((rows, len(layout.arms.start), 3), dtype=kind, order="F"),
        {int(r): np.zeros((rows, 3), dtype=kind, order="F") for r in steered},
        np.zeros((rows, len(layout.slots.constants)), dtype=kind, order="F"),
    )


def lagrangian_gradient(system: System, slots: Array | Given, state: State, slack: Slack | None) -> Array:
    """Derivative of the Lagrangian with respect to every slot, (N, S), at a possibly complex state.

    At a real solution its entries at drive slots are the drive forces.
    """
    numbers = slots if isinstance(slots, Given) else given(system, slots)
    sums = _start(system, numbers, state)
    stacked = views(system, state, sums.arms)
    for index, group in enumerate(system.groups):
        loose = slack[index] if slack is not None and group.group.rope.any() else None
        view = group_view(system, index, stacked)
        _add_group(system, index, numbers.groups[index], state=state, view=view, sums=sums, loose=loose)
    _arm_slots(system, numbers, state, sums)
    return sums.slots


def _add_group(
    system: System,
    index: int,
    mine: GroupNumbers,
    state: State,
    view: View,
    sums: _Sums,
    loose: Array | None,
) -> None:
    """One group's forces, and its gradients with respect to stiffness, rest and prestress."""
    group = system.groups[index]
    spec = group.group
    e, b = spec.element.evaluate(view.delta, view.ti, view.tj, mine.rest)
    stress = stresses_of(system, group, mine, e, state, loose)
    _pull(sums, system, index, np.einsum("nek,neki->nei", stress, b))
    acting = e * group.elastic
    if loose is not None:
        acting = acting * ~loose[:, :, None]
    energy, pull = _energies(spec.element, acting), stress
    if spec.element.per_length and mine.stiffness is not None:
        length = natural_lengths(group, mine.rest)
        energy = energy / length[..., None]
        pull = stress.copy(order="F")
        pull[..., 0] += 0.5 * np.einsum("nekl,nek,nel->ne", mine.stiffness, acting, acting) / length
    _slot_view(sums.slots, spec.stiffness, spec.shape[0], energy.shape[2])[...] = energy
    np.negative(pull, out=_slot_view(sums.slots, spec.rest, *spec.shape))
    if system.loaded:
        np.multiply(e, group.stressed, out=_slot_view(sums.slots, spec.prestress, *spec.shape))


def _energies(element: Element, e: Array) -> Array:
    """Energies 1/2 e^T pattern e of strains (N, E, m) per unit of each stiffness number, (N, E, P)."""
    patterns = element.patterns
    out = np.zeros((*e.shape[:2], len(patterns)), dtype=e.dtype, order="F")
    for p, k, l in zip(*np.nonzero(np.triu(patterns)), strict=True):
        factor = patterns[p, k, l] * (0.5 if k == l else 1.0)
        out[..., p] += factor * e[..., k] * e[..., l]
    return out


def _slot_view(slots: Array, where: slice, count: int, width: int) -> Array:
    """Slots of a group (N, E, width), a view of all slots (N, S)."""
    return np.moveaxis(slots.T[where].reshape(count, width, len(slots)), -1, 0)


def point_gradient(system: System, slots: Array | Given, state: State, forces: Array) -> Array:
    """Direct dependence on slots of the sum of forces (N, points, 3) times reading points: (N, S)."""
    numbers = slots if isinstance(slots, Given) else given(system, slots)
    sums = _start(system, numbers, state)
    sums.force[:, system.layout.points] = forces
    _arm_slots(system, numbers, state, sums)
    return sums.slots


def strain_gradient(system: System, slots: Array | Given, state: State, target: tuple[int, int, int]) -> Array:
    """Direct dependence on slots of one measured elongation or displacement (strain plus its rest value): (N, S)."""
    numbers = slots if isinstance(slots, Given) else given(system, slots)
    sums = _start(system, numbers, state)
    index, e, m = target
    view, element = group_view(system, index, views(system, state, sums.arms)), system.groups[index].group.element
    _, b = element.evaluate(view.delta, view.ti, view.tj, numbers.groups[index].rest)
    only = np.zeros((*b.shape[:2], b.shape[3]), order="F")
    only[:, e] = b[:, e, m]
    _pull(sums, system, index, only)
    _arm_slots(system, numbers, state, sums)
    return sums.slots


def _pull(sums: _Sums, system: System, index: int, pull: Array) -> None:
    """Add one group's link forces and port moments (N, E, inputs)."""
    group = system.groups[index].group
    sums.force[:, group.links] = pull[..., :3]
    for r, moment in sums.moment.items() if group.element.uses_triads else ():
        for side, inputs in ((0, slice(3, 6)), (1, slice(6, 9))):
            moment += pull[:, group.rotation[side] == r, inputs].sum(axis=1)


def _arm_slots(system: System, numbers: Given, state: State, sums: _Sums) -> None:
    """Chain link forces and port moments to offsets, prescribed travels, frames and driven angles."""
    layout = system.layout
    table, rotations = layout.arms, layout.rotations
    pull = pick(sums.force, table.link)  # (N, A, 3)
    local = np.einsum("naij,nai->naj", pick(state.rotation, table.rotation), pull)
    sums.slots += system.maps.arm_slots(rows_last(local)).T
    frames = layout.frames.tolist()
    for r, moment in sums.moment.items():
        mine = np.nonzero(table.rotation == r)[0]
        moment += cross(pick(sums.arms, mine), pick(pull, mine)).sum(axis=1)
        if r in frames:
            turn = left_jacobian(numbers.frames[:, frames.index(r)])
            turned = np.einsum("nij,ni->nj", turn, moment)
            for k in range(3):
                sums.slots[:, rotations.slots[r, k]] += turned[:, k]
        elif system.place[layout.rotation_dofs[r]] < 0:
            sums.slots[:, rotations.slots[r, 0]] += moment @ rotations.axis[r]


def adjoint_derivative(
    system: System, slots: Array | Given, state: State, slack: Slack | None, multipliers: Array, scale: float
) -> Array:
    """l^T dg/dslots for C adjoint vectors l (N, C, n + c), the last c of each in scaled form: (N, C, S)."""
    numbers, layout = slots if isinstance(slots, Given) else given(system, slots), system.layout
    rows, count = multipliers.shape[:2]
    out: Array = np.empty((rows, count, len(layout.slots.constants)), order="F")
    for c in range(count):
        stepped = advance(system, state, 1j * _STEP * multipliers[:, c], scale)
        out[:, c] = lagrangian_gradient(system, numbers, stepped, slack).imag
    out /= _STEP
    if system.loaded and len(layout.force_dofs):
        where = system.place[layout.force_dofs]
        for k in np.nonzero(where >= 0)[0]:
            out[:, :, layout.force_slots[k]] -= multipliers[:, :, where[k]]
    return out
