"""Poses for commands that were given none: within reach, around the reference configuration."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.loading.covariates import at_rest
from pkmcal_cli.loading.poses import Poses, RowOrigin
from pkmcal_cli.model.limits import limit_excess
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.tool_motion import DIRECTIONS
from pkmcal_cli.prediction import Rows, predict
from pkmcal_cli.prediction.inverse_kinematics import drive_positions

_WIDE = 0.2  # of the machine's size, and rad: half-width of the largest box that is tried
_SMALLER = 6  # times that the box is halved where too much of it is out of reach
_DRAWN = 1.2  # poses drawn for each that is wanted


def nearby_poses(model: Model, count: int) -> Poses:
    """So many poses, always the same, drawn evenly from the largest box of which nearly all can be reached.

    Within the limits of the drives, with a solution at nominal parameters; fewer where little can be reached, at least
    the reference configuration. A sensor that joins rows joins each to the one before.
    """
    readings = model.reference_readings[None]
    for halved in range(_SMALLER + 1 if model.motion_of(model.posed).freedoms else 0):
        reached = _reached(model, _WIDE / 2**halved, int(_DRAWN * count))
        readings = reached[:count] if len(reached) > len(readings) else readings
        if len(readings) == count:
            break
    rows = at_rest(model, Rows(readings, np.full(readings.shape, np.nan), partner=rows_before(model, len(readings))))
    point = lambda row: RowOrigin(None, 0, f"drawn pose {row + 1}")  # noqa: E731
    return Poses(rows=rows, reachable=np.ones(len(readings), dtype=bool), row_origin=point)


def _reached(model: Model, width: float, drawn: int) -> Array:
    """Readings (n, A) at those of the drawn poses that can be reached."""
    posed = model.posed
    held = model.motion_of(posed).sets[0]
    free = [DIRECTIONS.index(c) for c in held]
    half = width * np.where(np.array(free) < 3, model.length, 1.0)
    poses = np.full((drawn, 6), np.nan)
    poses[:, free] = posed.reference[free] + np.random.default_rng(0).uniform(-half, half, (drawn, len(free)))
    inverse = drive_positions(model, poses, held=held, aimed=posed)
    inside = inverse.reached
    for a, actuator in enumerate(model.actuators):
        inside &= limit_excess(inverse.readings[:, a], actuator.limits) == 0
    readings = np.asarray(inverse.readings[inside])
    if len(readings):
        readings = readings[predict(model, model.nominal, at_rest(model, Rows.at(readings))).solved]
    return readings


def rows_before(model: Model, rows: int) -> NDArray[np.intp] | None:
    """The row before each, where a sensor joins rows; -1 for the first."""
    return np.arange(rows) - 1 if any(sensor.kind.joins for sensor in model.sensors) else None
