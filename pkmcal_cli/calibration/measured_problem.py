"""Measurements bound to a model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pkmcal_cli.base.lean import lean
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.copies import copies
from pkmcal_cli.calibration.frame_start import with_frames
from pkmcal_cli.calibration.problem import Problem, stated_sigma, usable
from pkmcal_cli.calibration.unknown_sides import with_unknown_sides
from pkmcal_cli.loading.covariates import require_filled, with_covariates, with_sides
from pkmcal_cli.model.commanded import drive_sigma, forced
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import Rows
from pkmcal_cli.tables.measurement_set import Measurements
from pkmcal_cli.units.measurands import Measurand


def problem_of(model: Model, measurements: Measurements) -> Problem:
    """Measurements bound to a model; a channel's sigma is the table's where it has one, else the machine's.

    Of rows that are copies of each other one is measured. Raises BadInput where rows lack a circumstance of an effect.
    """
    model = model.for_sessions(measurements.named_sessions)
    require_filled(model, measurements)
    unstated = forced(model) | np.isnan(measurements.actuator_sigma)
    of_drives = np.where(unstated, drive_sigma(model), measurements.actuator_sigma)
    readings, stated = (_by_channel(model, measurements, x) for x in (measurements.readings, measurements.sigma))
    rows = Rows(np.asarray(measurements.actuators, dtype=float), np.asarray(measurements.forces, dtype=float))
    rows = with_sides(with_covariates(rows, measurements), model)
    rows = replace(rows, partner=measurements.partners)
    sigma = stated_sigma(model, readings)
    gains = [model.gains[c.index] if c.measurand is Measurand.DRIVE else 1.0 for c in model.channels]
    sigma = np.where(np.isnan(stated), sigma, stated / gains)  # columns have travel
    known = ~np.isnan(readings) & ~np.isnan(sigma)
    model = with_frames(model, rows, np.where(known, readings, np.nan))
    problem = Problem(
        model=model,
        rows=rows,
        readings=readings,
        sigma=lean(sigma),
        drive_sigma=lean(of_drives),
        measured=known,
    )
    groups = tuple(copies(problem))
    known[[row for group in groups for row in group[1:]]] = False
    return usable(with_unknown_sides(replace(problem, copies=groups)))


def _by_channel(model: Model, measurements: Measurements, table: Array) -> Array:
    """Columns of a table (N, K) by the channels of the model, nan where it has none; itself where these are its."""
    names = [c.name for c in model.channels]
    if names == list(measurements.channels):
        return np.asarray(table)
    out = np.full((len(measurements), len(names)), np.nan)
    out[:, [names.index(name) for name in measurements.channels]] = table
    return out
