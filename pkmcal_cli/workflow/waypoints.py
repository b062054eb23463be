"""Ways between rows of a plan: drives that move straight, all at once, would strain a redundant machine on a long way.

So the tool point moves straight, and set values follow the nominal inverse model in steps so short that drives which
move straight from one to the next stay within a millionth of the machine's size of it.
"""

from __future__ import annotations

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import Rows
from pkmcal_cli.prediction.inverse_kinematics import drive_positions
from pkmcal_cli.prediction.touching import tcp_places

GAP = 1e-6  # of the machine's size: by which drives that move straight may be apart on the way
_MOST = 1000  # points of a way
_LOOKED_AT = np.linspace(0.0, 1.0, 9)[1:-1]


def waypoints(model: Model, begin: Array, end: Array) -> list[Array]:
    """Set values (k, A) between begin (N, A) and end (N, A), one array a way; none where any way will do.

    A way that passes points that the machine does not reach has none either.
    """
    if not model.overdetermined:
        return [begin[:0]] * len(begin)
    first, last = (tcp_places(model, model.nominal, Rows.at(ends)) for ends in (begin, end))
    apart = np.zeros(len(begin))
    for share in _LOOKED_AT:
        there = _inverse(model, first + share * (last - first))
        straight = begin + share * (end - begin)
        apart = np.maximum(apart, np.abs((there - straight) * model.gains).max(axis=1))
    steps = np.ceil(np.sqrt(np.nan_to_num(apart) / (GAP * model.length)) + 1e-9)
    return [
        _between(model, first[k], last[k], int(min(steps[k], _MOST))) if np.isfinite(apart[k]) else begin[:0]
        for k in range(len(begin))
    ]


def _between(model: Model, first: Array, last: Array, steps: int) -> Array:
    shares = np.linspace(0.0, 1.0, max(steps, 1) + 1)[1:-1, None]
    return _inverse(model, first + shares * (last - first))


def _inverse(model: Model, poses: Array) -> Array:
    if not len(poses):
        return np.zeros((0, len(model.actuators)))
    return drive_positions(model, poses, held=model.independent_coordinates).readings
