"""Gross mistakes in a table, told before the fit: limits, columns, units, signs, shifted rows, copies."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.errors import MAX_FAULTS, Fault, Location
from pkmcal_cli.base.plural import count
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.unknown_sides import unsided_rows
from pkmcal_cli.gross_errors.far_rows import far_rows
from pkmcal_cli.gross_errors.gross_faults import gross_faults
from pkmcal_cli.gross_errors.plausibility import Hint, find_limit_faults
from pkmcal_cli.gross_errors.sample import Sample
from pkmcal_cli.loading.load_machine import LoadedMachine
from pkmcal_cli.loading.poses import RowOrigin, origin_of
from pkmcal_cli.model.limits import drive_limits
from pkmcal_cli.prediction import WarmStart
from pkmcal_cli.tables.measurement_set import Measurements
from pkmcal_cli.units.measurands import Measurand

_LARGE = 1e50  # standard uncertainties: whatever it is, it is no measurement
_REACH = 20.0  # sizes of the machine: no TCP is as far away
_APART = 3e3  # the same of readings beside each other; of a thousand, mm and um, hints tell more
_REVOLUTION = 2 * np.pi  # of an angle, in place of the machine's size
_SHOWN = 5  # groups of copied rows told one by one


def absurd_rows(problem: Problem, row_origin: Callable[[int], RowOrigin]) -> list[Fault]:
    """Readings beyond all measure, with which nothing can be computed."""
    with np.errstate(over="ignore", invalid="ignore"):
        far = problem.measured & (np.abs(problem.readings) > _LARGE * problem.sigma)
        anywhere = {k for s in problem.model.sensors if s.name in problem.model.fitted_frames for k, _ in s.places}
        channels = enumerate(problem.model.channels)
        places = np.array([c.measurand is Measurand.POSITION and k not in anywhere for k, c in channels])
        reach = _REACH * problem.model.length + np.abs(problem.model.measured.reference[:3]).max()
        far |= problem.measured & places & (np.abs(problem.readings) > reach)
        far |= problem.measured & ~places & _far_from_others(problem)
    faults = []
    for row, channel in np.argwhere(far)[:MAX_FAULTS]:
        name = problem.model.channels[channel].name
        fault = row_origin(int(row)).fault(f"the reading of `{name}` is far outside the machine")
        faults.append(replace(fault, hint="correct the cell or its unit, or leave the cell empty"))
    return faults


def _far_from_others(problem: Problem) -> NDArray[np.bool_]:
    """Lengths and angles (N, C) that are further from the others of their session than any slip of a unit explains.

    An instrument that stands anywhere reads any coordinates, but alike ones; some write 9.91e37 for no reading.
    Nor may they be far beside the scatter of the others, which is large where most of a column is in another unit.
    """
    size = {"length": problem.model.length, "angle": _REVOLUTION}
    limits = np.array([size.get(c.dimension, np.inf) for c in problem.model.channels])
    far = np.zeros(problem.readings.shape, dtype=bool)
    sessions = problem.rows.session
    for session in np.unique(sessions):
        rows = np.nonzero(sessions == session)[0]
        readings = np.where(problem.measured[rows], problem.readings[rows], np.nan)
        some = np.nonzero(~np.isnan(readings).all(axis=0))[0]
        off = np.abs(readings[:, some] - np.nanmedian(readings[:, some], axis=0))
        far[np.ix_(rows, some)] = off > _APART * np.maximum(limits[some], np.nanmedian(off, axis=0))
    return far


def nothing_measured(loaded: LoadedMachine, problem: Problem) -> Fault:
    """Why there is no measured value that has a weight."""
    if np.isnan(problem.readings).all():
        return Fault(
            "measurements",
            "nothing was measured: the cells of all channels are empty",
            None,
            "check that this is the right file",
        )
    message = "no measured channel has a `sigma`, so the readings cannot be weighted"
    hint = "declare `sigma:` of the sensor or drive, or give a column `sigma.CHANNEL`"
    return Fault("sigma", message, Location(loaded.model.name), hint)


def measurement_hints(
    loaded: LoadedMachine,
    problem: Problem,
    values: Array,
    measured: Measurements,
    states: WarmStart | None = None,
    sample: Sample | None = None,
) -> tuple[str, ...]:
    """The messages of `suspicions`."""
    return tuple(h.message for h in suspicions(loaded, problem, values, measured, states, sample))


def suspicions(
    loaded: LoadedMachine,
    problem: Problem,
    values: Array,
    measured: Measurements,
    states: WarmStart | None = None,
    sample: Sample | None = None,
) -> tuple[Hint, ...]:
    """Gross mistakes, with evidence; predictions at the starting values, where `states` are those of the rows.

    `measured`: the table, for the places of rows; sample: `sample_at` these values, where it is known.
    """
    model = loaded.model
    names, units = model.drive_names, [a.unit for a in model.actuators]
    limits = drive_limits(model.actuators)
    hints = find_limit_faults(problem.rows.readings, limits, names, units)
    sessions = np.asarray(measured.session)
    return hints + gross_faults(
        problem,
        values,
        _to_fit(loaded, problem),
        sessions,
        partial(_row_text, measured),
        names=measured.sessions,
        states=states,
        sample=sample,
    )


def sample_at(loaded: LoadedMachine, problem: Problem, values: Array, states: WarmStart | None = None) -> Sample:
    """The sample of a table that its hints are found by, at the starting values; `states`: of all rows there."""
    return Sample.of(problem, values, _to_fit(loaded, problem), states)


def rows_far_off(sample: Sample, measured: Measurements) -> tuple[str, ...]:
    """Rows that spoil a fit by least squares, and that a robust loss does without."""
    return far_rows(sample, np.asarray(measured.session), partial(_row_text, measured))


def _to_fit(loaded: LoadedMachine, problem: Problem) -> tuple[str, ...]:
    """Parameters that the machine file leaves to be identified, each session's own among them."""
    declared = {p.name for p in loaded.model.parameters if p.identify}
    return tuple(p.name for p in problem.model.parameters if p.shared_name in declared)


def _row_text(measured: Measurements, row: int) -> str:
    """Where a row stands."""
    return str(origin_of(measured, row))


def copied_rows(problem: Problem, measured: Measurements) -> tuple[str, ...]:
    """What is to be said of rows that are copies of others."""
    groups = problem.copies
    if not groups:
        return ()
    shown = [" and ".join(str(origin_of(measured, row)) for row in group) for group in groups[:_SHOWN]]
    more = f", and {len(groups) - _SHOWN} more" if len(groups) > _SHOWN else ""
    extra = sum(len(group) - 1 for group in groups)
    finding = f"{count(extra, 'row')} {'is an exact copy' if extra == 1 else 'are exact copies'} of another"
    same = f"{'; '.join(shown)}{more}"
    return (f"{finding} ({same}): not used, as copies add no information",)


def unsided(problem: Problem, measured: Measurements) -> tuple[str, ...]:
    """What is to be said of rows in which the side of approach counts, and is unknown."""
    rows, drives = unsided_rows(problem)
    if not len(rows):
        return ()
    shown = ", ".join(str(origin_of(measured, int(row))) for row in rows[:_SHOWN])
    more = f", and {len(rows) - _SHOWN} more" if len(rows) > _SHOWN else ""
    they, columns = " and ".join(drives), ", ".join(f"`dir.{name}`" for name in drives)
    text = f"{shown}{more}: from which side {they} came is unknown (first row of a session, or `dir` 0)"
    return (f"{text}: there reversal is part of the uncertainty; if you know it, state {columns}: 1 upwards, else -1",)
