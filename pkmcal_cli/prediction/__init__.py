"""The one pipeline: from parameter values and drive readings to predicted measurements, with exact derivatives.

Five stages: command (drive readings to positions), geometry, stiffness, load (slots of the engine), reading. Every
stage works on arrays over rows. `simulate`, `sensitivity`, `observability` and `calibrate` are short programs over
`predict`.
"""

from __future__ import annotations

from pkmcal_cli.prediction.inputs import frozen, settled_options
from pkmcal_cli.prediction.laws import in_machine_frame
from pkmcal_cli.prediction.pipeline import predict, row_chunks, settled_smoothing
from pkmcal_cli.prediction.rows import Method, Prediction, Request, Rows, joined_rows
from pkmcal_cli.prediction.solving import rigid_pose
from pkmcal_cli.prediction.stages import drive_travels

__all__ = [
    "Method",
    "Prediction",
    "Request",
    "Rows",
    "drive_travels",
    "frozen",
    "in_machine_frame",
    "joined_rows",
    "predict",
    "rigid_pose",
    "row_chunks",
    "settled_options",
    "settled_smoothing",
]
