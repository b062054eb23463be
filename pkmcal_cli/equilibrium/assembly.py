"""Balance of forces and its tangent for all rows at once.

The Lagrangian L = 1/2 e^T S e + s0^T e + mu^T e_rigid - f^T u of strains e(u), stiffness S and prestress s0 has the
gradient g = b^T (S e + s0) + b_rigid^T mu - f with b = de/du: zero is the balance of forces, and e_rigid = 0 closes
rigid joints exactly, where a penalty stiffness (Ecorchard 2010, eq. 5) would be an arbitrary compromise. The
tangent K = b^T S b + sum stress d2e/du2 has its second term because a strained bar that rotates changes the direction
of its force; without it (`curved=False`) it is the K of eq. 6-7 of the paper. Multipliers are scaled by a stiffness of
the machine so that both blocks of the matrix have the same magnitude.

Rows run fastest in memory. Each group writes its part into a block of a stacked array (see `maps`); one sparse
product then adds all blocks up.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array, cross, dot
from pkmcal_cli.base.sparse_map import pick
from pkmcal_cli.elements import LinkGeometry
from pkmcal_cli.elements.element import rotated
from pkmcal_cli.equilibrium.group_map import GroupMap
from pkmcal_cli.equilibrium.kinematics import State, geometries, rotated_offset_vectors
from pkmcal_cli.equilibrium.links import Pairs
from pkmcal_cli.equilibrium.maps import Blocks
from pkmcal_cli.equilibrium.strains import group_geometry, group_strains, on_links
from pkmcal_cli.equilibrium.stresses import carrying_ropes, stresses_of
from pkmcal_cli.equilibrium.system import System
from pkmcal_cli.equilibrium.system_numbers import (
    GroupNumbers,
    SystemNumbers,
    stiffness_matrices,
    system_numbers,
    typical_stiffness,
)
from pkmcal_cli.equilibrium.tangent import Tangent, tangent_of

__all__ = ["Balance", "balance", "stiffness_matrices", "typical_stiffness"]


@dataclass(frozen=True)
class Balance:
    """Residual (N, n + c), tangent or None, and per group strains and stresses (N, E, m).

    translation (N, T): where the balance was taken.
    """

    residual: Array
    tangent: Tangent | None
    strains: tuple[Array, ...]
    stresses: tuple[Array, ...]
    translation: Array


@dataclass(frozen=True, kw_only=True)
class _Context:
    """What all groups of one evaluation share."""

    system: System
    numbers: SystemNumbers
    state: State
    offset_vectors: Array  # (N, A, 3)
    geometries: Array  # (entries, N)
    forces: Array  # (entries, N), to be filled
    tangents: Array | None  # (entries, N), to be filled
    residual: Array  # (N, n + c), to be filled
    scale: float
    curved: bool  # include the stress term of the tangent
    taut: bool  # ropes push too


def balance(
    system: System,
    coefficients: Array | SystemNumbers,
    state: State,
    scale: float,
    *,
    tangent: bool = True,
    curved: bool = True,
    taut: bool = False,
    entries: Array | None = None,
) -> Balance:
    """Compute residual and tangent at a state. `curved=False` leaves the stress term out (Gauss-Newton).

    `taut`: ropes push too. `coefficients` (1 or N, S), or what they say where several states are looked at.
    `entries` (N, `maps.width`): memory for the tangent, zero but for what an earlier balance of this system left there.
    """
    numbers = system_numbers(system, coefficients)
    rows, maps = len(state), system.maps
    offset_vectors = rotated_offset_vectors(system.topology, numbers.bodies, state)
    stacked = geometries(system, state, offset_vectors)
    kind = offset_vectors.dtype  # complex where a derivative is taken by complex step; there is no tangent then
    forces = np.empty((maps.residual.columns, rows), dtype=kind)
    tangents = np.empty((maps.tangent.columns, rows)) if tangent else None
    residual = np.empty((rows, system.size), dtype=kind, order="F")
    context = _Context(
        system=system, numbers=numbers, state=state, offset_vectors=offset_vectors, geometries=stacked, forces=forces,
        tangents=tangents, residual=residual, scale=scale, curved=curved, taut=taut,
    )  # fmt: skip
    parts = [_add_group(context, k) for k in range(len(system.groups))]
    residual[:, : system.unknowns] = maps.residual(forces).T
    if system.loaded:
        _add_constant_forces(system, numbers, residual)
    square = None if tangents is None else _tangent(system, tangents, entries)
    return Balance(residual, square, tuple(e for e, _ in parts), tuple(s for _, s in parts), state.translation)


def _tangent(system: System, tangents: Array, entries: Array | None) -> Tangent:
    """The tangent from the stacked ones of the elements (entries, N)."""
    maps = system.maps
    if entries is None:
        entries = np.zeros((tangents.shape[1], maps.width))
    entries[:, maps.filled] = maps.tangent(tangents).T
    return tangent_of(entries, maps.fronts, system.size, system.unknowns)


def _add_constant_forces(system: System, numbers: SystemNumbers, residual: Array) -> None:
    where = system.unknown_of[system.topology.force_dofs]
    for k in np.nonzero(where >= 0)[0]:
        residual[:, where[k]] -= numbers.forces[:, k]


def of_constraints(x: Array, group: GroupMap) -> Array:
    """Take x (N, E, m, ...) of the rigid strains, (N, R, ...)."""
    link, strain = group.rigid
    flat = x.reshape(len(x), -1, *x.shape[3:], order="F")  # (N, E * m, ...)
    return pick(flat, link + x.shape[1] * strain)


def _add_group(context: _Context, index: int) -> tuple[Array, Array]:
    """Write one group's forces, constraints and tangent; returns its strains and stresses."""
    system, group = context.system, context.system.groups[index]
    numbers, blocks = context.numbers.groups[index].at(context.state.translation), system.maps.groups[index]
    geometry = group_geometry(system, index, context.geometries)
    links = geometry.links(numbers.sizes)
    e, b = group_strains(group.group, links, numbers.rest)
    stress = stresses_of(group, numbers, e, context.state)
    carrying = None if context.taut else carrying_ropes(group, numbers, e)
    if carrying is not None:
        pushing = np.asarray(group.ropes) & (stress[..., 0].real < 0)
        stress[..., 0] = np.where(pushing, 0.0, stress[..., 0])
    used = b if b.shape[-1] == len(group.inputs) else b.T[group.inputs].T  # (N, E, m, I)
    carried = on_links(group.group, stress)
    force = blocks.force.of(context.forces)
    np.einsum("nek,neki->nei", carried, used, out=force)
    if group.group.element.slides:
        force[..., -1] += numbers.by_length(e)[0]
    directions = geometry.directions[..., : context.system.topology.width]
    if len(group.map.moving):
        pull = pick(force, group.map.moving)[..., : context.system.topology.width]
        np.einsum("nmxd,nmd->nmx", directions, pull, out=blocks.varying_force.of(context.forces))
    if len(group.rigid[0]):
        rows = slice(system.unknowns + group.rows.start, system.unknowns + group.rows.stop)
        context.residual[:, rows] = context.scale * of_constraints(e, group)
    if context.tangents is not None:
        _add_own(context, index, links, numbers=numbers, b=used, stress=carried, carrying=carrying)
        _add_natural_length(context, index, numbers, e, b=used)
        _add_varying(context.tangents, group, blocks, directions)
        _add_offset_curvature(context, index, force, geometry.directions)
        if group.paths is None:
            _add_constraints(context, index, used, directions)
        else:
            gradients = group.paths.gradients(used[:, :, 0], directions)
            _add_paths(context, index, numbers=numbers, gradients=gradients, carrying=carrying)
    return e, stress


def _add_own(
    context: _Context,
    index: int,
    links: LinkGeometry,
    numbers: GroupNumbers,
    b: Array,
    stress: Array,
    carrying: NDArray[np.bool_] | None,
) -> None:
    """Tangent with respect to the inputs: b^T S b and the stress times the strains' second derivative."""
    group, tangents = context.system.groups[index], context.tangents
    block = context.system.maps.groups[index].own
    if tangents is None or block.shape[0] == 0:
        return
    own = block.of(tangents)  # (N, E, I, I)
    if numbers.stiffness is None or group.paths is not None:
        own[...] = 0.0
    else:
        np.einsum("neki,nekj->neij", b, numbers.stress(b), out=own)
        if carrying is not None:
            own *= carrying[:, :, None, None]
    element, inputs = group.group.element, group.inputs
    if context.curved and element.curved:
        stress = stress * group.group.weights[:, None] if group.paths is not None else stress
        if len(inputs) == element.inputs:
            element.add_curvature(own, links, stress)
        else:
            own += element.curvature(links, stress)[..., inputs[:, None], inputs]


def _add_natural_length(context: _Context, index: int, numbers: GroupNumbers, e: Array, b: Array) -> None:
    """Tangent with respect to natural lengths that translations change, beyond b^T S b: stiffness and loads too.

    e (N, E, m), b (N, E, m, I) with the natural length as the last input.
    """
    if context.tangents is None or not context.curved or not context.system.groups[index].group.element.slides:
        return
    own = context.system.maps.groups[index].own.of(context.tangents)
    mixed = np.einsum("nek,neki->nei", numbers.by_length(e)[1], b)
    own[..., -1, :] += mixed
    own[..., :, -1] += mixed
    own[..., -1, -1] += numbers.twice_by_length(e)


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


def _add_paths(
    context: _Context, index: int, numbers: GroupNumbers, gradients: Array, carrying: NDArray[np.bool_] | None
) -> None:
    """S g g^T of paths with gradients g (N, E, L), and the rows g^T of rigid ones, scaled."""
    group, blocks = context.system.groups[index], context.system.maps.groups[index]
    assert context.tangents is not None
    if numbers.stiffness is not None:
        stiffness = numbers.stiffness[:, :, 0]
        pull = gradients * (stiffness if carrying is None else stiffness * carrying[:, :, None])
        np.einsum("nek,nel->nekl", pull, gradients, out=blocks.paths.of(context.tangents))
    if len(group.rigid[0]):
        rows = pick(gradients, group.rigid[0])
        np.multiply(rows, context.scale, out=blocks.rigid.of(context.tangents))


def _add_constraints(context: _Context, index: int, b: Array, directions: Array) -> None:
    """Gradients of the constraints, scaled: rows and columns of the multipliers."""
    group, blocks = context.system.groups[index], context.system.maps.groups[index]
    if context.tangents is None or not len(group.rigid[0]):
        return
    rigid = blocks.rigid.of(context.tangents)  # (N, R, I)
    np.multiply(of_constraints(b, group), context.scale, out=rigid)
    varying = blocks.varying_rigid.of(context.tangents)  # (N, R, X)
    varying[...] = 0.0
    moved = np.nonzero(np.isin(group.rigid[0], group.map.moving))[0]
    if len(moved):
        along = pick(directions, np.searchsorted(group.map.moving, group.rigid[0][moved]))
        varying[:, moved] = np.einsum("nrxd,nrd->nrx", along, pick(rigid, moved)[..., : along.shape[-1]])


def _add_offset_curvature(context: _Context, index: int, force: Array, directions: Array) -> None:
    """Second derivatives of the offset vectors v, with the link force f: v f^T - (v . f) I for each that rotates."""
    links, blocks = context.system.groups[index].map, context.system.maps.groups[index]
    parts = (blocks.rotating, blocks.hinged, blocks.sliding_rotating, blocks.sliding_hinged)
    if context.tangents is None or not len(links.moving):
        return
    if not context.curved:
        for part in parts:
            context.tangents[part.start : part.stop] = 0.0
        return
    rotating, hinged, mixed_rotating, mixed_hinged = (part.of(context.tangents) for part in parts)
    pull = np.zeros((*force.shape[:2], 3), order="F")
    pull[..., : context.system.topology.width] = force[..., : context.system.topology.width]
    if len(links.rotating.link):
        rotating[...] = rotated(
            pick(context.offset_vectors, links.rotating.offset_vector), pick(pull, links.rotating.link)
        )
    if len(links.hinged.link):
        axis, offset_vectors = links.hinged.axis, pick(context.offset_vectors, links.hinged.offset_vector)
        hinged[...] = dot(axis, cross(cross(axis, offset_vectors), pick(pull, links.hinged.link)))
    for pairs, out in ((links.sliding_rotating, mixed_rotating), (links.sliding_hinged, mixed_hinged)):
        if len(pairs.sliding):
            moment = _sliding_moment(context, index, pairs, pull, directions)
            hinge = links.hinged.axis[pairs.rotating] if out is mixed_hinged else None
            out[...] = moment if hinge is None else dot(hinge, moment)


def _sliding_moment(context: _Context, index: int, pairs: Pairs, pull: Array, directions: Array) -> Array:
    """u x f for translation directions u that turn, (N, F, 3)."""
    links = context.system.groups[index].map
    link, varying = links.sliding.link[pairs.sliding], links.sliding.varying[pairs.sliding]
    row = np.searchsorted(links.moving, link)
    return cross(directions[:, row, varying], pick(pull, link))
