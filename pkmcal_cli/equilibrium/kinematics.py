"""The state of all rows (translations, rotations, multipliers), its offset vectors and links, the Jacobian of links.

Rotations are matrices, moved by increments from the left, R <- exp(theta) R, so that no parametrisation has a
singularity; a link is delta = sum +-R_r (o + s a) with translations s, and d delta = theta x (R o) for each of its
offset vectors.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pkmcal_cli.base.rotation import Array, cross, exp, log, times
from pkmcal_cli.base.sparse_map import Block, pick, rows_last, take_rows
from pkmcal_cli.equilibrium.links import LinkMap
from pkmcal_cli.equilibrium.system import System
from pkmcal_cli.equilibrium.system_numbers import constant_offset_vectors, frame_vectors
from pkmcal_cli.mechanism.topology import GROUND, DriveKind, Index, Topology


@dataclass(frozen=True)
class State:
    """Travels (N, T) in m, rotations (N, B, 3, 3), multipliers (N, c) in N or N m, of N rows."""

    translation: Array
    rotation: Array
    multiplier: Array

    def __len__(self) -> int:
        return len(self.translation)

    def take(self, rows: Index | slice) -> State:
        """The state of some rows."""
        return State(*(take_rows(x, rows) for x in (self.translation, self.rotation, self.multiplier)))

    def put(self, rows: Index, other: State) -> State:
        """This state with some rows taken from `other`."""
        out = State(*(x.copy(order="K") for x in (self.translation, self.rotation, self.multiplier)))
        out.write(rows, other)
        return out

    def write(self, rows: Index, other: State) -> None:
        """Overwrite some rows, in place."""
        for target, source in (
            (self.translation, other.translation),
            (self.rotation, other.rotation),
            (self.multiplier, other.multiplier),
        ):
            target.T[..., rows] = source.T


def reference_state(topology: Topology, coefficients: Array, rows: int, constraints: int) -> State:
    """Give the reference configuration in `rows` rows; frames are where `coefficients` (1 or N, S) put them."""
    translation = np.empty((rows, len(topology.translation_reference)), order="F")
    rotation = np.empty((rows, *topology.rotations.reference.shape), order="F")
    translation[:], rotation[:] = topology.translation_reference, topology.rotations.reference
    return place_prescribed(
        topology, coefficients, State(translation, rotation, np.zeros((rows, constraints))), frames_only=True
    )


def place_prescribed(
    topology: Topology, coefficients: Array, state: State, frames_only: bool = False, free: Index | None = None
) -> State:
    """Set what coefficients prescribe: frames and, unless `frames_only`, translations and angles not among `free`."""
    rotations = topology.rotations
    rotation = state.rotation.copy(order="K")
    translation = state.translation.copy(order="K")
    if not frames_only:
        unknown = set() if free is None else set(free.tolist())
        for t in np.nonzero(topology.translation_coefficients >= 0)[0]:
            if int(t) not in unknown:
                translation[:, t] = coefficients[:, topology.translation_coefficients[t]]
        for drive in topology.drives:
            r = drive.target[0]
            if drive.kind is DriveKind.ROTATION and int(topology.rotation_dofs[r]) not in unknown:
                angle = coefficients[:, rotations.coefficients[r, 0], None]
                rotation[:, r] = exp(angle * rotations.axis[r]) @ rotations.reference[r]
    _place_frames(topology, coefficients, rotation)
    return replace(state, translation=translation, rotation=rotation)


def _place_frames(topology: Topology, coefficients: Array, rotation: Array) -> None:
    """Set the orientations of frames among `rotation` (N, B, 3, 3): as their carriers', turned by coefficients."""
    if not len(topology.frames):
        return
    turned = times(exp(frame_vectors(topology, coefficients)), topology.rotations.reference[topology.frames])
    for k, r in enumerate(topology.frames):
        carrier = topology.rotations.carrier[r]
        rotation[:, r] = turned[:, k] if carrier == GROUND else times(rotation[:, carrier], turned[:, k])


def advance(system: System, state: State, step: Array, multiplier_scale: float) -> State:
    """Move the state by `step` (N, n + c) of the unknowns and scaled multipliers."""
    topology, n = system.topology, system.unknowns
    full = np.zeros((len(step), topology.n_dof), dtype=step.dtype, order="F")
    full[:, system.free] = step[:, :n]
    translation = state.translation + full[:, : len(topology.translation_coefficients)]
    (free, turning), (axial, about, axes) = topology.free_rotations, topology.axial_rotations
    rotation = np.asarray(state.rotation, dtype=np.result_type(state.rotation, step))
    if len(free) or len(axial):
        rotation = rotation.copy(order="F")
    if len(free):
        rotation[:, free] = _rotation_of(pick(full, turning), pick(state.rotation, free))
    if len(axial):
        theta = full[:, about, None] * axes
        rotation[:, axial] = _rotation_of(theta, pick(state.rotation, axial))
    return State(translation, rotation, state.multiplier + multiplier_scale * step[:, n:])


def _rotation_of(theta: Array, rotation: Array) -> Array:
    if np.iscomplexobj(theta):  # a complex step: the increment is infinitesimal
        columns = np.swapaxes(rotation, -1, -2)
        return rotation + np.swapaxes(cross(theta[..., None, :], columns), -1, -2)
    return times(exp(theta), rotation)


def without_stress(state: State, system: System) -> State:
    """Give the same pose as a state of another system, its constraints without force."""
    return State(state.translation, state.rotation, np.zeros((len(state), system.constraints), order="F"))


def offset_vectors_at(topology: Topology, coefficients: Array, state: State) -> Array:
    """Rotate all offset vectors into base axes, (N, A, 3)."""
    return rotated_offset_vectors(topology, constant_offset_vectors(topology, coefficients), state)


def rotated_offset_vectors(topology: Topology, bodies: Array, state: State) -> Array:
    """Rotate offset vectors into base axes, (N, A, 3); `bodies` (1 or N, A, 3): constant parts in their triads."""
    offset_vectors = bodies + topology.offset_vector_block.of(topology.translation_map(rows_last(state.translation)))
    carried, width = topology.carried_offset_vectors, topology.width
    if len(carried):
        carriers = pick(state.rotation[..., :width, :width], topology.offset_vectors.rotation[carried])
        rotated = np.einsum("naij,naj->nai", carriers, pick(offset_vectors, carried)[..., :width])
        offset_vectors.T[:width, carried] = rotated.T
    return np.asarray(offset_vectors)


def link_vectors(topology: Topology, offset_vectors: Array) -> Array:
    """Compute the vectors from point i to point j, (N, links, 3)."""
    return topology.link_block.of(topology.link_map(rows_last(offset_vectors)))


def point_poses(topology: Topology, coefficients: Array, state: State, point: int, rotation: int) -> Array:
    """Give poses (N, 6), m and rad, of a point that is read: place, and rotation since the configuration as filed."""
    links = link_vectors(topology, offset_vectors_at(topology, coefficients, state))
    rotation_vector = log(times(state.rotation[:, rotation], topology.rotations.filed[rotation].T))
    return np.concatenate([links[:, topology.points[point]], rotation_vector], axis=1)


def geometries(system: System, state: State, offset_vectors: Array) -> Array:
    """Stack triads, links and varying directions of all groups (entries, N) as `system.geometry_maps` says."""
    return system.geometry_maps.geometries(_moved(state, offset_vectors))


def _moved(state: State, offset_vectors: Array) -> Array:
    return np.concatenate([rows_last(state.rotation), rows_last(offset_vectors)])


def input_jacobian(topology: Topology, links: LinkMap, state: State, offset_vectors: Array) -> tuple[Array, Array]:
    """Give the transposed Jacobian (N, E, L, I) of inputs by local unknowns, and varying directions (N, M, X, 3)."""
    out = np.repeat(links.template[None], len(state), axis=0)
    directions = Block(0, (*links.shape, 3)).of(links.directions(_moved(state, offset_vectors)))
    moved = np.einsum("mlx,nmxd->nmld", links.varying, directions[..., : topology.width])
    out[:, links.moving, :, : topology.width] += moved
    return out, directions
