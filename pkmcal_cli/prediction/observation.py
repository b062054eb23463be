"""The reading stage turns observed quantities of the structure into readings, by the observation equations z = h(v, c).

v: observed quantities, c: known values of the sensor. So dz/dc = h_v v_c + h_c; each h is in `sensors/`.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pkmcal_cli.base.rotation import Array, exp, log
from pkmcal_cli.mechanism.topology import Index
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.observed import KnownValues, PlacedSensor
from pkmcal_cli.prediction.displacements import displacements
from pkmcal_cli.prediction.rows import Rows
from pkmcal_cli.prediction.stages import BaseCoefficients
from pkmcal_cli.prediction.turns import outputs_of, rotates_in_space, tell_as_read
from pkmcal_cli.sensors import Variable, derivatives, read
from pkmcal_cli.sensors.tcp import strained


def read_sensors(
    model: Model, observed: Array, coefficients: Array, by_coefficient: Array | None, measured: Array | None = None
) -> tuple[Array, Array | None]:
    """Read channels (N, C + H) with derivatives (N, C + H, S) from observed quantities (N, V) and theirs (N, V, S).

    The last H are the known values of sensors that join two rows, see `joined.hidden`; their own channels are nan.
    measured (N, C): which of the rotation vectors of one rotation is predicted, see `Rows`.
    """
    extra = [(s, k) for s in model.sensors if s.kind.joins for k in range(known_width(s))]
    count = len(model.channels)
    out = np.full((len(observed), count + len(extra)), np.nan)
    shape = len(observed), out.shape[1], coefficients.shape[1]
    slopes: Array | None = None if by_coefficient is None else np.zeros(shape, order="F")
    for channel, quantity in model.direct:
        out[:, channel] = observed[:, quantity]
        if slopes is not None and by_coefficient is not None:
            slopes[:, channel] = by_coefficient[:, quantity]
    start = count
    for sensor in model.sensors:
        if sensor.kind.joins:
            stop = start + known_width(sensor)
            target = out[:, start:stop], None if slopes is None else slopes[:, start:stop]
            _hand_over(sensor, observed, coefficients, by_coefficient, target)
            start = stop
        elif sensor.known or rotates_in_space(model, sensor):
            readings_and_slopes = out[:, sensor.channels], None if slopes is None else slopes[:, sensor.channels]
            if sensor.known:
                readings_and_slopes = _of_equation(model, sensor, observed, coefficients, by_coefficient)
            if measured is not None and rotates_in_space(model, sensor):
                tell_as_read(sensor, *readings_and_slopes, measured)
            out[:, sensor.channels] = readings_and_slopes[0][:, : len(sensor.channels)]
            if slopes is not None and readings_and_slopes[1] is not None:
                slopes[:, sensor.channels] = readings_and_slopes[1][:, : len(sensor.channels)]
    return out, slopes


def _of_equation(
    model: Model, sensor: PlacedSensor, observed: Array, coefficients: Array, by_coefficient: Array | None
) -> tuple[Array, Array | None]:
    """Readings (N, K) of a sensor by its observation equation, derivatives (N, K, S); see `turns.outputs_of`."""
    seen = {variable: _values(known, observed, coefficients) for variable, known in sensor.known.items()}
    outputs = outputs_of(model, sensor)
    readings = read(sensor.kind, seen)[:, outputs]
    if by_coefficient is None:
        return readings, None
    slopes = derivatives(sensor.kind, seen, [s for s, g in sensor.known.items() if _any_known(g)])
    return readings, _chained(sensor, outputs, slopes, by_coefficient)


def known_width(sensor: PlacedSensor) -> int:
    """Count the known values of a sensor's observation equation."""
    return sum(len(g.observed) for g in sensor.known.values())


def _any_known(known: KnownValues) -> bool:
    """Whether any value comes from somewhere, or all are 0."""
    return bool((known.observed >= 0).any() or (known.coefficients >= 0).any())


def _values(known: KnownValues, observed: Array, coefficients: Array) -> Array:
    """The known values (N, w) of one variable."""
    out = np.zeros((len(observed), len(known.observed)))
    seen, set_ = known.observed >= 0, known.coefficients >= 0
    out[:, seen] = observed[:, known.observed[seen]]
    out[:, set_] = coefficients[:, known.coefficients[set_]]
    return out


def _chained(sensor: PlacedSensor, outputs: Index, slopes: Mapping[Variable, Array], by_coefficient: Array) -> Array:
    """Derivatives (N, c, S) of some of the readings of a sensor's kind by all coefficients."""
    total = np.zeros((len(by_coefficient), len(outputs), by_coefficient.shape[2]))
    for variable, all_outputs in slopes.items():
        known, derivative = sensor.known[variable], all_outputs[:, outputs]  # (N, c, w)
        seen, set_ = known.observed >= 0, known.coefficients >= 0
        if seen.any():
            total += derivative[:, :, seen] @ by_coefficient[:, known.observed[seen]]
        if set_.any():
            total[:, :, known.coefficients[set_]] += derivative[:, :, set_]
    return total


def _hand_over(
    sensor: PlacedSensor,
    observed: Array,
    coefficients: Array,
    by_coefficient: Array | None,
    target: tuple[Array, Array | None],
) -> None:
    """Write the known values of an observation equation (N, w), and their derivatives (N, w, S)."""
    start, (out, slopes) = 0, target
    for known in sensor.known.values():
        stop = start + len(known.observed)
        out[:, start:stop] = _values(known, observed, coefficients)
        if slopes is not None and by_coefficient is not None:
            for k, (quantity, coefficient) in enumerate(zip(known.observed, known.coefficients, strict=True), start):
                if quantity >= 0:
                    slopes[:, k] = by_coefficient[:, quantity]
                elif coefficient >= 0:
                    slopes[:, k, coefficient] = 1.0
        start = stop


def in_machine_frame(model: Model, values: Array, rows: Rows, readings: Array) -> Array:
    """Give readings (N, C) of sensors as they are in the machine's frame, by what moves their frames at `values` (P,).

    Positions and orientations of which not all components were read become nan where their frame is moved.
    """
    out = readings.copy()
    framed = [s for s in model.sensors if s.kind.reads_coordinates and "motion" in s.known]
    if not framed:
        return out
    coefficients = BaseCoefficients.of(model, values, rows).rows(rows)
    displacements(model, values, rows, (), None).apply(coefficients)
    for sensor in framed:
        motion, scale = sensor.known["motion"].coefficients, sensor.known.get("scale")
        d = coefficients[:, motion]
        size = np.ones(len(coefficients)) if scale is None else coefficients[:, scale.coefficients[0]]
        if d.any() or (size != 1.0).any():
            _move_back(sensor, d, size, readings, out, model.topology.width)
    return out


def _move_back(sensor: PlacedSensor, d: Array, size: Array, readings: Array, out: Array, width: int) -> None:
    """Undo motions (N, 10), and what is read per unit (N,)."""
    rotation = exp(d[:, 3:6])
    position = np.zeros((len(readings), 3))
    position[:, :width] = np.nan
    for channel, k in sensor.places:
        position[:, k] = size * readings[:, channel]
    back = np.linalg.solve(rotation @ strained(d), (position - d[:, :3])[..., None])[..., 0]
    for channel, k in sensor.places:
        out[:, channel] = back[:, k]
    if sensor.rotates:
        rotated = np.full((len(readings), 3), 0.0 if width == 2 else np.nan)
        for channel, k in sensor.rotates:
            rotated[:, k] = readings[:, channel]
        known = np.isfinite(rotated).all(axis=1)
        there = log(np.swapaxes(rotation, 1, 2) @ exp(np.nan_to_num(rotated)))
        for channel, k in sensor.rotates:
            out[:, channel] = np.where(known, there[:, k], np.nan)
