"""Into which folds rows fall."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pkmcal_cli.calibration.bound import problem_of
from pkmcal_cli.diagnosis.confirm import cells
from pkmcal_cli.loading.machine import load_machine, load_measurements
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
