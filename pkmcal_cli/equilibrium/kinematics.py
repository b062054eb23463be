"""State of all rows, arms and links at a state, and the input Jacobian of links (rows are machine configurations)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..layout import DriveKind, Index, Layout, Turn
from ..rotation import Array, cross, exp, skew
from .system import LinkMap, System


@dataclass(frozen=True)
class State:
    """Travels (N, T) in m, rotations (N, B, 3, 3), multipliers (N, c) in N or N m, of N rows."""

    travel: Array
    rotation: Array
    multiplier: Array

    def __len__(self) -> int:
        return len(self.travel)

    def take(self, rows: Index) -> State:
        """The state of some rows."""
        return State(self.travel[rows], self.rotation[rows], self.multiplier[rows])

    def put(self, rows: Index, other: State) -> State:
        """This state with some rows taken from `other`."""
        out = State(self.travel.copy(), self.rotation.copy(), self.multiplier.copy())
        for mine, theirs in (
            (out.travel, other.travel),
            (out.rotation, other.rotation),
            (out.multiplier, other.multiplier),
        ):
            mine[rows] = theirs
        return out


def drawn_state(layout: Layout, slots: Array, rows: int, constraints: int) -> State:
    """The drawing as a state of `rows` rows; frames stand where `slots` (1 or N, S) puts them."""
    travel = np.tile(layout.travel_drawn, (rows, 1))
    rotation = np.tile(layout.rotations.drawn, (rows, 1, 1, 1))
    return place_prescribed(
        layout, slots, State(travel, rotation, np.zeros((rows, constraints))), frames_only=True
    )


def place_prescribed(
    layout: Layout, slots: Array, state: State, frames_only: bool = False, free: Index | None = None
) -> State:
    """Set what slots prescribe: frames and, unless `frames_only`, the travels and angles not among `free`."""
    rotations = layout.rotations
    rotation = state.rotation.copy()
    frames = np.nonzero((rotations.kind == Turn.FIXED) & (rotations.slots[:, 0] >= 0))[0]
    if len(frames):
        rotation[:, frames] = exp(slots[:, rotations.slots[frames]]) @ rotations.drawn[frames]
    travel = state.travel.copy()
    if not frames_only:
        unknown = set() if free is None else set(free.tolist())
        for t in np.nonzero(layout.travel_slots >= 0)[0]:
            if int(t) not in unknown:
                travel[:, t] = slots[:, layout.travel_slots[t]]
        for drive in layout.drives:
            r = drive.target[0]
            if drive.kind is DriveKind.ROTATION and int(layout.rotation_dofs[r]) not in unknown:
                rotation[:, r] = (
                    exp(slots[:, rotations.slots[r, 0], None] * rotations.axis[r]) @ rotations.drawn[r]
                )
    return replace(state, travel=travel, rotation=rotation)


def advance(system: System, state: State, step: Array, multiplier_scale: float) -> State:
    """The state moved by `step` (N, n + c) of the unknowns and scaled multipliers."""
    layout, n = system.layout, system.unknowns
    full = np.zeros((len(step), layout.n_dof), dtype=step.dtype)
    full[:, system.free] = step[:, :n]
    travel = state.travel + full[:, : len(layout.travel_slots)]
    rotation = state.rotation.astype(step.dtype) if np.iscomplexobj(step) else state.rotation.copy()
    kind, first = layout.rotations.kind, layout.rotation_dofs
    free = np.nonzero(kind == Turn.FREE)[0]
    if len(free):
        theta = full[:, first[free, None] + np.arange(3)]
        rotation[:, free] = _turn(theta, state.rotation[:, free])
    axial = np.nonzero(kind == Turn.AXIS)[0]
    if len(axial):
        theta = full[:, first[axial], None] * layout.rotations.axis[axial]
        rotation[:, axial] = _turn(theta, state.rotation[:, axial])
    return State(travel, rotation, state.multiplier + multiplier_scale * step[:, n:])


def _turn(theta: Array, rotation: Array) -> Array:
    if np.iscomplexobj(theta):  # a complex step: the increment is infinitesimal
        return np.asarray(rotation + skew(theta) @ rotation)
    return np.asarray(exp(theta) @ rotation)


def arm_vectors(layout: Layout, slots: Array, state: State) -> Array:
    """All arms in base axes, (N, A, 3)."""
    arms = layout.arms
    vectors = slots[:, arms.offset_slots][:, arms.offset]  # (R, A, P, 3)
    body = (vectors * arms.sign[:, :, None]).sum(2) + (state.travel @ arms.travel).reshape(len(state), -1, 3)
    turned = (state.rotation[:, arms.rotation] @ body[..., None])[..., 0]
    return np.asarray(turned)


def link_vectors(layout: Layout, arms: Array) -> Array:
    """Vectors from port i to port j, (N, links, 3)."""
    return np.add.reduceat(arms, layout.arms.start, axis=1)


def input_jacobian(layout: Layout, links: LinkMap, state: State, arms: Array) -> tuple[Array, Array]:
    """Transposed Jacobian of the inputs with respect to local unknowns (N, E, L, I), and the travel directions (N, F, 3)."""
    out = np.empty((len(state), *links.template.shape))
    out[...] = links.template
    width = min(3, out.shape[-1]) if not layout.planar else 2
    e, column, arm, axis = links.along
    directions = (state.rotation[:, layout.arms.rotation[arm]] @ axis[:, :, None])[..., 0]
    if len(e):
        out[:, e, column, :width] = directions[..., :width]
    e, column, arm = links.about
    if len(e):
        turns = skew(arms[:, arm])
        for k in range(3):
            out[:, e, column + k, :width] = turns[:, :, k, :width]
    e, column, arm, axis = links.axial
    if len(e):
        out[:, e, column, :width] = cross(axis, arms[:, arm])[..., :width]
    return out, directions
