"""What noise makes of errors on held-out rows: by leaving rows out in a linear model, and no more is `unexplained`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.holdout import HeldOut, cross_validate
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.prediction import Rows, predict
from pkmcal_cli.report.evidence import evidence_of
from tests.campaigns import shipped

POINTS, SIGMA = 12, 1e-6
LABELS = np.arange(POINTS) % 5


def campaign(seed: int) -> tuple[Problem, Fit, HeldOut]:
    """12 points of the two-legged Triglide: six parameters, a quarter of the values."""
    plan = shipped("triglide-nonredundant").take(np.random.default_rng(0).permutation(231)[:POINTS])
    plan, rng = replace(plan, sigma=np.full(2, SIGMA)), np.random.default_rng(seed)
    problem = plan.measured(plan.drawn(rng), rng)
    fit = identify(problem, plan.selected)
    return problem, fit, cross_validate(problem, fit, LABELS, "")


def left_out(problem: Problem, fit: Fit) -> float:
    """Mean square of errors of readings that a fit to the others predicts, in variances; derivatives by differences."""
    rows = Rows.at(problem.rows.readings)

    def readings(values: Array) -> Array:
        return np.asarray(predict(problem.model, values, rows).values)

    columns = []
    for name in fit.selected:
        step = np.zeros(len(fit.values))
        step[problem.model.names.index(name)] = 1e-6
        columns.append((readings(fit.values + step) - readings(fit.values - step)) / 2e-6)
    jacobian, total = np.stack(columns, axis=2) / SIGMA, 0.0
    for fold in range(5):
        of_fold = np.equal(LABELS, fold)
        out, used = jacobian[of_fold].reshape(-1, 6), jacobian[~of_fold].reshape(-1, 6)
        total += len(out) + np.trace(out @ np.linalg.solve(used.T @ used, out.T))
    return float(total) / (2 * POINTS)


def test_noise_of_held_out_rows_is_that_of_the_linear_model() -> None:
    """A fit of 24 values by 6 parameters adds more than 6/24: rows of a fold lie beside the others."""
    problem, fit, held = campaign(0)
    expected = left_out(problem, fit)
    assert expected > 1.4
    assert held.noise["position"] == pytest.approx(expected, rel=0.01)


def test_errors_that_noise_makes_are_not_unexplained() -> None:
    """A standard deviation more than the mean is nothing, an error as large as the noise itself twice is."""
    problem, fit, held = campaign(0)
    expected = left_out(problem, fit)

    def unexplained(square: float) -> float:
        errors = {"position": replace(held.after["position"], rms=SIGMA * np.sqrt(2 * square))}
        return evidence_of(problem, fit, errors, False, held.noise).unexplained.get("position", 0.0)

    assert unexplained(expected * (1 + expected * np.sqrt(2 / (2 * POINTS)))) == 0
    assert unexplained(expected + 4) == pytest.approx(2 * SIGMA, rel=0.01)


@pytest.mark.slow
def test_one_in_twenty_tables_of_noise_leaves_something() -> None:
    """150 campaigns; 12 % did when noise was thought to make 1 + p / n. Their size is that of the linear model."""
    made = [campaign(seed) for seed in range(150)]
    ratio = [held.after["position"].criterion / (2 * POINTS * SIGMA**2) / held.noise["position"] for *_, held in made]
    assert np.mean(ratio) == pytest.approx(1, abs=4 * np.std(ratio) / np.sqrt(150))
    left = [evidence_of(problem, fit, held.after, False, held.noise).unexplained for problem, fit, held in made]
    assert np.mean([bool(each) for each in left]) == pytest.approx(0.05, abs=0.05)
