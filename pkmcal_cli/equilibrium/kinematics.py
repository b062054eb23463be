"""State of all rows, arms and links at a state, and the input Jacobian of links (rows are machine configurations)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pkmcal_cli.base.rotation import Array, exp, skew, times
from pkmcal_cli.base.sparse_map import Block, pick, rows_last, take_rows
from pkmcal_cli.equilibrium.given import arm_bodies, frame_vectors
from pkmcal_cli.equilibrium.links import LinkMap
from pkmcal_cli.equilibrium.system import System
from pkmcal_cli.mechanism.topology import DriveKind, Index, Layout, Turn


@dataclass(frozen=True)
class State:
    """Travels (N, T) in m, rotations (N, B, 3, 3), multipliers (N, c) in N or N m, of N rows."""

    travel: Array
    rotation: Array
    multiplier: Array

    def __len__(self) -> int:
        return len(self.travel)

    def take(self, rows: Index | slice) -> State:
        """The state of some rows."""
        return State(*(take_rows(x, rows) for x in (self.travel, self.rotation, self.multiplier)))

    def put(self, rows: Index, other: State) -> State:
        """This state with some rows taken from `other`."""
        out = State(*(x.copy(order="K") for x in (self.travel, self.rotation, self.multiplier)))
        out.write(rows, other)
        return out

    def write(self, rows: Index, other: State) -> None:
        """Overwrite some rows, in place."""
        for mine, theirs in (
            (self.travel, other.travel),
            (self.rotation, other.rotation),
            (self.multiplier, other.multiplier),
        ):
            mine.T[..., rows] = theirs.T


def drawn_state(layout: Layout, slots: Array, rows: int, constraints: int) -> State:
    """The drawing as a state of `rows` rows; frames stand where `slots` (1 or N, S) puts them."""
    travel = np.empty((rows, len(layout.travel_drawn)), order="F")
    rotation = np.empty((rows, *layout.rotations.drawn.shape), order="F")
    travel[:], rotation[:] = layout.travel_drawn, layout.rotations.drawn
    return place_prescribed(layout, slots, State(travel, rotation, np.zeros((rows, constraints))), frames_only=True)


def place_prescribed(
    layout: Layout, slots: Array, state: State, frames_only: bool = False, free: Index | None = None
) -> State:
    """Set what slots prescribe: frames and, unless `frames_only`, the travels and angles not among `free`."""
    rotations = layout.rotations
    rotation = state.rotation.copy(order="K")
    if len(layout.frames):
        turns = exp(frame_vectors(layout, slots))
        rotation[:, layout.frames] = times(turns, rotations.drawn[layout.frames])
    travel = state.travel.copy(order="K")
    if not frames_only:
        unknown = set() if free is None else set(free.tolist())
        for t in np.nonzero(layout.travel_slots >= 0)[0]:
            if int(t) not in unknown:
                travel[:, t] = slots[:, layout.travel_slots[t]]
        for drive in layout.drives:
            r = drive.target[0]
            if drive.kind is DriveKind.ROTATION and int(layout.rotation_dofs[r]) not in unknown:
                rotation[:, r] = exp(slots[:, rotations.slots[r, 0], None] * rotations.axis[r]) @ rotations.drawn[r]
    return replace(state, travel=travel, rotation=rotation)


def advance(system: System, state: State, step: Array, multiplier_scale: float) -> State:
    """The state moved by `step` (N, n + c) of the unknowns and scaled multipliers."""
    layout, n = system.layout, system.unknowns
    full = np.zeros((len(step), layout.n_dof), dtype=step.dtype, order="F")
    full[:, system.free] = step[:, :n]
    travel = state.travel + full[:, : len(layout.travel_slots)]
    rotation = np.asarray(state.rotation, dtype=np.result_type(state.rotation, step)).copy(order="F")
    kind, first = layout.rotations.kind, layout.rotation_dofs
    free = np.nonzero(kind == Turn.FREE)[0]
    if len(free):
        theta = pick(full, first[free, None] + np.arange(3))
        rotation[:, free] = _turn(theta, pick(state.rotation, free))
    axial = np.nonzero(kind == Turn.AXIS)[0]
    if len(axial):
        theta = full[:, first[axial], None] * layout.rotations.axis[axial]
        rotation[:, axial] = _turn(theta, pick(state.rotation, axial))
    return State(travel, rotation, state.multiplier + multiplier_scale * step[:, n:])


def _turn(theta: Array, rotation: Array) -> Array:
    if np.iscomplexobj(theta):  # a complex step: the increment is infinitesimal
        return rotation + times(skew(theta), rotation)
    return times(exp(theta), rotation)


def arm_vectors(layout: Layout, slots: Array, state: State) -> Array:
    """All arms in base axes, (N, A, 3)."""
    return turned_arms(layout, arm_bodies(layout, slots), state)


def turned_arms(layout: Layout, bodies: Array, state: State) -> Array:
    """All arms in base axes, (N, A, 3); `bodies` (1 or N, A, 3): their constant parts in their triads."""
    arms = bodies + layout.arm_block.of(layout.travel_map(rows_last(state.travel)))
    carried, width = layout.carried_arms, layout.width
    if len(carried):
        carriers = pick(state.rotation[..., :width, :width], layout.arms.rotation[carried])
        turned = np.einsum("naij,naj->nai", carriers, pick(arms, carried)[..., :width])
        arms.T[:width, carried] = turned.T
    return np.asarray(arms)


def link_vectors(layout: Layout, arms: Array) -> Array:
    """Vectors from port i to port j, (N, links, 3)."""
    return layout.link_block.of(layout.link_map(rows_last(arms)))


def views(system: System, state: State, arms: Array) -> Array:
    """Triads of ports, links and varying directions of all groups, stacked as `system.view_maps` says (entries, N)."""
    return system.view_maps.views(_moved(state, arms))


def _moved(state: State, arms: Array) -> Array:
    return np.concatenate([rows_last(state.rotation), rows_last(arms)])


def input_jacobian(layout: Layout, links: LinkMap, state: State, arms: Array) -> tuple[Array, Array]:
    """Transposed Jacobian of the inputs with respect to local unknowns (N, E, L, I), and the varying directions
    (N, M, X, 3)."""
    out = np.repeat(links.template[None], len(state), axis=0)
    directions = Block(0, (*links.shape, 3)).of(links.directions(_moved(state, arms)))
    moved = np.einsum("mlx,nmxd->nmld", links.varying, directions[..., : layout.width])
    out[:, links.moving, :, : layout.width] += moved
    return out, directions
