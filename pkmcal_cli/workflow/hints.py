"""Gross mistakes in a table, told before the fit: limits, swapped columns, units, signs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pkmcal_cli.calibration.measured_pose import measured_poses
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import evaluate
from pkmcal_cli.errors import MAX_FAULTS, Fault, Location
from pkmcal_cli.inverse import drive_positions
from pkmcal_cli.loading import LoadedMachine
from pkmcal_cli.poses import Place
from pkmcal_cli.rotation import Array
from pkmcal_cli.tables.plausibility import Hint, find_gross_faults, find_limit_faults

_LARGE = 1e50  # standard uncertainties: whatever it is, it is no measurement
_REACH = 20.0  # sizes of the machine: no TCP is as far away
_ROWS = 2000  # a sample of a long table shows a gross mistake as well


def absurd_rows(problem: Problem, place: Callable[[int], Place]) -> list[Fault]:
    """Readings beyond all measure, with which nothing can be computed."""
    with np.errstate(over="ignore", invalid="ignore"):
        far = problem.measured & (np.abs(problem.readings) > _LARGE * problem.sigma)
        anywhere = {k for s in problem.model.sensors if s.name in problem.model.fitted_frames for k, _ in s.places}
        channels = enumerate(problem.model.channels)
        places = np.array([c.quantity == "position" and k not in anywhere for k, c in channels])
        reach = _REACH * problem.model.length + np.abs(problem.model.tcp_drawn[:3]).max()
        far |= problem.measured & places & (np.abs(problem.readings) > reach)
    faults = []
    for row, channel in np.argwhere(far)[:MAX_FAULTS]:
        name = problem.model.channels[channel].name
        found = place(int(row)).fault(f"the reading of `{name}` is far outside the machine")
        faults.append(replace(found, hint="correct the cell or the unit, or leave it empty"))
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
    names, units = [a.name for a in model.actuators], [a.unit for a in model.actuators]
    limits = np.array([a.limits for a in model.actuators]).reshape(-1, 2)
    hints = list(find_limit_faults(sample.rows.readings, limits, names, units))
    prediction = evaluate(sample, values).prediction
    wrong = () if prediction.solved.all() else _drive_hints(sample, values, names, units)
    if wrong:
        return tuple(h.message for h in (*hints, *wrong))
    measured = np.where(sample.measured, sample.readings, np.nan)
    channels = model.channels
    hints += find_gross_faults(measured, prediction.values, [c.name for c in channels], [c.unit for c in channels])
    return tuple(h.message for h in hints)


def _drive_hints(sample: Problem, values: Array, names: list[str], units: list[str]) -> tuple[Hint, ...]:
    """Gross mistakes in the drives' columns, by the positions that the drives have at the measured poses."""
    poses, rows = measured_poses(sample, values)
    if not len(rows):
        return ()
    expected = drive_positions(sample.model, poses, values).readings
    return find_gross_faults(sample.rows.readings[rows], expected, names, units)
