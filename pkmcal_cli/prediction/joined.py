"""Sensors that join two rows of the table: a distance between the places of one point in both."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.observed import PlacedSensor
from pkmcal_cli.prediction.laws import given_width
from pkmcal_cli.prediction.rows import Prediction
from pkmcal_cli.sensors import Sight, derivatives, read

_OTHERS: Sight = "other"


def join_rows(model: Model, found: Prediction, partner: NDArray[np.intp]) -> Prediction:
    """The prediction with the channels that join rows filled in, and without what their laws were given.

    partner (N,): number of the other row, -1 without; channels that join stay nan there, with derivatives 0.
    """
    joining = [s for s in model.sensors if s.kind.joins]
    if not joining:
        return found
    count, start = len(model.channels), len(model.channels)
    values = found.values[:, :count]
    jacobian = None if found.jacobian is None else found.jacobian[:, :count]
    by_drive = None if found.by_drive is None else found.by_drive[:, :count]
    by_partner = None if by_drive is None else np.zeros_like(by_drive)
    rows = np.nonzero((partner >= 0) & found.solved)[0]
    rows = rows[found.solved[partner[rows]]]
    for sensor in joining:
        seen, mine = _seen(sensor, found.values[rows], found.values[partner[rows]], start)
        values[rows[:, None], sensor.channels] = read(sensor.kind, seen)[:, sensor.outputs]
        if jacobian is not None or by_drive is not None:
            slopes = derivatives(sensor.kind, seen, list(sensor.given))
            own = np.concatenate([slopes[s] if s != _OTHERS else 0 * slopes[s] for s in sensor.given], axis=2)
            own, theirs = own[:, sensor.outputs], slopes[_OTHERS][:, sensor.outputs]
            for full, out in ((found.jacobian, jacobian), (found.by_drive, by_drive)):
                if full is not None and out is not None:
                    out[:, sensor.channels] = 0.0
                    out[rows[:, None], sensor.channels] = own @ full[rows][:, mine]
            places = mine[_part(sensor, "place")]
            if found.jacobian is not None and jacobian is not None:
                jacobian[rows[:, None], sensor.channels] += theirs @ found.jacobian[partner[rows]][:, places]
            if found.by_drive is not None and by_partner is not None:
                by_partner[rows[:, None], sensor.channels] = theirs @ found.by_drive[partner[rows]][:, places]
        start += given_width(sensor)
    return replace(found, values=values, jacobian=jacobian, by_drive=by_drive, by_partner=by_partner)


def _part(sensor: PlacedSensor, sight: Sight) -> slice:
    """Where a quantity stands among all that the law is given."""
    start = 0
    for name, given in sensor.given.items():
        if name == sight:
            return slice(start, start + len(given.views))
        start += len(given.views)
    raise KeyError(sight)


def _seen(sensor: PlacedSensor, here: Array, there: Array, start: int) -> tuple[dict[Sight, Array], NDArray[np.intp]]:
    """What the law is given, the place in the other row among it; columns of what this row gives."""
    columns = np.arange(start, start + given_width(sensor))
    out: dict[Sight, Array] = {name: here[:, columns[_part(sensor, name)]] for name in sensor.given}
    out[_OTHERS] = there[:, columns[_part(sensor, "place")]]
    return out, columns
