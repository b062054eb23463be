"""A plane or line that is touched: coordinates in a frame of the machine file, known or with parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pkmcal_cli.base.rotation import exp
from pkmcal_cli.sensors.base import SensorKind, as_read


def _read(seen: Mapping[str, Any]) -> Sequence[Any]:
    frame, place = seen["frame"], seen["place"]
    return [as_read(part, seen) for part in np.einsum("nji,nj->in", exp(frame[:, 3:]), place - frame[:, :3])]


TOUCH = SensorKind(
    keyword="touch",
    title="deviation from a plane (default: normal of the frame `on`) or from a line (reads: [y, z])",
    instruments="touch probe, bed probing, dial gauge on a straightedge",
    needs=("at", "on"),
    may=("reads", "offset", "column", "zero", "scale"),
    sees=("place", "frame", "zero", "scale"),
    quantity="distance",
    law=_read,
    channels=("x", "y", "z"),
    normal=("z", "y"),
)
