"""Encoders on passive joints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pkmcal_cli.base.rotation import cross, dot, exp
from pkmcal_cli.sensors.sensor_kind import SensorKind, as_read
from pkmcal_cli.units.measurands import Measurand


def _read(seen: Mapping[str, Any]) -> Sequence[Any]:
    line = np.einsum("nji,nj->ni", exp(seen["rotation"]), seen["other"] - seen["place"])
    first, second = seen["basis"][:, :3], seen["basis"][:, 3:]
    triad = np.stack([dot(axis, line) for axis in (first, second, cross(first, second))], axis=1)  # z: its axis
    if "motion" in seen:
        triad = np.einsum("nij,nj->ni", exp(seen["motion"][:, 3:6]), triad)
    return [as_read(_angle(triad[:, 0], triad[:, 1]), seen)]


def _angle(x: Any, y: Any) -> Any:
    """arctan2(y, x), analytic but on the negative x axis."""
    r = np.sqrt(x * x + y * y)
    ahead = np.real(x) >= 0
    return 2 * np.arctan(np.where(ahead, y, r - x) / np.where(ahead, r + x, y))


ANGLE = SensorKind(
    keyword="angle",
    title="direction of the line from one point to another, in the axes of the body of the first point "
    "(relative to the reference configuration)",
    instruments="encoder of a passive joint, inclinometer on a rod",
    needs=("at", "to"),
    may=("axis", "column", "zero", "scale", "unit"),
    variables=("place", "other", "rotation", "motion", "basis", "zero", "scale", "reading_error"),
    measurand=Measurand.ANGLE,
    rotates=True,
    equation=_read,
    unmoved={
        "meas_zero": "its zero is `rz` of its `frame`",
        "meas_shear": "only an instrument with axes of its own (`tcp`) can have axes that are not square",
    },
)
