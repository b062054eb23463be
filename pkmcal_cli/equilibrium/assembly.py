"""Balance of forces and its tangent for all rows at once.

The Lagrangian is 1/2 e^T S e + s0^T e + mu^T e_rigid - f^T u; its gradient with respect to the unknowns and the
multipliers is the residual, and the derivative of the residual the tangent (n + c square, multipliers scaled by
`System`-wide stiffness so that both blocks have the same magnitude).

Rows run fastest in memory. Each group writes its part into a block of a stacked array (see `maps`); one sparse
product then adds all blocks up.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array, cross, dot
from pkmcal_cli.base.sparse_map import pick
from pkmcal_cli.elements.base import turned
from pkmcal_cli.equilibrium.given import Given, GroupNumbers, given, stiffness_matrices, typical_stiffness
from pkmcal_cli.equilibrium.group_map import GroupMap
from pkmcal_cli.equilibrium.kinematics import State, turned_arms, views
from pkmcal_cli.equilibrium.links import Pairs
from pkmcal_cli.equilibrium.maps import Blocks
from pkmcal_cli.equilibrium.system import System

__all__ = ["Balance", "balance", "group_view", "stiffness_matrices", "stresses_of", "typical_stiffness"]

Loose = NDArray[np.bool_]  # (N, E) ropes that are slack


@dataclass(frozen=True)
class Balance:
    """Residual (N, n + c), tangent (N, n + c, n + c) or None, and per group strains and stresses (N, E, m)."""

    residual: Array
    tangent: Array | None
    strains: tuple[Array, ...]
    stresses: tuple[Array, ...]


class View(NamedTuple):
    """What the elements of a group see: triads (N, E, 3, 3), links (N, E, 3), varying directions (N, M, X, 3)."""

    ti: Array
    tj: Array
    delta: Array
    directions: Array


def group_view(system: System, index: int, stacked: Array) -> View:
    """One group's part of the stacked views (entries, N)."""
    blocks = system.view_maps.groups[index]
    parts = (blocks.ti, blocks.tj, blocks.delta, blocks.directions)
    return View(*(part.of(stacked) for part in parts))


@dataclass(frozen=True, kw_only=True)
class _Context:
    """What all groups of one evaluation share."""

    system: System
    numbers: Given
    state: State
    arms: Array  # (N, A, 3)
    views: Array  # (entries, N)
    forces: Array  # (entries, N), to be filled
    tangents: Array | None  # (entries, N), to be filled
    residual: Array  # (N, n + c), to be filled
    scale: float
    curved: bool  # include the stress term of the tangent


def balance(
    system: System,
    slots: Array | Given,
    state: State,
    scale: float,
    *,
    tangent: bool = True,
    curved: bool = True,
    slack: tuple[Loose, ...] | None = None,
    matrix: Array | None = None,
) -> Balance:
    """Residual and tangent at a state. `curved=False` leaves the stress term out (Gauss-Newton).

    `slots` (1 or N, S), or what they say where several states are looked at. `matrix` (N, (n + c)^2): memory for
    the tangent, zero but for what an earlier balance of this system left there.
    """
    numbers = slots if isinstance(slots, Given) else given(system, slots)
    rows, maps = len(state), system.maps
    arms = turned_arms(system.layout, numbers.bodies, state)
    stacked = views(system, state, arms)
    kind = arms.dtype  # complex where a derivative is taken by complex step; there is no tangent then
    forces = np.empty((maps.residual.columns, rows), dtype=kind)
    tangents = np.empty((maps.tangent.columns, rows)) if tangent else None
    residual = np.empty((rows, system.size), dtype=kind, order="F")
    context = _Context(
        system=system, numbers=numbers, state=state, arms=arms, views=stacked, forces=forces, tangents=tangents,
        residual=residual, scale=scale, curved=curved,
    )  # fmt: skip
    parts = [
        _add_group(context, k, None if slack is None or not group.group.rope.any() else slack[k])
        for k, group in enumerate(system.groups)
    ]
    residual[:, : system.unknowns] = maps.residual(forces).T
    if system.loaded:
        _add_constant_forces(system, numbers, residual)
    square = None if tangents is None else _matrix(system, tangents, matrix)
    return Balance(residual, square, tuple(e for e, _ in parts), tuple(s for _, s in parts))


def _matrix(system: System, tangents: Array, matrix: Array | None) -> Array:
    """The tangent (N, n + c, n + c) from the stacked ones of the elements (entries, N); columns run in memory."""
    rows, size, maps = tangents.shape[1], system.size, system.maps
    if matrix is None:
        matrix = np.zeros((rows, size * size))
    matrix[:, maps.filled] = maps.tangent(tangents).T
    return np.swapaxes(matrix.reshape(rows, size, size), 1, 2)


def _add_constant_forces(system: System, numbers: Given, residual: Array) -> None:
    where = system.place[system.layout.force_dofs]
    for k in np.nonzero(where >= 0)[0]:
        residual[:, where[k]] -= numbers.forces[:, k]


def stresses_of(
    system: System, group: GroupMap, numbers: GroupNumbers, e: Array, state: State, loose: Loose | None
) -> Array:
    """Stress of every strain: S e + s0, or the multiplier of a constraint, (N, E, m)."""
    if numbers.stiffness is None:
        stress = np.zeros(e.shape, dtype=e.dtype, order="F")
    else:
        stress = numbers.stress(e)
        if loose is not None:
            stress *= ~loose[:, :, None]
    if numbers.prestress is not None:
        stress += numbers.prestress
    for k, (link, strain) in enumerate(zip(*group.rigid, strict=True), start=group.rows.start):
        stress[:, link, strain] = state.multiplier[:, k]
    return stress


def of_constraints(x: Array, group: GroupMap) -> Array:
    """x (N, E, m, ...) of the rigid strains, (N, R, ...)."""
    link, strain = group.rigid
    flat = x.reshape(len(x), -1, *x.shape[3:], order="F")  # (N, E * m, ...)
    return pick(flat, link + x.shape[1] * strain)


def _add_group(context: _Context, index: int, loose: Loose | None) -> tuple[Array, Array]:
    """Write one group's forces, constraints and tangent; returns its strains and stresses."""
    system, group = context.system, context.system.groups[index]
    numbers, blocks = context.numbers.groups[index], system.maps.groups[index]
    view = group_view(system, index, context.views)
    e, b = group.group.element.evaluate(view.delta, view.ti, view.tj, numbers.rest)
    stress = stresses_of(system, group, numbers, e, context.state, loose)
    used = b if b.shape[-1] == len(group.inputs) else b.T[group.inputs].T  # (N, E, m, I)
    force = blocks.force.of(context.forces)
    np.einsum("nek,neki->nei", stress, used, out=force)
    directions = view.directions[..., : context.system.layout.width]
    if len(group.map.moving):
        pull = pick(force, group.map.moving)[..., : context.system.layout.width]
        np.einsum("nmxd,nmd->nmx", directions, pull, out=blocks.varying_force.of(context.forces))
    if len(group.rigid[0]):
        rows = slice(system.unknowns + group.rows.start, system.unknowns + group.rows.stop)
        context.residual[:, rows] = context.scale * of_constraints(e, group)
    if context.tangents is not None:
        _add_own(context, index, view, numbers=numbers, b=used, stress=stress, loose=loose)
        _add_varying(context.tangents, group, blocks, directions)
        _add_arm_curvature(context, index, force, view.directions)
        _add_constraints(context, index, used, directions)
    return e, stress


def _add_own(
    context: _Context,
    index: int,
    view: View,
    numbers: GroupNumbers,
    b: Array,
    stress: Array,
    loose: Loose | None,
) -> None:
    """Tangent with respect to the inputs: b^T S b and the stress times the strains' second derivative."""
    group, tangents = context.system.groups[index], context.tangents
    block = context.system.maps.groups[index].own
    if tangents is None or block.shape[0] == 0:
        return
    own = block.of(tangents)  # (N, E, I, I)
    if numbers.stiffness is None:
        own[...] = 0.0
    else:
        np.einsum("neki,nekj->neij", b, numbers.stress(b), out=own)
        if loose is not None:
            own *= ~loose[:, :, None, None]
    element, inputs = group.group.element, group.inputs
    if context.curved and element.curved:
        seen = (view.delta, view.ti, view.tj, stress)
        if len(inputs) == element.inputs:
            element.add_curvature(own, *seen)
        else:
            own += element.curvature(*seen)[..., inputs[:, None], inputs]


def _add_varying(tangents: Array, group: GroupMap, blocks: Blocks, directions: Array) -> None:
    """Tangent with respect to the varying inputs: J M, M J^T and J M J^T, M the part with respect to delta."""
    if blocks.left.shape[0] == 0:
        return
    width = directions.shape[-1]
    own = pick(blocks.own.of(tangents), group.map.moving)
    left, right = blocks.left.of(tangents), blocks.right.of(tangents)
    np.einsum("nmxd,nmdi->nmxi", directions, own[:, :, :width], out=left)
    np.einsum("nmid,nmxd->nmix", own[..., :width], directions, out=right)
    np.einsum("nmxd,nmyd->nmxy", left[..., :width], directions, out=blocks.both.of(tangents))


def _add_constraints(context: _Context, index: int, b: Array, directions: Array) -> None:
    """Gradients of the constraints, scaled: rows and columns of the multipliers."""
    group, blocks = context.system.groups[index], context.system.maps.groups[index]
    if context.tangents is None or not len(group.rigid[0]):
        return
    rigid = blocks.rigid.of(context.tangents)  # (N, R, I)
    np.multiply(of_constraints(b, group), context.scale, out=rigid)
    varying = blocks.varying_rigid.of(context.tangents)  # (N, R, X)
    varying[...] = 0.0
    mine = np.nonzero(np.isin(group.rigid[0], group.map.moving))[0]
    if len(mine):
        along = pick(directions, np.searchsorted(group.map.moving, group.rigid[0][mine]))
        varying[:, mine] = np.einsum("nrxd,nrd->nrx", along, pick(rigid, mine)[..., : along.shape[-1]])


def _add_arm_curvature(context: _Context, index: int, force: Array, directions: Array) -> None:
    """Second derivatives of the arms contracted with the link force f: turning an arm w adds w f^T - (w . f) I."""
    links, blocks = context.system.groups[index].map, context.system.maps.groups[index]
    parts = (blocks.turning, blocks.hinged, blocks.sliding_turning, blocks.sliding_hinged)
    if context.tangents is None or not len(links.moving):
        return
    turning, hinged, mixed_turning, mixed_hinged = (part.of(context.tangents) for part in parts)
    if not context.curved:
        for part in (turning, hinged, mixed_turning, mixed_hinged):
            part[...] = 0.0
        return
    pull = np.zeros((*force.shape[:2], 3), order="F")
    pull[..., : context.system.layout.width] = force[..., : context.system.layout.width]
    if len(links.turning.link):
        turning[...] = turned(pick(context.arms, links.turning.arm), pick(pull, links.turning.link))
    if len(links.hinged.link):
        axis, arms = links.hinged.axis, pick(context.arms, links.hinged.arm)
        hinged[...] = dot(axis, cross(cross(axis, arms), pick(pull, links.hinged.link)))
    for pairs, out in ((links.sliding_turning, mixed_turning), (links.sliding_hinged, mixed_hinged)):
        if len(pairs.sliding):
            moment = _sliding_moment(context, index, pairs, pull, directions)
            hinge = links.hinged.axis[pairs.turning] if out is mixed_hinged else None
            out[...] = moment if hinge is None else dot(hinge, moment)


def _sliding_moment(context: _Context, index: int, pairs: Pairs, pull: Array, directions: Array) -> Array:
    """u x f for travel directions u that turn, (N, F, 3)."""
    links = context.system.groups[index].map
    link, varying = links.sliding.link[pairs.sliding], links.sliding.varying[pairs.sliding]
    row = np.searchsorted(links.moving, link)
    return cross(directions[:, row, varying], pick(pull, link))
