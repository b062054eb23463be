"""Inverse positions: the drive readings that put the TCP at a pose, with no drive strained."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array, log
from pkmcal_cli.equilibrium.assembly import balance
from pkmcal_cli.equilibrium.kinematics import State, drawn_state
from pkmcal_cli.equilibrium.newton import Effort, NewtonOptions, follow
from pkmcal_cli.equilibrium.status import RowStatus
from pkmcal_cli.equilibrium.system import System
from pkmcal_cli.mechanism.topology import DriveKind
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import row_chunks

DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")


@dataclass(frozen=True)
class DrivePositions:
    """Readings (N, A), nan where `status` (N,) is not SOLVED, and the coordinates that were aimed at."""

    readings: Array
    status: NDArray[np.int_]
    aimed: tuple[str, ...]


def independent_coordinates(model: Model) -> tuple[str, ...]:
    """TCP coordinates that the mechanism moves independently, in the order x ... rz."""
    return model.independent_coordinates


def drive_positions(model: Model, poses: Array, values: Array | None = None) -> DrivePositions:
    """Drive readings for TCP poses (N, 6) in m and rad (rotation vector against the drawing; nan: as drawn).

    At parameter values (P,), by default the nominal ones. All drives are free, so the redundant ones are
    strain-free; each takes up what the pose asks.
    """
    base = model.layout.slots.values(model.by_name(model.nominal if values is None else values))
    system = model.inverse
    parts = [_chunk(model, system, poses[rows], base) for rows in row_chunks(system, len(poses))]
    readings, status = (np.concatenate(column) for column in zip(*parts, strict=True))
    return DrivePositions(readings, status, model.independent_coordinates)


def _chunk(model: Model, system: System, poses: Array, base: Array) -> tuple[Array, NDArray[np.int_]]:
    layout = model.layout
    begin = _aimed(model, model.drawn_slots, model.tcp_drawn[None])
    target = _aimed(model, base[None], np.where(np.isnan(poses), model.tcp_drawn, poses))
    state = drawn_state(layout, begin, len(poses), system.constraints)
    options = NewtonOptions(curved=False)
    state, status, _ = follow(system, begin, target, state=state, length=model.length, options=options, effort=Effort())
    status = np.where(status == RowStatus.SOLVED, status, RowStatus.OUT_OF_REACH)
    readings = _readings(model, system, target, state)
    readings[status != RowStatus.SOLVED] = np.nan
    return readings, status


def _aimed(model: Model, slots: Array, poses: Array) -> Array:
    """Slots with the TCP's pose (N, 6) set."""
    out: Array = np.empty((len(poses), slots.shape[1]), order="F")
    out[:] = slots
    place, *turn = model.layout.aims
    count = len(place.element.strains)
    out[:, place.rest] = poses[:, :count]
    if turn:
        frame = int(turn[0].rotation[0, 0])
        out[:, model.layout.rotations.slots[frame]] = poses[:, 3:]
    return out


def _readings(model: Model, system: System, slots: Array, state: State) -> Array:
    """Readings (N, A) of released drives at a state: (position - position at reading zero) / gain."""
    strains = balance(system, slots, state, 1.0, tangent=False).strains
    out = np.empty((len(state), len(model.layout.drives)))
    for a, (drive, actuator) in enumerate(zip(model.layout.drives, model.actuators, strict=True)):
        if drive.kind is DriveKind.TRAVEL:
            moved = state.travel[:, drive.target[0]] - slots[:, drive.slot]
        elif drive.kind is DriveKind.ROTATION:
            r = drive.target[0]
            turned = log(state.rotation[:, r] @ model.layout.rotations.drawn[r].T)
            moved = turned @ model.layout.rotations.axis[r] - slots[:, drive.slot]
        else:
            g, e, m = drive.target
            moved = strains[g][:, e, m]
        out[:, a] = moved / slots[:, actuator.gain_slot]
    return out
