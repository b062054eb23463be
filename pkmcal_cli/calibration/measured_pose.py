"""Poses as an instrument sees them, and what the drives should read there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.model.tool_motion import DIRECTIONS
from pkmcal_cli.prediction import in_machine_frame
from pkmcal_cli.prediction.inverse_kinematics import drive_positions
from pkmcal_cli.units.measurands import Measurand


@dataclass(frozen=True)
class MeasuredPoses:
    """Poses (n, 6), m and rad, where the first `tcp` sensor measures, of the rows (n,) in which they say where the
    mechanism is: all coordinates `held` are known.
    """

    problem: Problem
    poses: Array
    rows: NDArray[np.intp]
    held: tuple[str, ...]

    def drive_readings(self, values: Array) -> Array:
        """What the drives should read there (n, A), at parameter values (P,), each row with those of its session."""
        model, rows = self.problem.model, self.problem.rows.take(self.rows)
        return drive_positions(model, self.poses, values, self.held, model.measured, rows).readings


def measured_poses(problem: Problem, values: Array) -> MeasuredPoses:
    """Poses that were measured, in the machine's frame, as instruments stand at parameter values (P,)."""
    return poses_of(problem, values, np.where(problem.measured, problem.readings, np.nan))


def poses_of(problem: Problem, values: Array, readings: Array) -> MeasuredPoses:
    """Poses of channel readings (N, C), nan where not read; instruments stand as parameter values (P,) say."""
    model, framed = problem.model, in_machine_frame(problem.model, values, problem.rows, readings)
    poses = np.full((len(readings), len(DIRECTIONS)), np.nan)
    for k, channel in enumerate(model.channels):
        at = {Measurand.POSITION: model.measured.point, Measurand.ORIENTATION: model.measured.rotation}
        if channel.measurand in at and channel.index == at[channel.measurand]:
            poses[:, channel.component + (3 if channel.measurand is Measurand.ORIENTATION else 0)] = framed[:, k]
    motion, known = model.motion_of(model.measured), ~np.isnan(poses)
    held = motion.out_of([c for c, some in zip(DIRECTIONS, known.any(axis=0), strict=True) if some])
    if held is None or motion.shown < motion.freedoms:
        return MeasuredPoses(problem, poses[:0], np.zeros(0, dtype=np.intp), ())
    rows = np.nonzero(known[:, [DIRECTIONS.index(c) for c in held]].all(axis=1))[0]
    return MeasuredPoses(problem, poses[rows], rows, held)


def uncertain_drives(problem: Problem) -> NDArray[np.bool_]:
    """Drive readings (N, A) that place the mechanism and have errors."""
    return np.asarray(problem.drive_sigma > 0)


def errors_at_poses(problem: Problem, values: Array, readings: Array) -> Array:
    """Drive errors (N, A) that put the rows at the poses of channel readings (N, C), at parameter values (P,).

    Nan for drives that have no errors and in rows whose pose is not known.
    """
    out = np.full(problem.rows.readings.shape, np.nan)
    uncertain = uncertain_drives(problem)
    if uncertain.any():
        measured = poses_of(problem, values, readings)
        if len(measured.rows):
            out[measured.rows] = measured.drive_readings(values) - problem.rows.readings[measured.rows]
    return np.where(uncertain, out, np.nan)
