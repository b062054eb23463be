"""Encoders on passive joints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pkmcal_cli.base.rotation import exp
from pkmcal_cli.sensors.base import SensorKind, as_read


def _read(seen: Mapping[str, Any]) -> Sequence[Any]:
    line = np.einsum("nji,nj->ni", exp(seen["turn"]), seen["other"] - seen["place"])
    along, across = (np.einsum("ni,ni->n", seen["basis"][:, part], line) for part in (slice(0, 3), slice(3, 6)))
    return [as_read(_angle(along, across), seen)]


def _angle(x: Any, y: Any) -> Any:
    """arctan2(y, x), analytic but on the negative x axis."""
    r = np.sqrt(x * x + y * y)
    ahead = np.real(x) >= 0
    return 2 * np.arctan(np.where(ahead, y, r - x) / np.where(ahead, r + x, y))


ANGLE = SensorKind(
    keyword="angle",
    title="direction of the line from one point to another, in the axes of the body that has the first "
    "(against the drawing)",
    instruments="encoder of a passive joint, inclinometer on a rod",
    needs=("at", "to"),
    may=("axis", "column", "zero", "scale", "unit"),
    sees=("place", "other", "turn", "basis", "zero", "scale"),
    quantity="angle",
    turns=True,
    law=_read,
)
