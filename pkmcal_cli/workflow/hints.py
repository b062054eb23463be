"""Gross mistakes in a table, told before the fit: limits, swapped columns, units, signs."""

from __future__ import annotations

import numpy as np

from ..calibration.residual import Problem, evaluate
from ..loading import LoadedMachine
from ..plausibility import find_gross_faults, find_limit_faults
from ..rotation import Array

_ROWS = 2000  # a sample of a long table shows a gross mistake as well


def measurement_hints(loaded: LoadedMachine, problem: Problem, values: Array) -> tuple[str, ...]:
    """Messages with evidence; predictions at the starting values."""
    model = loaded.model
    step = max(1, len(problem) // _ROWS)
    sample = problem.take(np.arange(0, len(problem), step))
    names = [a.name for a in model.actuators]
    limits = np.array([a.limits for a in model.actuators]).reshape(-1, 2)
    hints = list(find_limit_faults(sample.rows.readings, limits, names, [a.unit for a in model.actuators]))
    prediction = evaluate(sample, values).prediction.values
    measured = np.where(sample.measured, sample.readings, np.nan)
    hints += find_gross_faults(measured, prediction, [c.name for c in model.channels], [c.unit for c in model.channels])
    return tuple(h.message for h in hints)
