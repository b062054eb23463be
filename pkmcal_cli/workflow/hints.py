"""Gross mistakes in a table, told before the fit: limits, swapped columns, units, signs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pkmcal_cli.calibration.residual import Problem, evaluate
from pkmcal_cli.errors import MAX_FAULTS, Fault, Location
from pkmcal_cli.loading import LoadedMachine
from pkmcal_cli.poses import Place
from pkmcal_cli.rotation import Array
from pkmcal_cli.tables.plausibility import find_gross_faults, find_limit_faults

_LARGE = 1e50  # standard uncertainties: whatever it is, it is no measurement
_ROWS = 2000  # a sample of a long table shows a gross mistake as well


def absurd_rows(problem: Problem, place: Callable[[int], Place]) -> list[Fault]:
    """Readings beyond all measure, with which nothing can be computed."""
    with np.errstate(over="ignore", invalid="ignore"):
        far = problem.measured & (np.abs(problem.readings) > _LARGE * problem.sigma)
    faults = []
    for row, channel in np.argwhere(far)[:MAX_FAULTS]:
        found = place(int(row)).fault(f"the reading of `{problem.model.channels[channel].name}` is beyond all measure")
        faults.append(replace(found, hint="correct the cell, or leave it empty"))
    return faults


def nothing_measured(loaded: LoadedMachine, problem: Problem) -> Fault:
    """Why there is no measured value that has a weight."""
    if np.isnan(problem.readings).all():
        return Fault(
            "measurements", "nothing was measured: the cells of all channels are empty", None, "is it the file?"
        )
    what = "no channel that was measured has a sigma: nothing can be weighed"
    hint = "declare `sigma:` of the sensor or drive, or give a column `sigma.CHANNEL`"
    return Fault("sigma", what, Location(loaded.model.name), hint)


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
