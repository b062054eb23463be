"""Distances between two points: ballbar, draw wire, interferometer arm; between two rows: calipers, gauge length."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pkmcal_cli.rotation import dot
from pkmcal_cli.sensors.base import SensorKind, as_read


def _read(seen: Mapping[str, Any]) -> Sequence[Any]:
    between = seen["other"] - seen["place"]
    return [as_read(np.sqrt(dot(between, between)), seen)]


DISTANCE = SensorKind(
    "distance",
    "distance between two points; either may be known or have parameters as coordinates",
    "double ballbar, draw wire, length gauge",
    ("at", "to"),
    ("offset", "column", "zero", "scale", "sigma_per_length"),
    ("place", "other", "zero", "scale"),
    "distance",
    _read,
)
SPAN = SensorKind(
    "span",
    "distance between the places of one point in two rows; column `to` names the other row",
    "calipers, gauge length, printed test part",
    ("at",),
    ("offset", "column", "zero", "scale", "sigma_per_length"),
    ("place", "other", "zero", "scale"),
    "distance",
    _read,
    joins=True,
)
