"""Poses as an instrument sees them, and what the drives should read there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import in_machine_frame
from pkmcal_cli.prediction.inverse_kinematics import DIRECTIONS, drive_positions, independent_coordinates


def poses_of(model: Model, readings: Array) -> Array:
    """Poses (N, 6) in m and rad of channel readings (N, C), by the first sensor; nan where it does not read."""
    poses = np.full((len(readings), 6), np.nan)
    for k, channel in enumerate(model.channels):
        first = {"position": model.tcp[0], "orientation": model.tcp[1]}.get(channel.quantity)
        if first is not None and channel.index == first:
            poses[:, channel.component + (3 if channel.quantity == "orientation" else 0)] = readings[:, k]
    return poses


def known_poses(model: Model, poses: Array) -> NDArray[np.intp]:
    """Rows of poses (N, 6) whose independent coordinates are all known."""
    needed = [DIRECTIONS.index(d) for d in independent_coordinates(model)]
    return np.nonzero(~np.isnan(poses[:, needed]).any(axis=1))[0]


def measured_poses(problem: Problem, values: Array) -> tuple[Array, NDArray[np.intp]]:
    """Poses (n, 6) of the rows whose independent coordinates were all measured by the first sensor, and these rows.

    In the machine's frame, as instruments stand at parameter values (P,).
    """
    seen = np.where(problem.measured, problem.readings, np.nan)
    poses = poses_of(problem.model, in_machine_frame(problem.model, values, problem.rows, seen))
    rows = known_poses(problem.model, poses)
    return poses[rows], rows


def loose_drives(problem: Problem) -> NDArray[np.bool_]:
    """Drive readings (N, A) that place the mechanism and have errors."""
    forced = np.array([d.force_controlled for d in problem.model.layout.drives], dtype=bool)
    return np.asarray((problem.drive_sigma > 0) & ~forced)


def errors_at_poses(problem: Problem, values: Array, readings: Array) -> Array:
    """Drive errors (N, A) that put the rows at the poses of channel readings (N, C), at parameter values (P,).

    Nan for drives that have no errors and in rows whose pose is not known.
    """
    out = np.full(problem.rows.readings.shape, np.nan)
    loose = loose_drives(problem)
    poses = poses_of(problem.model, in_machine_frame(problem.model, values, problem.rows, readings))
    rows = known_poses(problem.model, poses) if loose.any() else np.zeros(0, dtype=np.intp)
    if len(rows):
        out[rows] = drive_positions(problem.model, poses[rows], values).readings - problem.rows.readings[rows]
    return np.where(loose, out, np.nan)
