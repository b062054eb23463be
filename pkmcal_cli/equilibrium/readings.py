"""Quantities z(u, c) of a state are observed: values, gradients by unknowns u, direct derivatives by coefficients c.

A drive reads (position - position at reading zero - elastic part of its own drive) / gain: its encoder sits before its
compliance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.rotation import Array, left_jacobian, log, log_jacobian, times
from pkmcal_cli.equilibrium.derivative import strain_gradient
from pkmcal_cli.equilibrium.kinematics import (
    State,
    geometries,
    input_jacobian,
    link_vectors,
    offset_vectors_at,
    rotated_offset_vectors,
)
from pkmcal_cli.equilibrium.strains import group_geometry, group_strains
from pkmcal_cli.equilibrium.system import System
from pkmcal_cli.equilibrium.system_numbers import (
    SystemNumbers,
    constant_offset_vectors,
    frame_vectors,
    link_sizes,
    rest_values,
)
from pkmcal_cli.mechanism.topology import GROUND, Drive, DriveKind, Group
from pkmcal_cli.units.measurands import Measurand


@dataclass(frozen=True)
class ObservedQuantity:
    """A quantity of the structure: a coordinate of a point or an orientation, the reading of a drive, or a load.

    Loads are the force of a drive, the tension of a rope and the strain energy, which follow from the energy, see
    `prediction.forces`; `read_quantities` reads the others.
    """

    measurand: Measurand  # POSITION, ORIENTATION, DRIVE, FORCE, TENSION or ENERGY
    index: int  # point, rotation or drive; of a tension: group
    component: int = 0  # of a tension: element

    @property
    def is_load(self) -> bool:
        """Whether it follows from the energy."""
        return self.measurand in (Measurand.FORCE, Measurand.TENSION, Measurand.ENERGY)


@dataclass(frozen=True)
class Readings:
    """Values (N, C); gradients by unknowns (N, C, n + c); direct derivatives by coefficients (N, C, S) or None.

    points (C, points, 3): coordinates of points that are read; what coefficients do directly to these is left to
    `adjoint_derivative`.
    """

    values: Array
    unknowns: Array | None = None
    coefficients: Array | None = None
    points: Array | None = None


def read_quantities(
    system: System,
    coefficients: Array,
    state: State,
    quantities: tuple[ObservedQuantity, ...],
    gains: Array,
    numbers: SystemNumbers | None,
) -> Readings:
    """Read all quantities; `gains` (A,): indices of the drives' gains; `numbers`: for derivatives."""
    topology, derivatives = system.topology, numbers is not None
    constant = constant_offset_vectors(topology, coefficients) if numbers is None else numbers.bodies
    offset_vectors = rotated_offset_vectors(topology, constant, state)
    points = link_vectors(topology, offset_vectors)[:, topology.points]
    values, read = np.empty((len(state), len(quantities))), np.zeros((len(quantities), *points.shape[1:]))
    gradient = np.zeros((len(state), len(quantities), system.size), order="F") if derivatives else None
    direct = np.zeros((len(state), len(quantities), coefficients.shape[1]), order="F") if derivatives else None
    jacobian = input_jacobian(topology, system.points, state, offset_vectors)[0] if derivatives else None
    bodies_read = {q.index for q in quantities if q.measurand is Measurand.ORIENTATION}
    vectors = {r: _rotated(state, r, topology.rotations.filed) for r in bodies_read}
    for c, q in enumerate(quantities):
        if q.measurand is Measurand.POSITION:
            p, k = q.index, q.component
            values[:, c], read[c, p, k] = points[:, p, k], 1.0
            if gradient is not None and jacobian is not None:
                _scatter_row(gradient[:, c], system.points.unknowns[p], jacobian[:, p, :, k])
        elif q.measurand is Measurand.ORIENTATION:
            values[:, c] = vectors[q.index][:, q.component]
            if gradient is not None and direct is not None:
                row = log_jacobian(vectors[q.index])[:, q.component]  # (N, 3)
                into = gradient[:, c], direct[:, c]
                _rotation_gradient(system, coefficients, state, q.index, along=row, into=into)
        else:
            drive, gain = topology.drives[q.index], int(gains[q.index])
            part = _drive_reading(system, coefficients, state, drive, gain, derivatives)
            values[:, c] = part.values
            if gradient is not None and direct is not None:
                gradient[:, c], direct[:, c] = part.unknowns, part.coefficients
    return Readings(values, gradient, direct, read if derivatives and read.any() else None)


def _rotated(state: State, r: int, since: Array) -> Array:
    """Rotation vector of rotation r since an orientation of all (B, 3, 3): (N, 3)."""
    return log(times(state.rotation[:, r], since[r].T))


def _scatter_row(target: Array, unknowns: Array, local: Array) -> None:
    """Add local gradients (N, L) to rows (N, n + c)."""
    for k in np.nonzero(unknowns >= 0)[0]:
        target[:, unknowns[k]] += local[:, k]


def _rotation_gradient(
    system: System, coefficients: Array, state: State, r: int, *, along: Array, into: tuple[Array, Array]
) -> None:
    """Chain along . theta_r (N, 3) to the unknowns (N, n + c) of rotation r and its carriers, and to the coefficients
    (N, S) that turn or prescribe these."""
    topology, (gradient, direct) = system.topology, into
    rotations, frames = topology.rotations, topology.frames.tolist()
    while r in frames:
        carrier = int(rotations.carrier[r])
        inner = along if carrier == GROUND else np.einsum("nij,ni->nj", state.rotation[:, carrier], along)
        turning = left_jacobian(frame_vectors(topology, coefficients)[:, frames.index(r)])
        direct[:, rotations.coefficients[r]] += (inner[:, None, :] @ turning)[:, 0]
        r = carrier
    start, kind = int(topology.rotation_dofs[r]), rotations.kind[r]
    if start >= 0:
        entries = along if kind == 1 else (along @ rotations.axis[r])[:, None]
        where = system.unknown_of[start : start + entries.shape[1]]
        gradient[:, where[where >= 0]] = entries[:, where >= 0]
        coefficient = rotations.coefficients[r, 0]
        if kind != 1 and coefficient >= 0 and where[0] < 0:
            direct[:, coefficient] = entries[:, 0]


def _drive_reading(
    system: System, coefficients: Array, state: State, drive: Drive, gain_coefficient: int, derivatives: bool
) -> Readings:
    """Reading = (measured position - position at reading zero - elastic travel of its own drive) / gain."""
    rows = len(state)
    gain = np.broadcast_to(coefficients[:, gain_coefficient], (rows,))
    base = coefficients[:, drive.coefficient]
    unknowns = np.zeros((rows, system.size))
    direct = np.zeros((rows, coefficients.shape[1]))
    if drive.kind is DriveKind.TRAVEL:
        position = state.translation[:, drive.target[0]]
        where = system.unknown_of[drive.target[0]]
        if where >= 0:
            unknowns[:, where] = 1.0
        else:
            direct[:, drive.coefficient] += 1.0
    elif drive.kind is DriveKind.ROTATION:
        r = drive.target[0]
        position = _rotated(state, r, system.topology.rotations.reference) @ system.topology.rotations.axis[r]
        along = np.tile(system.topology.rotations.axis[r], (rows, 1))
        _rotation_gradient(system, coefficients, state, r, along=along, into=(unknowns, direct))
    else:
        position = _strain_position(
            system, coefficients, state, drive=drive, unknowns=unknowns, direct=direct, derivatives=derivatives
        )
    reading = (position - base) / gain
    if not derivatives:
        return Readings(reading)
    direct[:, drive.coefficient] -= 1.0
    unknowns, direct = unknowns / gain[:, None], direct / gain[:, None]
    direct[:, gain_coefficient] -= reading / gain
    return Readings(reading, unknowns, direct)


def _strain_position(
    system: System,
    coefficients: Array,
    state: State,
    drive: Drive,
    unknowns: Array,
    direct: Array,
    derivatives: bool,
) -> Array:
    """Length or displacement of the driven element less its elastic part under the drive's force, (N,)."""
    index, e, m = drive.target
    group = system.groups[index]
    offset_vectors = offset_vectors_at(system.topology, coefficients, state)
    geometry = group_geometry(system, index, geometries(system, state, offset_vectors))
    rest = rest_values(group, coefficients)
    strain, b = group_strains(group.group, geometry.links(link_sizes(group, coefficients)), rest)
    position = strain[:, e, m] + rest[:, e, m]
    if derivatives:
        jacobian, _ = input_jacobian(system.topology, group.map, state, offset_vectors)
        for k in np.nonzero(group.group.owners == e)[0]:
            local = (jacobian[:, k] @ b[:, k, m, group.inputs, None])[..., 0]
            _scatter_row(unknowns, group.map.unknowns[k], local)
        direct += strain_gradient(system, coefficients, state, (index, e, m))
    if group.group.rigid[e, m]:
        return position
    own = own_stiffness(group.group, e, m)
    tension, stiffness = coefficients[:, drive.force_coefficient] * system.loaded, coefficients[:, own]
    if group.group.element.per_length:  # the natural length L of l = L (1 + tension / ES)
        natural = position / (1.0 + tension / stiffness)
        share = (natural / position)[:, None]
        unknowns *= share
        direct *= share
        direct[:, drive.force_coefficient] -= natural / (stiffness + tension) * system.loaded
        direct[:, own] += natural / (stiffness + tension) * tension / stiffness
        return np.asarray(natural)
    if derivatives:
        direct[:, drive.force_coefficient] -= 1.0 / stiffness * system.loaded
        direct[:, own] += tension / stiffness**2
    return np.asarray(position - tension / stiffness)


def own_stiffness(group: Group, e: int, m: int) -> int:
    """Give the coefficient of the stiffness number of one strain that has one of its own."""
    return int(group.stiffness.start) + e * len(group.element.patterns) + m


def forced_energy(system: System, coefficients: Array, strains: tuple[Array, ...], drive: Drive) -> Array:
    """Give the energy (N,), J, of the member that a force-controlled drive strains: T^2 / (2 k), or T^2 L / (2 ES)."""
    index, e, m = drive.target
    group = system.groups[index].group
    if group.rigid[e, m] or not system.loaded:
        return np.zeros(len(coefficients))
    tension, stiffness = coefficients[:, drive.force_coefficient], coefficients[:, own_stiffness(group, e, m)]
    energy = 0.5 * tension**2 / stiffness
    if group.element.per_length:
        length = strains[index][:, e, m] + coefficients[:, drive.coefficient]
        energy = energy * length / (1.0 + tension / stiffness)
    return np.asarray(energy)
