"""Forces of a pass, for effects that depend on them in the next one: two fixed passes, no iteration.

The force of a drive, and the pull in a member, is the derivative of the Lagrangian with respect to the slot of its
position, or minus that with respect to its natural length. So its derivatives come from a complex step in that slot.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.equilibrium.assembly import group_view
from pkmcal_cli.equilibrium.derivative import lagrangian_gradient
from pkmcal_cli.equilibrium.kinematics import arm_vectors, views
from pkmcal_cli.model.effect_sites import PlacedEffect, Socket
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction.effects import Displacements
from pkmcal_cli.prediction.forces import drive_forces, force_slot, slot_force_derivative
from pkmcal_cli.prediction.inputs import Reactions
from pkmcal_cli.prediction.rows import Rows
from pkmcal_cli.prediction.solving import Solution
from pkmcal_cli.prediction.stages import Chain


def reactions(
    model: Model,
    solution: Solution,
    effects: Sequence[PlacedEffect],
    rows: Rows,
    chain: Chain | None,
    moved: Displacements,
) -> Reactions:
    """Forces and chords at the sockets of effects, with derivatives where there is a chain; nan in failed rows."""
    sockets = {s.place: s for e in effects for s in e.sockets}
    slots = [_slot(model, s) for s in sockets.values()]
    values, chords = _values(model, solution, list(sockets.values()), slots)
    if chain is None:
        return Reactions(tuple(sockets), values, chords, None, None)
    by_slot = np.zeros((len(rows), len(slots), solution.slots.shape[1]))
    for r, (slot, sign) in enumerate(slots):
        if slot >= 0:
            by_slot[:, r] = sign * slot_force_derivative(model, solution, slot)
    jacobian, by_drive = chain.apply(rows, solution.slots, by_slot, moved)
    return Reactions(tuple(sockets), values, chords, jacobian, by_drive)


def _slot(model: Model, socket: Socket) -> tuple[int, float]:
    """The slot whose derivative of the Lagrangian is the force, and its sign; -1 where the force is commanded."""
    if socket.member[0] >= 0:
        group = model.layout.groups[socket.member[0]]
        return group.rest.start + socket.member[1] * len(group.element.strains), -1.0
    return force_slot(model, socket.actuator)


def _values(
    model: Model, solution: Solution, sockets: Sequence[Socket], slots: Sequence[tuple[int, float]]
) -> tuple[Array, dict[tuple[int, int], Array]]:
    """Forces (N, R), and unit chords (N, 3) of the members among the sockets."""
    system, state = solution.system, solution.state
    gradient = lagrangian_gradient(system, solution.numbers, state, solution.slack)
    forces = drive_forces(model, solution)[0]
    values = np.stack(
        [
            sign * gradient[:, slot] if slot >= 0 else forces[:, socket.actuator]
            for socket, (slot, sign) in zip(sockets, slots, strict=True)
        ],
        axis=1,
    )
    values[solution.failed] = np.nan
    stacked = views(system, state, arm_vectors(model.layout, solution.slots, state))
    return values, dict(_chords(solution, stacked, sockets))


def _chords(solution: Solution, stacked: Array, sockets: Sequence[Socket]) -> Iterator[tuple[tuple[int, int], Array]]:
    for g, e in sorted({s.member for s in sockets if s.member[0] >= 0}):
        chord = group_view(solution.system, g, stacked).delta[:, e]
        yield (g, e), chord / np.sqrt((chord**2).sum(axis=1, keepdims=True))


def joined_reactions(parts: Sequence[Reactions]) -> Reactions:
    """Reactions of consecutive chunks."""
    first = parts[0]

    def join(name: str) -> Array | None:
        pieces = [getattr(p, name) for p in parts]
        return None if pieces[0] is None else np.concatenate(pieces)

    return Reactions(
        first.places,
        np.concatenate([p.values for p in parts]),
        {m: np.concatenate([p.chords[m] for p in parts]) for m in first.chords},
        join("jacobian"),
        join("by_drive"),
    )
