"""Commands at which sensors read what they are known to read: the control moves until a probe touches.

The TCP moves the shortest way on which the readings change, with all drives together, as the nominal inverse model has
it. Newton's method, with exact derivatives of the readings by the drives and of the drives by the pose.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.model.commanded import forced
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.tool_channels import tcp_model
from pkmcal_cli.model.tool_motion import DIRECTIONS
from pkmcal_cli.prediction.inverse_kinematics import drive_positions
from pkmcal_cli.prediction.pipeline import predict
from pkmcal_cli.prediction.rows import Request, Rows

_STEPS, _RENEWED = 15, 3  # steps of Newton's method, of which the first have new slopes of the drives
_LENGTH = 100.0  # sizes of the machine that a rotation of 1 rad counts as: translations come first
_LONGEST = 0.25  # of the machine's size: a step
_NEAR, _EXACT = 1e-9, 1e-12  # m: a touch is reached; no further step is made


def tcp_places(model: Model, values: Array, rows: Rows) -> Array:
    """Predict TCP coordinates (N, 6), m, and rotation vectors in the sense of the reference configuration, rad."""
    bare = tcp_model(model).with_options(())
    places = predict(bare, values, rows).values
    out = np.zeros((len(rows), 6))
    for k, channel in enumerate(bare.channels):
        out[:, DIRECTIONS.index(channel.name)] = places[:, k]
    return out


def touching(
    model: Model, values: Array, rows: Rows, trigger: Array, shift: Array | None = None
) -> tuple[Rows, NDArray[np.bool_]]:
    """Find rows whose commands make channels read `trigger` (N, C), nan where that is open; and which do (N,).

    At parameter values (P,), by the exact method. `shift` (N, A): of the drives when they read their commands.
    """
    done = np.ones(len(rows), dtype=bool)
    chosen = np.nonzero(~np.isnan(trigger).all(axis=1))[0]
    if not len(chosen):
        return rows, done
    moved = np.zeros(rows.readings.shape) if shift is None else shift
    readings = rows.readings.copy()
    readings[chosen], done[chosen] = _touching_readings(
        model, values, rows.take(chosen), trigger[chosen], moved[chosen]
    )
    return replace(rows, readings=readings), done


def _touching_readings(
    model: Model, values: Array, rows: Rows, trigger: Array, shift: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """Commands (n, A) of rows that all touch, and which rows do."""
    columns = np.nonzero(~np.isnan(trigger).all(axis=0))[0]
    known, target = ~np.isnan(trigger[:, columns]), np.nan_to_num(trigger[:, columns])
    free = [DIRECTIONS.index(c) for c in model.independent_coordinates]
    size = np.where(np.array(free) < 3, 1.0, 1 / (_LENGTH * model.length))
    pose = np.full((len(rows), 6), np.nan)
    pose[:, free] = tcp_places(model, model.nominal, rows)[:, free]
    begin, readings = drive_positions(model, pose).readings, rows.readings
    slopes, error = np.zeros(()), np.zeros(())
    for step in range(_STEPS):
        there = predict(model, values, replace(rows, readings=readings + shift), Request(by_drive=True))
        error = np.where(known, target - there.values[:, columns], 0.0)
        if step == _STEPS - 1 or not (np.abs(error) > _EXACT).any():
            break
        if step < _RENEWED:
            slopes = np.where(forced(model)[:, None], 0.0, _drives_by_place(model, pose))
        assert there.by_drive is not None
        by_place = np.where(known[..., None], there.by_drive[:, columns] @ slopes, 0.0) * size
        pose[:, free] += _limited(_least(by_place, error) * size, model.length)
        readings = rows.readings + drive_positions(model, pose).readings - begin
    return readings, np.asarray((np.abs(error) < _NEAR).all(axis=1))


def rise(model: Model, values: Array, rows: Rows, touched: NDArray[np.bool_]) -> Array:
    """Derivatives (N, 6) by the tool point's coordinates of what channels read that touch (N, C), all together.

    The tool point leaves what it touches where these rise; 0 where nothing touches, and in coordinates that follow.
    """
    slopes, free = np.zeros((len(rows), 6)), [DIRECTIONS.index(c) for c in model.independent_coordinates]
    if touched.any():
        there = predict(model, values, rows, Request(by_drive=True))
        assert there.by_drive is not None
        by_drive = np.where(touched[..., None], there.by_drive, 0.0).sum(axis=1)  # (N, A)
        pose = np.full((len(rows), 6), np.nan)
        pose[:, free] = tcp_places(model, model.nominal, rows)[:, free]
        by_place = np.where(forced(model)[:, None], 0.0, _drives_by_place(model, pose))
        slopes[:, free] = np.nan_to_num(by_drive[:, None] @ by_place)[:, 0]
    return slopes


def _least(slopes: Array, error: Array) -> Array:
    """The shortest steps (n, d) that remove errors (n, m)."""
    return np.asarray((np.linalg.pinv(np.nan_to_num(slopes)) @ np.nan_to_num(error)[..., None])[..., 0])


def _limited(step: Array, length: float) -> Array:
    """Steps (n, d), none too long."""
    size = np.sqrt((step**2).sum(axis=1, keepdims=True))
    return np.asarray(step * np.minimum(1.0, _LONGEST * length / np.maximum(size, 1e-300)))


def _drives_by_place(model: Model, pose: Array) -> Array:
    """Derivatives (n, A, d) of the drives' readings by the free coordinates at places (n, 6)."""
    by_pose = drive_positions(model, pose, derivatives=True).by_pose
    assert by_pose is not None
    return np.nan_to_num(by_pose)
