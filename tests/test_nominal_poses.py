"""Nominal poses of a table are found once: for its parts, for models with effects, and for other processes."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest

from pkmcal_cli.calibration import nominal_poses
from pkmcal_cli.calibration.measured_problem import problem_of
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.loading.load_machine import load_machine, load_measurements
from tests.command import SCISSORS, SHOPFLOOR


@pytest.fixture
def problem() -> Problem:
    loaded = load_machine(SCISSORS)
    return problem_of(loaded.model, load_measurements(loaded, (SHOPFLOOR,)))


@pytest.fixture
def predicted(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many rows were predicted each time."""
    asked: list[int] = []
    predict = nominal_poses.predict
    monkeypatch.setattr(nominal_poses, "predict", lambda m, v, rows: asked.append(len(rows)) or predict(m, v, rows))
    return asked


def test_parts_and_other_effects_ask_for_nothing_again(problem: Problem, predicted: list[int]) -> None:
    rows = np.array([5, 2, 9])
    whole = problem.nominal_poses
    part = problem.take(rows).without([0])
    assert {name: x[rows].tolist() for name, x in whole.items()} == {
        name: x.tolist() for name, x in part.nominal_poses.items()
    }
    wider = replace(part, model=part.model.with_ranges(2 * part.model.ranges)).part(slice(1, 3))
    assert all((wider.nominal_poses[n] == x[rows[1:]]).all() for n, x in whole.items())
    assert predicted == [len(problem)]


def test_other_nominal_values_and_other_rows_are_predicted_anew(problem: Problem, predicted: list[int]) -> None:
    """Each is as it would be alone."""
    before = problem.nominal_poses["x"]
    values = problem.model.nominal
    values[problem.model.names.index("xa1")] += 1e-3
    moved = replace(problem, model=problem.model.with_nominal(values)).nominal_poses["x"]
    assert np.abs(moved - before).max() > 1e-4
    turned = problem.rows.take(np.arange(len(problem))[::-1])
    assert replace(problem, rows=turned).nominal_poses["x"] == pytest.approx(before[::-1], abs=1e-12)
    assert len(predicted) == 3


def test_a_part_goes_to_another_process_without_its_table(problem: Problem, predicted: list[int]) -> None:
    part = problem.take(np.arange(3))
    size = len(pickle.dumps(part))
    assert size < len(pickle.dumps(problem)) - 100 * len(problem), "rows of the table are not in it"
    whole = problem.nominal_poses
    again = pickle.loads(pickle.dumps(part))
    assert all((again.nominal_poses[n] == x[:3]).all() for n, x in whole.items()) and predicted == [len(problem)]
