"""Distances between the places of one point in two rows: calipers, gauge length, printed test part."""

from __future__ import annotations

from pkmcal_cli.sensors.base import SensorKind
from pkmcal_cli.sensors.distance import distance

SPAN = SensorKind(
    keyword="span",
    title="distance between the places of one point in two rows; column `to` names the other row",
    instruments="calipers, gauge length, printed test part",
    needs=("at",),
    may=("offset", "column", "zero", "scale", "sigma_per_length"),
    sees=("place", "other", "zero", "scale"),
    quantity="distance",
    law=distance,
    joins=True,
)
