"""From the machine's frame to what instruments read: pose, scale and shear of their frames, as effects set them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal_cli.layout import GROUND
from pkmcal_cli.model import Channel, Model
from pkmcal_cli.prediction.effects import Displacement, Displacements, displacements
from pkmcal_cli.prediction.rows import Rows
from pkmcal_cli.rotation import Array, exp, left_jacobian, log, log_jacobian

_STEP = 1e-40


@dataclass(frozen=True)
class FrameReadings:
    """The channels that must be read so that frames can be moved: all of the model, then full poses of sensors.

    `starts`: by sensor that has a moved frame, the first of its coordinates (two in a plane); three of orientation
    follow where it reads any.
    """

    channels: tuple[Channel, ...]
    starts: dict[int, int]


def frame_channels(model: Model, moved: Displacements) -> FrameReadings:
    """What to read for the sensors whose frames are displaced."""
    channels = list(model.channels)
    starts: dict[int, int] = {}
    for index in sorted({d.socket.sensor for d in moved.frames}):
        sensor = model.sensors[index]
        starts[index] = len(channels)
        channels += [Channel("", "position", sensor.point, k, np.nan, "m", "length") for k in range(model.layout.width)]
        if sensor.turns and sensor.rotation != GROUND:
            channels += [Channel("", "orientation", sensor.rotation, k, np.nan, "rad", "angle") for k in range(3)]
    return FrameReadings(tuple(channels), starts)


def move_frames(
    model: Model,
    moved: Displacements,
    read: FrameReadings,
    values: Array,
    by_drive: Array | None,
    jacobian: Array | None,
) -> tuple[Array, Array | None, Array | None]:
    """Readings (N, C) in the instruments' frames, and their derivatives by drive reading and by parameter.

    `values` (N, C + more), `by_drive` (N, C + more, A) and `jacobian` (N, C + more, P') are those of `read.channels`.
    """
    count, width = len(model.channels), model.layout.width
    out = values[:, :count].copy()
    drive_out = None if by_drive is None else by_drive[:, :count].copy()
    jacobian_out = None if jacobian is None else jacobian[:, :count].copy()
    for index, start in read.starts.items():
        sensor = model.sensors[index]
        mine = [d for d in moved.frames if d.socket.sensor == index]
        d = np.sum([each.d for each in mine], axis=0)  # (N, 10)
        turned = start + width
        seen = np.zeros((len(values), 3))
        seen[:, :width] = values[:, start:turned]
        place, by_place, by_d = _moved_place(seen, d)
        for channel, k in sensor.places:
            out[:, channel] = place[:, k]
            _chain(channel, by_place[:, k, :width], start, by_drive, drive_out)
            _chain(channel, by_place[:, k, :width], start, jacobian, jacobian_out)
            _by_parameter(channel, by_d[:, k], mine, jacobian_out)
        if sensor.turns:
            turn, by_turn, by_r = _moved_turn(values[:, turned : turned + 3], d[:, 3:6])
            for channel, k in sensor.turns:
                out[:, channel] = turn[:, k]
                _chain(channel, by_turn[:, k], turned, by_drive, drive_out)
                _chain(channel, by_turn[:, k], turned, jacobian, jacobian_out)
                wide = np.zeros((len(d), 10))
                wide[:, 3:6] = by_r[:, k]
                _by_parameter(channel, wide, mine, jacobian_out)
    return out, drive_out, jacobian_out


def _chain(channel: int, row: Array, start: int, full: Array | None, out: Array | None) -> None:
    """Replace a channel's derivatives by `row` (N, n) times those of n full readings."""
    if full is not None and out is not None:
        out[:, channel] = (row[:, None, :] @ full[:, start : start + row.shape[1]])[:, 0]


def _by_parameter(channel: int, row: Array, mine: list[Displacement], jacobian: Array | None) -> None:
    """Add what the displacements' parameters do to a channel; `row` (N, 10)."""
    for each in mine if jacobian is not None else ():
        if len(each.columns):
            jacobian[:, channel, each.columns] += (row[:, None, :] @ each.by_parameter)[:, 0]  # type: ignore[index]


def _moved_place(place: Array, d: Array) -> tuple[Array, Array, Array]:
    """Places (N, 3) moved by d (N, 10), and their derivatives by place (N, 3, 3) and by d (N, 3, 10)."""
    by_place = exp(d[:, 3:6]) @ _strain(d)
    by_d = np.empty((len(d), 3, 10))
    for k in range(10):
        stepped = d.astype(complex)
        stepped[:, k] += 1j * _STEP
        by_d[..., k] = np.imag(_apply(place, stepped)) / _STEP
    return _apply(place, d), by_place, by_d


def _apply(place: Array, d: Array) -> Array:
    return np.asarray(d[:, :3] + np.einsum("nij,njk,nk->ni", exp(d[:, 3:6]), _strain(d), place))


def _strain(d: Array) -> Array:
    """I plus scale and shear (N, 3, 3): x += xy y + xz z, y += yz z."""
    out = np.zeros((len(d), 3, 3), dtype=d.dtype)
    for k in range(3):
        out[:, k, k] = 1.0 + d[:, 6]
    out[:, 0, 1], out[:, 0, 2], out[:, 1, 2] = d[:, 7], d[:, 8], d[:, 9]
    return out


def _moved_turn(turn: Array, r: Array) -> tuple[Array, Array, Array]:
    """Rotation vectors (N, 3) turned by r (N, 3), and their derivatives by turn and by r (N, 3, 3)."""
    made = log(exp(r) @ exp(turn))
    back = log_jacobian(made)
    return made, back @ exp(r) @ left_jacobian(turn), back @ left_jacobian(r)


def in_machine_frame(model: Model, values: Array, rows: Rows, readings: Array) -> Array:
    """Readings (N, C) of sensors as they would be in the machine's frame, by what moves their frames at `values` (P,).

    Positions and orientations of which not all components were read become nan where their frame is moved.
    """
    out, width = readings.copy(), model.layout.width
    moved = displacements(model, values, rows, (), None).frames
    for index in sorted({d.socket.sensor for d in moved}):
        sensor = model.sensors[index]
        d = np.sum([each.d for each in moved if each.socket.sensor == index], axis=0)
        turn = exp(d[:, 3:6])
        if not d.any():
            continue
        place = np.zeros((len(readings), 3))
        place[:, :width] = np.nan
        for channel, k in sensor.places:
            place[:, k] = readings[:, channel]
        back = np.linalg.solve(turn @ _strain(d), (place - d[:, :3])[..., None])[..., 0]
        for channel, k in sensor.places:
            out[:, channel] = back[:, k]
        if sensor.turns:
            turned = np.full((len(readings), 3), 0.0 if model.layout.planar else np.nan)
            for channel, k in sensor.turns:
                turned[:, k] = readings[:, channel]
            known = np.isfinite(turned).all(axis=1)
            there = log(np.swapaxes(turn, 1, 2) @ exp(np.nan_to_num(turned)))
            for channel, k in sensor.turns:
                out[:, channel] = np.where(known, there[:, k], np.nan)
    return out

