"""Distances between two points: ballbar, draw wire, interferometer arm."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pkmcal_cli.base.rotation import dot
from pkmcal_cli.sensors.base import SensorKind, as_read


def distance(seen: Mapping[str, Any]) -> Sequence[Any]:
    """Of two places, m, as it is read."""
    between = seen["other"] - seen["place"]
    return [as_read(np.sqrt(dot(between, between)), seen)]


DISTANCE = SensorKind(
    keyword="distance",
    title="distance between two points; either may be known or have parameters as coordinates",
    instruments="double ballbar, draw wire, length gauge",
    needs=("at", "to"),
    may=("offset", "column", "zero", "scale", "sigma_per_length"),
    sees=("place", "other", "zero", "scale"),
    quantity="distance",
    law=distance,
)
