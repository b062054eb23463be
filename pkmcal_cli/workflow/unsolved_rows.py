"""Rows that cannot be predicted, as an error."""

from __future__ import annotations

import numpy as np

from pkmcal_cli.base.errors import BadInput, Fault
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import Evaluation
from pkmcal_cli.gross_errors.hints import measurement_hints
from pkmcal_cli.loading.load_machine import LoadedMachine
from pkmcal_cli.loading.poses import failed_rows, place_of
from pkmcal_cli.tables.measurement_set import Measurements


def unsolved(loaded: LoadedMachine, measured: Measurements, problem: Problem, evaluation: Evaluation) -> BadInput:
    """The error that names them, after what is wrong with the table as a whole."""
    prediction = evaluation.prediction
    lost = np.nonzero(~prediction.solved)[0]
    error = failed_rows(lambda row: place_of(measured, row), {int(k): prediction.reason(int(k)) for k in lost})
    hints = measurement_hints(loaded, problem, evaluation.values, measured, prediction.start)
    return BadInput([*(Fault("plausibility", text) for text in hints), *error.faults], error.total + len(hints))
