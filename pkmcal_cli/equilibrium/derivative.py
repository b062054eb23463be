"""Readings are differentiated exactly by coefficients, by the adjoint of the implicit function theorem.

At a solution g(y, x) = 0 (y: unknowns and multipliers, x: coefficients), a reading z(y, x) has
dz/dx = z_x - l^T g_x with K^T l = z_y. The product l^T g_x is the derivative along l of the Lagrangian's gradient
with respect to the coefficients: one complex step of size `_STEP` along l through that gradient gives it for all
coefficients at once, exact to rounding.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.rotation import Array, cross, left_jacobian
from pkmcal_cli.base.sparse_map import pick, rows_last
from pkmcal_cli.elements import Element, LinkGeometry
from pkmcal_cli.equilibrium.kinematics import State, advance, geometries, rotated_offset_vectors
from pkmcal_cli.equilibrium.strains import Geometry, group_geometry, group_strains, on_links
from pkmcal_cli.equilibrium.stresses import carrying_ropes, stresses_of
from pkmcal_cli.equilibrium.system import System
from pkmcal_cli.equilibrium.system_numbers import GroupNumbers, SystemNumbers, natural_lengths, system_numbers
from pkmcal_cli.mechanism.topology import GROUND, Group

_TOGETHER = 4e4  # numbers of a gradient that are computed at once: more no longer fit into the cache
_STEP = 1e-30


@dataclass
class _Sums:
    """What is collected for all coefficients; kind real or complex as the state, the row index fastest in memory."""

    offset_vectors: Array  # (N, A, 3)
    force: Array  # (N, links, 3) forces on links
    moment: dict[int, Array]  # (N, 3) moments on the rotations that coefficients set
    coefficients: Array  # (N, S) gradient


def _start(system: System, numbers: SystemNumbers, state: State) -> _Sums:
    topology, rows = system.topology, len(state)
    kind = np.result_type(state.translation, state.rotation)
    steered = np.nonzero(topology.rotations.coefficients[:, 0] >= 0)[0]
    return _Sums(
        rotated_offset_vectors(topology, numbers.bodies, state),
        np.zeros((rows, len(topology.offset_vectors.start), 3), dtype=kind, order="F"),
        {int(r): np.zeros((rows, 3), dtype=kind, order="F") for r in steered},
        np.zeros((rows, len(topology.coefficients.constants)), dtype=kind, order="F"),
    )


def lagrangian_gradient(
    system: System,
    coefficients: Array | SystemNumbers,
    state: State,
    *,
    taut: bool = False,
    pulls: Array | None = None,
) -> Array:
    """Differentiate the Lagrangian with respect to every coefficient, (N, S), at a possibly complex state.

    At a real solution its entries at drive coefficients are the drive forces. Ropes are taut or slack by the real part
    of their stress; `taut`: they push too. pulls (N, points, 3): forces on reading points, which take part in it.
    """
    numbers = system_numbers(system, coefficients)
    sums = _start(system, numbers, state)
    if pulls is not None:
        sums.force[:, system.topology.points] = pulls
    stacked = geometries(system, state, sums.offset_vectors)
    for index in range(len(system.groups)):
        geometry = group_geometry(system, index, stacked)
        _add_group(system, index, numbers.groups[index], state=state, geometry=geometry, sums=sums, taut=taut)
    _offset_vector_coefficients(system, numbers, state, sums)
    return sums.coefficients


def _add_group(
    system: System,
    index: int,
    group_numbers: GroupNumbers,
    state: State,
    geometry: Geometry,
    sums: _Sums,
    taut: bool,
) -> None:
    """One group's forces, and its gradients with respect to stiffness, rest and prestress."""
    group = system.groups[index]
    spec, group_numbers = group.group, group_numbers.at(state.translation)
    links = geometry.links(group_numbers.sizes)
    e, b = group_strains(spec, links, group_numbers.rest)
    stress = stresses_of(group, group_numbers, e, state)
    carrying = None if taut else carrying_ropes(group, group_numbers, e)
    if carrying is not None:
        stress = stress * carrying[:, :, None]
    _pull(sums, system, index, np.einsum("nek,neki->nei", on_links(spec, stress), b))
    if spec.element.sizes:
        _sizes(sums, spec, links, on_links(spec, stress))
    acting = e * group.elastic
    if carrying is not None:
        acting = acting * carrying[:, :, None]
    energy, pull = _energies(spec.element, acting), stress
    length = natural_lengths(group, group_numbers.rest)[..., None]
    if spec.element.per_length or spec.element.load_power:
        energy = energy / length if spec.element.per_length else energy
        pull = stress.copy(order="F")
        pull[..., 0] -= group_numbers.by_length(acting if spec.element.per_length else e)[0]
    _coefficients_of_group(sums.coefficients, spec.stiffness, spec.shape[0], energy.shape[2])[...] = energy
    np.negative(pull, out=_coefficients_of_group(sums.coefficients, spec.rest, *spec.shape))
    if spec.element.slides:
        _add_held_translations(system, spec, pull, sums)
    if system.loaded:
        np.multiply(
            (e if carrying is None else e * carrying[:, :, None]) * length**spec.element.load_power,
            group.stressed,
            out=_coefficients_of_group(sums.coefficients, spec.prestress, *spec.shape),
        )


def _add_held_translations(system: System, spec: Group, pull: Array, sums: _Sums) -> None:
    """Gradient with respect to prescribed translations that add to natural lengths; pull (N, E, m): -d/d rest."""
    held = np.nonzero(spec.slides.any(axis=1) & (system.unknown_of[: len(spec.slides)] < 0))[0]
    sums.coefficients[:, system.topology.translation_coefficients[held]] -= pull[..., 0] @ spec.slides[held].T


def _sizes(sums: _Sums, spec: Group, links: LinkGeometry, stress: Array) -> None:
    """Gradient with respect to the sizes of links, under stresses (N, K, m)."""
    where = _coefficients_of_group(sums.coefficients, spec.sizes, len(spec.weights), len(spec.element.sizes))
    slopes = spec.element.by_sizes(links) * spec.weights[:, None, None]
    np.einsum("nkm,nkmp->nkp", stress, slopes, out=where)


def _energies(element: Element, e: Array) -> Array:
    """Energies of strains (N, E, m) per unit of each stiffness number, (N, E, P)."""
    out = np.zeros((*e.shape[:2], len(element.patterns)), dtype=e.dtype, order="F")
    for p, k, l, factor in element.energy_terms:
        out[..., p] += factor * e[..., k] * e[..., l]
    return out


def _coefficients_of_group(coefficients: Array, where: slice, count: int, width: int) -> Array:
    """Coefficients of a group (N, E, width), a view of all coefficients (N, S)."""
    return np.moveaxis(coefficients.T[where].reshape(count, width, len(coefficients)), -1, 0)


def strain_gradient(
    system: System, coefficients: Array | SystemNumbers, state: State, target: tuple[int, int, int]
) -> Array:
    """Differentiate one measured elongation or displacement, strain plus rest value, by coefficients: (N, S)."""
    numbers = system_numbers(system, coefficients)
    sums = _start(system, numbers, state)
    index, e, m = target
    geometry = group_geometry(system, index, geometries(system, state, sums.offset_vectors))
    spec = system.groups[index].group
    links = geometry.links(numbers.groups[index].sizes)
    _, b = group_strains(spec, links, numbers.groups[index].rest)
    own = np.zeros((1, len(spec.weights), b.shape[2]))
    own[:, spec.owners == e, m] = 1.0
    _pull(sums, system, index, np.asfortranarray(np.einsum("nkm,nkmi->nki", own, b)))
    if spec.element.sizes:
        _sizes(sums, spec, links, own)
    _offset_vector_coefficients(system, numbers, state, sums)
    return sums.coefficients


def _pull(sums: _Sums, system: System, index: int, pull: Array) -> None:
    """Add one group's link forces and connection point moments (N, E, inputs)."""
    group = system.groups[index].group
    sums.force[:, group.links] = pull[..., :3]
    for r, moment in sums.moment.items() if group.element.uses_triads else ():
        for side, inputs in ((0, slice(3, 6)), (1, slice(6, 9))):
            moment += pull[:, group.rotation[side] == r, inputs].sum(axis=1)


def _offset_vector_coefficients(system: System, numbers: SystemNumbers, state: State, sums: _Sums) -> None:
    """Chain link forces and connection point moments to offsets, prescribed translations, frames and driven angles."""
    topology = system.topology
    table, rotations = topology.offset_vectors, topology.rotations
    pull = pick(sums.force, table.link)  # (N, A, 3)
    local = np.einsum("naij,nai->naj", pick(state.rotation, table.rotation), pull)
    sums.coefficients += system.maps.offset_vector_coefficients(rows_last(local)).T
    frames = topology.frames.tolist()
    for r, moment in reversed(sums.moment.items()):  # what is carried before its carrier, which feels its moment
        carried = np.nonzero(table.rotation == r)[0]
        moment += cross(pick(sums.offset_vectors, carried), pick(pull, carried)).sum(axis=1)
        if r in frames:
            carrier = int(rotations.carrier[r])
            if carrier in sums.moment:
                sums.moment[carrier] += moment
            inner = moment if carrier == GROUND else np.einsum("nij,ni->nj", state.rotation[:, carrier], moment)
            rotation = left_jacobian(numbers.frames[:, frames.index(r)])
            rotated = np.einsum("nij,ni->nj", rotation, inner)
            for k in range(3):
                sums.coefficients[:, rotations.coefficients[r, k]] += rotated[:, k]
        elif system.unknown_of[topology.rotation_dofs[r]] < 0:
            sums.coefficients[:, rotations.coefficients[r, 0]] += moment @ rotations.axis[r]


def adjoint_derivative(
    system: System,
    coefficients: Array | SystemNumbers,
    state: State,
    multipliers: Array,
    scale: float,
    *,
    taut: bool = False,
    points: Array | None = None,
) -> Array:
    """Compute l^T dg/dc for C adjoint vectors l (N, C, n + c), the last c of each in scaled form: (N, C, S).

    points (C, points, 3): less what coefficients do directly to these sums of the coordinates of reading points.
    """
    numbers = system_numbers(system, coefficients)
    topology = system.topology
    rows, count = multipliers.shape[:2]
    out: Array = np.empty((rows, count, len(topology.coefficients.constants)), order="F")
    along, pairs = multipliers.reshape(rows * count, -1, order="F"), out.reshape(rows * count, -1, order="F")
    together = max(1, int(_TOGETHER / out.shape[2]))
    for first in range(0, len(pairs), together):
        some = slice(first, first + together)  # of the pairs of row and vector, the row running fastest
        channel, row = np.divmod(np.arange(len(pairs))[some], rows)
        stepped = advance(system, state.take(row), 1j * _STEP * along[some], scale)
        pulls = None if points is None else -1j * _STEP * points[channel]
        gradient = lagrangian_gradient(system, numbers.take(row), stepped, taut=taut, pulls=pulls).imag
        np.divide(gradient, _STEP, out=pairs[some])
    if system.loaded and len(topology.force_dofs):
        where = system.unknown_of[topology.force_dofs]
        for k in np.nonzero(where >= 0)[0]:
            out[:, :, topology.force_coefficients[k]] -= multipliers[:, :, where[k]]
    return out
