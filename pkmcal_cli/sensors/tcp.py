"""Coordinates of points in the frame of an instrument: grid encoder, camera, laser tracker, level, autocollimator."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pkmcal_cli.base.rotation import exp, log
from pkmcal_cli.sensors.sensor_kind import SensorKind
from pkmcal_cli.units.measurands import Measurand


def strained(d: Any) -> Any:
    """I plus scale and shear (N, 3, 3) of a motion (N, 10): x += xy y + xz z, y += yz z."""
    out = np.zeros((len(d), 3, 3), dtype=d.dtype)
    for k in range(3):
        out[:, k, k] = 1.0 + d[:, 6]
    out[:, 0, 1], out[:, 0, 2], out[:, 1, 2] = d[:, 7], d[:, 8], d[:, 9]
    return out


def _read(seen: Mapping[str, Any]) -> Sequence[Any]:
    moved, turned = seen["place"], exp(seen["rotation"]) if "rotation" in seen else None
    if "motion" in seen:
        d = seen["motion"]
        rotation = exp(d[:, 3:6])
        moved = d[:, :3] + np.einsum("nij,njk,nk->ni", rotation, strained(d), moved)
        turned = None if turned is None else rotation @ turned
    coordinates = moved.T / (seen["scale"][:, 0] if "scale" in seen else 1.0)
    return [*coordinates] if turned is None else [*coordinates, *log(turned).T]


TCP = SensorKind(
    keyword="tcp",
    title="coordinates and orientation of points in the instrument's frame",
    instruments="grid encoder, camera, laser tracker with one or several reflectors, level, autocollimator",
    needs=("at", "reads", "frame"),
    may=("offset", "scale", "sigma_per_length", "correlation"),
    variables=("place", "rotation", "motion", "scale"),
    measurand=Measurand.POSITION,
    equation=_read,
    channels=("x", "y", "z", "rx", "ry", "rz"),
)
