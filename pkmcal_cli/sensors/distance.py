"""Distances between two points: ballbar, draw wire, interferometer arm."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pkmcal_cli.base.rotation import dot
from pkmcal_cli.sensors.sensor_kind import SensorKind, as_read
from pkmcal_cli.units.measurands import Measurand


def distance(seen: Mapping[str, Any]) -> Sequence[Any]:
    """Of two places, m, as it is read."""
    between = seen["other"] - seen["place"]
    return [as_read(np.sqrt(dot(between, between)), seen)]


DISTANCE = SensorKind(
    keyword="distance",
    title="distance between two points, each with known coordinates or parameters as coordinates",
    instruments="double ballbar, draw wire, length gauge, touch probe on a datum ball",
    needs=("at", "to"),
    may=("offset", "column", "reading", "zero", "scale", "unit", "sigma_per_length"),
    variables=("place", "other", "zero", "scale", "reading_error"),
    measurand=Measurand.DISTANCE,
    equation=distance,
    unmoved={"meas_shear": "only an instrument with axes of its own (`tcp`) can have axes that are not square"},
)
