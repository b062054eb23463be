"""A plane or line that is touched: coordinates in a frame of the machine file, known or with parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pkmcal_cli.base.rotation import exp
from pkmcal_cli.sensors.sensor_kind import SensorKind, as_read
from pkmcal_cli.units.measurands import Measurand


def _read(seen: Mapping[str, Any]) -> Sequence[Any]:
    frame, place = seen["frame"], seen["place"]
    there = np.einsum("nji,nj->ni", exp(frame[:, 3:]), place - frame[:, :3])
    if "motion" in seen:
        there = seen["motion"][:, :3] + np.einsum("nij,nj->ni", exp(seen["motion"][:, 3:6]), there)
    return [as_read(part, seen) for part in there.T]


TOUCH = SensorKind(
    keyword="touch",
    title="deviation from a plane (default: normal of the frame `surface`) or from a line (reads: [y, z])",
    instruments="touch probe, bed probing, dial gauge on a straightedge",
    needs=("at", "surface"),
    may=("reads", "offset", "column", "reading", "zero", "scale", "unit"),
    variables=("place", "frame", "motion", "zero", "scale", "reading_error"),
    measurand=Measurand.DISTANCE,
    equation=_read,
    channels=("x", "y", "z"),
    normal=("z", "y"),
    unmoved={
        "meas_scale": "it always reads 0, whatever its scale",
        "meas_zero": "its zero is the place of its surface, `frame`",
        "meas_shear": "only an instrument with axes of its own (`tcp`) can have axes that are not square",
    },
)
