"""Distances between the places of one point in two rows: calipers, gauge length, printed test part."""

from __future__ import annotations

from pkmcal_cli.sensors.distance import distance
from pkmcal_cli.sensors.sensor_kind import SensorKind
from pkmcal_cli.units.measurands import Measurand

SPAN = SensorKind(
    keyword="span",
    title="distance between the positions of one point in two rows; column `to` names the other row",
    instruments="calipers, gauge length, printed test part",
    needs=("at",),
    may=("offset", "column", "zero", "scale", "unit", "sigma_per_length"),
    variables=("place", "other", "zero", "scale", "reading_error"),
    measurand=Measurand.DISTANCE,
    equation=distance,
    joins=True,
    unmoved={
        "frame": "the distance between two positions is the same wherever the instrument stands",
        "meas_shear": "only an instrument with axes of its own (`tcp`) can have axes that are not square",
    },
)
