"""Sensors that join two rows of the table read a distance between the places of one point in both: |p_2 - p_1|.

Rows are solved in chunks, and a row's partner may be in another one; so chunks hand over the known values, and the
observation equation is evaluated when all are there.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.observed import PlacedSensor
from pkmcal_cli.prediction.observation import known_width
from pkmcal_cli.prediction.rows import Prediction
from pkmcal_cli.sensors import Variable, derivatives, read

_OTHERS: Variable = "other"


def join_rows(model: Model, prediction: Prediction, partner: NDArray[np.intp]) -> Prediction:
    """Fill in the channels of a prediction that join rows, and drop their known values.

    partner (N,): number of the other row, -1 without; channels that join stay nan there, with derivatives 0.
    """
    joining = [s for s in model.sensors if s.kind.joins]
    if not joining:
        return prediction
    count, start = len(model.channels), len(model.channels)
    values = prediction.values[:, :count]
    jacobian = None if prediction.jacobian is None else prediction.jacobian[:, :count]
    by_drive = None if prediction.by_drive is None else prediction.by_drive[:, :count]
    by_partner = None if by_drive is None else np.zeros_like(by_drive)
    rows = np.nonzero((partner >= 0) & prediction.solved)[0]
    rows = rows[prediction.solved[partner[rows]]]
    for sensor in joining:
        seen, own_columns = _seen(sensor, prediction.values[rows], prediction.values[partner[rows]], start)
        values[rows[:, None], sensor.channels] = read(sensor.kind, seen)[:, sensor.outputs]
        if jacobian is not None or by_drive is not None:
            slopes = derivatives(sensor.kind, seen, list(sensor.known))
            own_slopes = np.concatenate([slopes[s] if s != _OTHERS else 0 * slopes[s] for s in sensor.known], axis=2)
            own_slopes, of_partner = own_slopes[:, sensor.outputs], slopes[_OTHERS][:, sensor.outputs]
            for full, out in ((prediction.jacobian, jacobian), (prediction.by_drive, by_drive)):
                if full is not None and out is not None:
                    out[:, sensor.channels] = 0.0
                    out[rows[:, None], sensor.channels] = own_slopes @ full[rows][:, own_columns]
            places = own_columns[_part(sensor, "place")]
            if prediction.jacobian is not None and jacobian is not None:
                jacobian[rows[:, None], sensor.channels] += of_partner @ prediction.jacobian[partner[rows]][:, places]
            if prediction.by_drive is not None and by_partner is not None:
                by_partner[rows[:, None], sensor.channels] = of_partner @ prediction.by_drive[partner[rows]][:, places]
        start += known_width(sensor)
    return replace(prediction, values=values, jacobian=jacobian, by_drive=by_drive, by_partner=by_partner)


def _part(sensor: PlacedSensor, variable: Variable) -> slice:
    """Columns of a variable among the known values."""
    start = 0
    for name, known in sensor.known.items():
        if name == variable:
            return slice(start, start + len(known.observed))
        start += len(known.observed)
    raise KeyError(variable)


def _seen(
    sensor: PlacedSensor, here: Array, there: Array, start: int
) -> tuple[dict[Variable, Array], NDArray[np.intp]]:
    """The known values, the place in the other row among them; columns of those of this row."""
    columns = np.arange(start, start + known_width(sensor))
    out: dict[Variable, Array] = {name: here[:, columns[_part(sensor, name)]] for name in sensor.known}
    out[_OTHERS] = there[:, columns[_part(sensor, "place")]]
    return out, columns
