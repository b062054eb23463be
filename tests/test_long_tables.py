"""Long tables are summed in parts: the result is that of the whole, and memory does not grow with the derivatives."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from pkmcal_cli.base import lean as arrays
from pkmcal_cli.base.lean import lean, lean_join, parts_of, some_rows
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration import condensed as long_tables
from pkmcal_cli.calibration.complete_fit import FitOptions, calibrated
from pkmcal_cli.calibration.condensed import condensed, evaluate_condensed, in_parts, is_long
from pkmcal_cli.calibration.prior import prior_of_ranges
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import Evaluation, evaluate, linearise, whitened_residual
from pkmcal_cli.calibration.robust import Loss
from pkmcal_cli.diagnosis.gross_rows import gross_rows
from pkmcal_cli.prediction import pipeline
from tests.campaigns import Plan, by_engine, shipped


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """Every table counts as long, in chunks of 32 rows, the fewest."""
    monkeypatch.setattr(long_tables, "LONG", 40)
    monkeypatch.setattr(pipeline, "_CHUNK_BYTES", 1.0)
    return monkeypatch


def campaign(rows: int = 150) -> tuple[Plan, Problem, Array]:
    """The Triglide at random positions about its own, some cells empty: plan, problem, true values (P,)."""
    plan, rng = shipped("triglide-nonredundant"), np.random.default_rng(3)
    positions = plan.positions[rng.integers(len(plan.positions), size=rows)]
    plan = by_engine(replace(plan, positions=positions + rng.uniform(-2e-3, 2e-3, positions.shape)))
    values = plan.drawn(rng)
    problem = plan.measured(values, rng)
    measured = problem.measured.copy()
    measured[::7, 0] = False
    return plan, replace(problem, measured=measured), values


@pytest.mark.parametrize("known", ["nothing", "ranges", "weights"])
def test_sums_are_those_of_all_rows(short: pytest.MonkeyPatch, known: str) -> None:
    plan, problem, values = campaign()
    if known == "ranges":
        problem = replace(problem, prior=prior_of_ranges(problem.model, plan.selected))
    if known == "weights":
        weight = np.random.default_rng(1).uniform(0.1, 1.0, problem.readings.shape)
        problem = replace(problem, weight=weight)
    assert is_long(problem)
    near = condensed(problem, evaluate_condensed(problem, values, plan.selected))
    by_row = linearise(problem, evaluate(problem, values, plan.selected))
    assert len(near.residual) < 30 < len(by_row.residual)
    scale = np.abs(by_row.jacobian).max(axis=0)
    a, b = near.jacobian / scale, by_row.jacobian / scale
    assert np.allclose(a.T @ a, b.T @ b, rtol=1e-12, atol=1e-12 * float((b**2).sum()))
    assert np.allclose(a.T @ near.residual, b.T @ by_row.residual, rtol=1e-9, atol=1e-9)
    assert near.chi2 == pytest.approx(by_row.chi2, rel=1e-12)
    assert near.residual @ near.residual == pytest.approx(by_row.residual @ by_row.residual, rel=1e-12)
    step = 1e-5 * np.arange(1.0, len(scale) + 1)
    assert near.expected(step) == pytest.approx(by_row.expected(step), rel=1e-12)


def test_of_other_rows_sums_are_taken_again(short: pytest.MonkeyPatch) -> None:
    """Rows that are left out after an evaluation are not in its sums any more."""
    plan, problem, values = campaign()
    evaluation = evaluate_condensed(problem, values, plan.selected)
    part = problem.without(range(20))
    by_row = linearise(part, evaluate(part, values, plan.selected))
    near = condensed(part, evaluation)
    assert np.allclose(near.jacobian.T @ near.jacobian, by_row.jacobian.T @ by_row.jacobian, rtol=1e-9)


def test_every_row_is_visited_once(short: pytest.MonkeyPatch) -> None:
    plan, problem, values = campaign()
    seen, jacobian = np.zeros(len(problem)), np.zeros((*problem.readings.shape, len(plan.selected)))

    def visit(rows: slice, part: Problem, evaluation: Evaluation) -> None:
        seen[rows] += 1
        assert evaluation.prediction.jacobian is not None
        jacobian[rows] = evaluation.prediction.jacobian
        assert (part.readings == problem.readings[rows]).all()

    in_parts(problem, evaluate_condensed(problem, values, plan.selected), visit)
    whole = evaluate(problem, values, plan.selected)
    assert whole.prediction.jacobian is not None
    assert (seen == 1).all() and np.allclose(jacobian, whole.prediction.jacobian, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("loss", ["squares", "tukey"])
def test_a_calibration_is_that_of_the_whole_table(monkeypatch: pytest.MonkeyPatch, loss: Loss) -> None:
    plan, problem, _ = campaign()
    problem = replace(problem, readings=problem.readings + 0.0)
    problem.readings[[17, 90], 1] += 40 * problem.sigma[0, 1]  # two bad rows, in different chunks
    session, options = np.zeros(len(problem)), FitOptions(loss=loss)

    def found() -> tuple[Array, Array, Array, list[int], tuple[int, ...]]:
        done = calibrated(problem, plan.selected, problem.model.nominal, options, session)
        fit = done.robust.fit
        white = whitened_residual(problem, fit.last)
        rows, _ = gross_rows(problem, plan.selected, 1e-3, 0)
        return (
            fit.values / plan.model.ranges.clip(1e-9),
            done.budget.std,
            white,
            [d.row for d in done.robust.doubtful[:2]],
            rows,
        )

    whole = found()
    monkeypatch.setattr(long_tables, "LONG", 40)
    monkeypatch.setattr(pipeline, "_CHUNK_BYTES", 1.0)
    monkeypatch.setattr(arrays, "PART", 32)
    parts = found()
    assert whole[0] == pytest.approx(parts[0], abs=1e-6)
    assert whole[1] == pytest.approx(parts[1], rel=1e-6)
    assert whole[2] == pytest.approx(parts[2], abs=1e-4)
    assert set(whole[3]) == set(parts[3]) == {17, 90} == set(whole[4]) == set(parts[4])


@pytest.mark.parametrize("count", [0, 1, 31, 32, 33, 64, 100])
def test_parts_hold_every_row_once(monkeypatch: pytest.MonkeyPatch, count: int) -> None:
    monkeypatch.setattr(arrays, "PART", 32)
    parts = parts_of(count)
    assert np.concatenate([np.arange(count)[rows] for rows in parts]).tolist() == list(range(count))
    assert all(len(np.arange(count)[rows]) <= 32 for rows in parts)


def test_what_is_measured_once_is_in_one_part() -> None:
    """A part of a table is not a table of its own: `take` gives it what was measured once, `part` does not."""
    _, problem, _ = campaign()
    pieces = [problem.part(slice(first, first + 40)) for first in range(0, 160, 40)]
    assert sum(piece.count for piece in pieces) == problem.count


def test_memory_does_not_grow_with_the_derivatives() -> None:
    """Twice the parameters take no more memory by row: 24 000 rows, derivatives of which would be 27 MB."""
    plan, problem, values = campaign(24_000)
    assert is_long(problem)
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        evaluation = evaluate_condensed(problem, values, plan.selected)
        kept = tracemalloc.get_traced_memory()[0] - before
    finally:
        tracemalloc.stop()
    assert evaluation.solved and kept < 120 * len(problem)  # bytes; values, residuals and states are 72 to 112


def test_rows_that_are_the_same_are_stored_once() -> None:
    table = np.tile([1.0, np.nan, 3.0], (50, 1))
    once = lean(table)
    assert once.strides[0] == 0 and np.array_equal(once, table, equal_nan=True)
    assert some_rows(once, np.array([3, 4, 7])).shape == (3, 3) and some_rows(once, slice(2, 9)).shape == (7, 3)
    assert some_rows(once, np.arange(50) < 20).strides[0] == 0
    table[49, 0] = 2.0
    assert lean(table) is table
    assert lean_join([np.ones((3, 2)), np.ones((4, 2))]).shape == (7, 2)
    assert (lean_join([np.ones(3), np.arange(2.0)]) == [1, 1, 1, 0, 1]).all()
