"""Inverse positions: the drive readings that put the tool point at a pose, with no drive strained.

All drives are released and the tool point is held by constraints at a set of independent coordinates; the others
follow, and what the drives' coordinates then are is what they must read. No closed form, so any machine has an inverse.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array, log
from pkmcal_cli.equilibrium.kinematics import State, point_poses, reference_state
from pkmcal_cli.equilibrium.newton import Effort, NewtonOptions, coefficients_of, follow
from pkmcal_cli.equilibrium.released_drives import released_readings
from pkmcal_cli.equilibrium.status import RowStatus
from pkmcal_cli.equilibrium.strains import all_strains
from pkmcal_cli.equilibrium.system import System
from pkmcal_cli.equilibrium.system_numbers import system_numbers
from pkmcal_cli.mechanism.topology import DriveKind, Index
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.tool_motion import DIRECTIONS, AimedPoint
from pkmcal_cli.prediction import Rows, row_chunks
from pkmcal_cli.prediction.stages import BaseCoefficients


@dataclass(frozen=True)
class DrivePositions:
    """Readings (N, A) and poses (N, 6) of the tool point with what follows, nan where `status` (N,) is not SOLVED.

    by_pose (N, A, h): derivatives of the readings by the coordinates that are held; None where not asked for.
    """

    readings: Array
    poses: Array
    status: NDArray[np.int_]
    by_pose: Array | None = None

    @property
    def reached(self) -> NDArray[np.bool_]:
        """Rows with numbers."""
        return np.asarray(self.status == RowStatus.SOLVED)

    def take(self, rows: Index) -> DrivePositions:
        """Some rows."""
        by_pose = None if self.by_pose is None else self.by_pose[rows]
        return DrivePositions(self.readings[rows], self.poses[rows], self.status[rows], by_pose)


def drive_positions(
    model: Model,
    poses: Array,
    values: Array | None = None,
    held: tuple[str, ...] | None = None,
    aimed: AimedPoint | None = None,
    rows: Rows | None = None,
    derivatives: bool = False,
) -> DrivePositions:
    """Give drive readings for poses (N, 6) of the tool point, m and rad from the reference configuration; nan: as it.

    At parameter values (P,), by default the nominal ones. `held`: coordinates that are held there exactly, by default
    the usual ones; the others follow. `aimed`: another point than the tool point. `rows` (N): whose sessions the poses
    belong to; without them, what each session has for itself is nominal. All drives are free, so the redundant ones are
    strain-free.
    """
    if not len(poses):
        return DrivePositions(np.zeros((0, len(model.actuators))), poses, np.zeros(0, dtype=np.int_))
    values, aimed = model.nominal if values is None else values, aimed or model.tool
    if rows is not None and model.sessions:
        base = BaseCoefficients.of(model, values, rows).rows(rows)
    else:
        base = model.topology.coefficients.values(model.by_name(values))[None]
    held = model.motion_of(aimed).sets[0] if held is None else held
    system, differentiated = model.holding(held, aimed), held if derivatives else ()
    parts = [
        _chunk(model, system, aimed, poses[some], coefficients_of(base, np.arange(len(poses))[some]), differentiated)
        for some in row_chunks(system, len(poses))
    ]
    joined = DrivePositions(*(np.concatenate(column) for column in zip(*parts, strict=True)))
    return joined if derivatives else replace(joined, by_pose=None)


def _chunk(
    model: Model, system: System, aimed: AimedPoint, poses: Array, base: Array, by: tuple[str, ...]
) -> tuple[Array, Array, NDArray[np.int_], Array]:
    """The parts of `DrivePositions` of some poses; `by`: coordinates of which derivatives are asked for."""
    topology = model.topology
    begin = _at_poses(model, aimed, model.reference_coefficients, aimed.reference[None])
    target = _at_poses(model, aimed, base, np.where(np.isnan(poses), aimed.reference, poses))
    state = reference_state(topology, begin, len(poses), system.constraints)
    options = NewtonOptions(curved=False)
    state, status = follow(system, begin, target, state=state, length=model.length, options=options, effort=Effort())
    status = np.where(status == RowStatus.SOLVED, status, RowStatus.OUT_OF_REACH)
    readings = _readings(model, system, target, state)
    reached = point_poses(topology, target, state, aimed.point, aimed.rotation)
    slopes = _slopes(model, system, aimed, target, state, by)
    for numbers in (readings, reached, slopes):
        numbers[status != RowStatus.SOLVED] = np.nan
    return readings, reached, status, slopes


def _slopes(
    model: Model, system: System, aimed: AimedPoint, coefficients: Array, state: State, by: tuple[str, ...]
) -> Array:
    """Derivatives (N, A, h) of readings by coordinates that are held."""
    drives = np.arange(len(model.actuators))
    if not by:
        return np.zeros((len(coefficients), len(drives), 0))
    groups = [model.topology.aims[g] for g in aimed.aims]
    places = {name: group.rest.start + k for group in groups for k, name in enumerate(group.element.strains)}
    gains = np.array([a.gain_coefficient for a in model.actuators], dtype=np.intp)
    numbers = system_numbers(system, coefficients)
    slopes = released_readings(system, coefficients, state, numbers, drives, gains)[1]
    return np.asarray(slopes[:, :, [places[name] for name in by]])


def _at_poses(model: Model, aimed: AimedPoint, coefficients: Array, poses: Array) -> Array:
    """Coefficients with the poses (N, 6) of a point set."""
    out: Array = np.empty((len(poses), coefficients.shape[1]), order="F")
    out[:] = coefficients
    for group in (model.topology.aims[g] for g in aimed.aims):
        out[:, group.rest] = poses[:, [DIRECTIONS.index(name) for name in group.element.strains]]
    return out


def _readings(model: Model, system: System, coefficients: Array, state: State) -> Array:
    """Readings (N, A) of released drives at a state: (position - position at reading zero) / gain."""
    strains = all_strains(system, coefficients, state)
    out = np.empty((len(state), len(model.topology.drives)))
    for a, (drive, actuator) in enumerate(zip(model.topology.drives, model.actuators, strict=True)):
        if drive.kind is DriveKind.TRAVEL:
            moved = state.translation[:, drive.target[0]] - coefficients[:, drive.coefficient]
        elif drive.kind is DriveKind.ROTATION:
            r = drive.target[0]
            rotated = log(state.rotation[:, r] @ model.topology.rotations.reference[r].T)
            moved = rotated @ model.topology.rotations.axis[r] - coefficients[:, drive.coefficient]
        else:
            g, e, m = drive.target
            moved = strains[g][:, e, m]
        out[:, a] = moved / coefficients[:, actuator.gain_coefficient]
    return out
