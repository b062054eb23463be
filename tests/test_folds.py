"""Into which folds rows fall."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pkmcal_cli.calibration.measured_problem import problem_of
from pkmcal_cli.diagnosis.confirm import cells
from pkmcal_cli.diagnosis.groups import pose_axes
from pkmcal_cli.loading.load_machine import load_machine, load_measurements
from pkmcal_cli.prediction.inverse_kinematics import drive_positions
from tests.command import MACHINES


def test_folds_do_not_depend_on_rounding() -> None:
    """Poses of a regular grid lie on the edges of cells."""
    loaded = load_machine(str(MACHINES / "triglide-nonredundant.yaml"))
    problem = problem_of(loaded.model, load_measurements(loaded, (str(MACHINES / "triglide-nonredundant.csv"),)))
    rows = problem.rows
    noise = 1e-14 * np.random.default_rng(1).standard_normal(rows.readings.shape)
    near = replace(problem, rows=replace(rows, readings=rows.readings + noise))
    folds = cells(problem)
    assert len(set(folds)) > 2
    np.testing.assert_array_equal(folds, cells(near))


def test_a_coordinate_that_stays_is_no_axis_of_the_workspace() -> None:
    """Poses along y at one x: what rounding moves along x is no second axis, over which folds and maps would spread."""
    loaded = load_machine(str(MACHINES / "triglide-nonredundant.yaml"))
    problem = problem_of(loaded.model, load_measurements(loaded, (str(MACHINES / "triglide-nonredundant.csv"),)))
    rng = np.random.default_rng(2)
    poses = np.full((len(problem), 6), np.nan)
    poses[:, 0] = 0.36 + 1e-12 * rng.standard_normal(len(problem))
    poses[:, 1] = rng.uniform(0.2, 0.36, len(problem))
    along = replace(problem.rows, readings=drive_positions(problem.model, poses).readings)
    (axis,) = pose_axes(replace(problem, rows=along))
    assert abs(np.corrcoef(axis, poses[:, 1])[0, 1]) > 1 - 1e-9
    assert len(pose_axes(problem)) == 2
