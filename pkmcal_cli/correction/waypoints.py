"""Ways between set values: drives that move straight, all at once, would strain a redundant machine on a long way.

So the tool point moves straight, and set values follow the inverse model in steps so short that drives which move
straight from one to the next stay within a millionth of the machine's size of it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.mechanism.topology import Index
from pkmcal_cli.model.model import Model

GAP = 1e-6  # of the machine's size: by which drives that move straight may be apart on the way
_MOST = 1000  # points of a way
_LOOKED_AT = np.linspace(0.0, 1.0, 9)[1:-1]

Inverse = Callable[[Array], Array]
"""From poses (n, 6) of the tool point to set values (n, A), nan where there are none."""


@dataclass(frozen=True)
class Stations:
    """Set values (N, A), and the poses (N, 6) of the tool point there."""

    set_values: Array
    poses: Array

    def take(self, rows: Index | slice) -> Stations:
        """Some of them."""
        return Stations(self.set_values[rows], self.poses[rows])


def waypoints(model: Model, inverse: Inverse, begin: Stations, end: Stations) -> list[Array]:
    """Set values (k, A) between stations (N each), one array a way; none where any way will do.

    By what the stations are off the inverse, set values are off on the way, changing evenly. A way that passes poses
    that the machine does not reach has no points.
    """
    none = begin.set_values[:0]
    if not model.overdetermined or not len(begin.poses):
        return [none] * len(begin.poses)
    off = [stations.set_values - inverse(stations.poses) for stations in (begin, end)]

    def between(rows: Index | slice, share: Array | float) -> Array:
        first, last, off_first, off_last = (part[rows] for part in (begin.poses, end.poses, *off))
        return np.asarray(inverse(first + share * (last - first)) + off_first + share * (off_last - off_first))

    apart = np.zeros(len(begin.poses))
    for share in _LOOKED_AT:
        straight = begin.set_values + share * (end.set_values - begin.set_values)
        apart = np.maximum(apart, np.abs((between(slice(None), share) - straight) * model.gains).max(axis=1))
    steps = np.ceil(np.sqrt(np.nan_to_num(apart) / (GAP * model.length)) + 1e-9).astype(int).clip(1, _MOST)
    ways = np.repeat(np.arange(len(steps)), steps - 1)
    ends = np.cumsum(steps - 1)
    number = np.arange(len(ways)) - (ends - steps + 1)[ways] + 1  # of a point on its way
    points = between(ways, (number / steps[ways])[:, None]) if len(ways) else none
    return np.split(points, ends[:-1])
