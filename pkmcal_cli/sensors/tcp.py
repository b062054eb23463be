"""Coordinates of points in the frame of an instrument: grid encoder, camera, laser tracker, level, autocollimator."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pkmcal_cli.base.rotation import exp, log
from pkmcal_cli.sensors.base import SensorKind


def strained(d: Any) -> Any:
    """I plus scale and shear (N, 3, 3) of a motion (N, 10): x += xy y + xz z, y += yz z."""
    out = np.zeros((len(d), 3, 3), dtype=d.dtype)
    for k in range(3):
        out[:, k, k] = 1.0 + d[:, 6]
    out[:, 0, 1], out[:, 0, 2], out[:, 1, 2] = d[:, 7], d[:, 8], d[:, 9]
    return out


def _read(seen: Mapping[str, Any]) -> Sequence[Any]:
    d, place = seen["motion"], seen["place"]
    turn = exp(d[:, 3:6])
    moved = (d[:, :3] + np.einsum("nij,njk,nk->ni", turn, strained(d), place)).T
    if "scale" in seen:
        moved = moved / seen["scale"][:, 0]
    return [*moved, *log(turn @ exp(seen["turn"])).T] if "turn" in seen else [*moved]


TCP = SensorKind(
    keyword="tcp",
    title="coordinates and orientation of points in the instrument's frame",
    instruments="grid encoder, camera, laser tracker with one or several reflectors, level, autocollimator",
    needs=("at", "reads", "frame"),
    may=("offset", "scale", "sigma_per_length", "correlation"),
    sees=("place", "turn", "motion", "scale"),
    quantity="position",
    law=_read,
    channels=("x", "y", "z", "rx", "ry", "rz"),
)
