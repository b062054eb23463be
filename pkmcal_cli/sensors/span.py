"""Distances between the places of one point in two rows: calipers, gauge length, printed test part."""

from __future__ import annotations

from pkmcal_cli.sensors.base import SensorKind
from pkmcal_cli.sensors.distance import distance

SPAN = SensorKind(
    "span",
    "distance between the places of one point in two rows; column `to` names the other row",
    "calipers, gauge length, printed test part",
    ("at",),
    ("offset", "column", "zero", "scale", "sigma_per_length"),
    ("place", "other", "zero", "scale"),
    "distance",
    distance,
    joins=True,
)
