"""Reading stage: from views of the structure to what instruments read, by the laws of their kinds."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pkmcal_cli.base.rotation import Array, exp, log
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.observed import Given, PlacedSensor
from pkmcal_cli.prediction.effects import displacements
from pkmcal_cli.prediction.rows import Rows
from pkmcal_cli.prediction.stages import BaseSlots
from pkmcal_cli.sensors import Sight, derivatives, read
from pkmcal_cli.sensors.tcp import strained


def read_sensors(model: Model, views: Array, slots: Array, by_slot: Array | None) -> tuple[Array, Array | None]:
    """Channels (N, C + H) and their derivatives (N, C + H, S) of views (N, V) and theirs (N, V, S).

    The last H are what sensors that join two rows are given in their row, see `joined.hidden`; their own are nan.
    """
    extra = [(s, k) for s in model.sensors if s.kind.joins for k in range(given_width(s))]
    count = len(model.channels)
    out = np.full((len(views), count + len(extra)), np.nan)
    slopes = None if by_slot is None else np.zeros((len(views), out.shape[1], slots.shape[1]))
    for channel, view in model.direct:
        out[:, channel] = views[:, view]
        if slopes is not None and by_slot is not None:
            slopes[:, channel] = by_slot[:, view]
    start = count
    for sensor in model.sensors:
        if sensor.kind.joins:
            stop = start + given_width(sensor)
            _hand_over(
                sensor, views, slots, by_slot, out[:, start:stop], None if slopes is None else slopes[:, start:stop]
            )
            start = stop
        elif sensor.given:
            seen = {sight: _given(given, views, slots) for sight, given in sensor.given.items()}
            out[:, sensor.channels] = read(sensor.kind, seen)[:, sensor.outputs]
            if slopes is not None and by_slot is not None:
                found = derivatives(sensor.kind, seen, [s for s, g in sensor.given.items() if _known(g)])
                slopes[:, sensor.channels] = _chained(sensor, found, by_slot)
    return out, slopes


def given_width(sensor: PlacedSensor) -> int:
    """How many numbers the law of a sensor is given."""
    return sum(len(g.views) for g in sensor.given.values())


def _known(given: Given) -> bool:
    """Whether anything is given, or all is 0."""
    return bool((given.views >= 0).any() or (given.slots >= 0).any())


def _given(given: Given, views: Array, slots: Array) -> Array:
    """What a law is given (N, w)."""
    out = np.zeros((len(views), len(given.views)))
    seen, set_ = given.views >= 0, given.slots >= 0
    out[:, seen] = views[:, given.views[seen]]
    out[:, set_] = slots[:, given.slots[set_]]
    return out


def _chained(sensor: PlacedSensor, found: Mapping[Sight, Array], by_slot: Array) -> Array:
    """Derivatives (N, c, S) of a sensor's channels by all slots."""
    total = np.zeros((len(by_slot), len(sensor.channels), by_slot.shape[2]))
    for sight, mine_all in found.items():
        given, mine = sensor.given[sight], mine_all[:, sensor.outputs]  # (N, c, w)
        seen, set_ = given.views >= 0, given.slots >= 0
        if seen.any():
            total += mine[:, :, seen] @ by_slot[:, given.views[seen]]
        if set_.any():
            total[:, :, given.slots[set_]] += mine[:, :, set_]
    return total


def _hand_over(
    sensor: PlacedSensor, views: Array, slots: Array, by_slot: Array | None, out: Array, slopes: Array | None
) -> None:
    """Write what a law is given (N, w), and its derivatives (N, w, S)."""
    start = 0
    for given in sensor.given.values():
        stop = start + len(given.views)
        out[:, start:stop] = _given(given, views, slots)
        if slopes is not None and by_slot is not None:
            for k, (view, slot) in enumerate(zip(given.views, given.slots, strict=True), start):
                if view >= 0:
                    slopes[:, k] = by_slot[:, view]
                elif slot >= 0:
                    slopes[:, k, slot] = 1.0
        start = stop


def in_machine_frame(model: Model, values: Array, rows: Rows, readings: Array) -> Array:
    """Readings (N, C) of sensors as they would be in the machine's frame, by what moves their frames at `values` (P,).

    Positions and orientations of which not all components were read become nan where their frame is moved.
    """
    out = readings.copy()
    framed = [s for s in model.sensors if "motion" in s.given and len(s.given)]
    if not framed:
        return out
    slots = BaseSlots.of(model, values).rows(rows)
    displacements(model, values, rows, (), None).apply(slots)
    for sensor in framed:
        motion, scale = sensor.given["motion"].slots, sensor.given.get("scale")
        d = np.where(motion >= 0, slots[:, motion], 0.0)
        size = np.ones(len(slots)) if scale is None else slots[:, scale.slots[0]]
        if d.any() or (size != 1.0).any():
            _move_back(sensor, d, size, readings, out, model.layout.width)
    return out


def _move_back(sensor: PlacedSensor, d: Array, size: Array, readings: Array, out: Array, width: int) -> None:
    """Undo motions (N, 10), and what is read per unit (N,)."""
    turn = exp(d[:, 3:6])
    place = np.zeros((len(readings), 3))
    place[:, :width] = np.nan
    for channel, k in sensor.places:
        place[:, k] = size * readings[:, channel]
    back = np.linalg.solve(turn @ strained(d), (place - d[:, :3])[..., None])[..., 0]
    for channel, k in sensor.places:
        out[:, channel] = back[:, k]
    if sensor.turns:
        turned = np.full((len(readings), 3), 0.0 if width == 2 else np.nan)
        for channel, k in sensor.turns:
            turned[:, k] = readings[:, channel]
        known = np.isfinite(turned).all(axis=1)
        there = log(np.swapaxes(turn, 1, 2) @ exp(np.nan_to_num(turned)))
        for channel, k in sensor.turns:
            out[:, channel] = np.where(known, there[:, k], np.nan)
