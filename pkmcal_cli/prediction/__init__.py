"""The one pipeline: from parameter values and drive readings to predicted measurements, with exact derivatives.

Five stages: command (drive readings to positions), geometry, stiffness, load (coefficients of the engine), reading.
Every stage works on arrays over rows. `simulate`, `sensitivity`, `observability` and `calibrate` are short programs
over `predict`.
"""

from __future__ import annotations

from pkmcal_cli.prediction.inputs import bounds_of, fixed_options, frozen
from pkmcal_cli.prediction.observation import in_machine_frame
from pkmcal_cli.prediction.pipeline import configuration, fixed_smoothing, predict, row_chunks
from pkmcal_cli.prediction.rows import Method, Prediction, Request, RowLost, Rows, WarmStart, joined_rows
from pkmcal_cli.prediction.stages import drive_travels

__all__ = [
    "Method",
    "Prediction",
    "Request",
    "RowLost",
    "Rows",
    "WarmStart",
    "bounds_of",
    "configuration",
    "drive_travels",
    "fixed_options",
    "fixed_smoothing",
    "frozen",
    "in_machine_frame",
    "joined_rows",
    "predict",
    "row_chunks",
]
