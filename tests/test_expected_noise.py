"""What noise makes of errors of fitted and held-out rows, by a linear model; no more than that is `unexplained`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.expected_noise import fitted_noise, reported_noise
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.holdout import HeldOut, cross_validate
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.prior import prior_of_covariance
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.prediction import Rows, predict
from pkmcal_cli.report import improved_files
from pkmcal_cli.report.evidence import evidence_of
from tests.campaign_tables import true_values, write_table
from tests.campaigns import shipped
from tests.command import MACHINES, run

POINTS, SIGMA = 12, 1e-6
LABELS = np.arange(POINTS) % 5


def campaign(seed: int) -> tuple[Problem, Fit, HeldOut]:
    """12 points of the two-legged Triglide: six parameters, a quarter of the values."""
    plan = shipped("triglide-nonredundant").take(np.random.default_rng(0).permutation(231)[:POINTS])
    plan, rng = replace(plan, sigma=np.full(2, SIGMA)), np.random.default_rng(seed)
    problem = plan.measured(plan.drawn(rng), rng)
    fit = identify(problem, plan.selected)
    return problem, fit, cross_validate(problem, fit, LABELS, "")


def slopes(problem: Problem, fit: Fit) -> Array:
    """Derivatives (N, 2, p) of the readings, in their noise, by differences of predictions."""
    rows = Rows.at(problem.rows.readings)

    def readings(values: Array) -> Array:
        return np.asarray(predict(problem.model, values, rows).values)

    columns = []
    for name in fit.selected:
        step = np.zeros(len(fit.values))
        step[problem.model.names.index(name)] = 1e-6
        columns.append((readings(fit.values + step) - readings(fit.values - step)) / 2e-6)
    return np.asarray(np.stack(columns, axis=2) / SIGMA)


def left_out(problem: Problem, fit: Fit) -> float:
    """Mean square of errors of readings that a fit to the others predicts, in variances."""
    jacobian, total = slopes(problem, fit), 0.0
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


def test_noise_of_rows_that_report_is_that_of_the_linear_model() -> None:
    """Each fold by a fit of its own; sessions may differ in what is fitted: one parameter less makes less."""
    problem, fit, _ = campaign(0)
    parts = []
    for fold in range(5):
        train, report = (problem.take(np.nonzero(of)[0]) for of in (np.not_equal(LABELS, fold), np.equal(LABELS, fold)))
        parts.append((train, identify(train, fit.selected), report))
    assert reported_noise(parts)["position"] == pytest.approx(left_out(problem, fit), rel=0.02)
    fewer = [(train, identify(train, fit.selected[:-1]), report) for train, _, report in parts]
    assert 1.0 < reported_noise(fewer)["position"] < reported_noise(parts)["position"]


def test_rows_that_are_not_predicted_make_no_noise() -> None:
    """Out of reach of both legs, as where a rope is slack: such a row has no error either."""
    problem, fit, _ = campaign(0)
    train, report = problem.take(np.arange(9)), problem.take(np.arange(9, 12))
    readings = report.rows.readings.copy()
    readings[2] = 10.0
    lost = replace(report, rows=Rows.at(readings))
    expected = reported_noise([(train, identify(train, fit.selected), report.take(np.arange(2)))])
    assert reported_noise([(train, identify(train, fit.selected), lost)]) == pytest.approx(expected)


def test_noise_that_says_nothing_beside_the_ranges_is_all_left() -> None:
    """With errors of a metre a fit stays where the ranges are, and takes up nothing: not 6 / 24 of the noise."""
    problem, fit, _ = campaign(0)
    coarse = replace(problem, sigma=np.full_like(problem.sigma, 1.0))
    assert fitted_noise(coarse, fit)["position"] == pytest.approx(1.0, abs=1e-3)


def test_errors_that_noise_makes_are_not_unexplained() -> None:
    """One and a half standard deviations more than the mean are nothing, an error twice as large as the noise is."""
    problem, fit, held = campaign(0)
    expected = left_out(problem, fit)

    def unexplained(square: float) -> float:
        errors = {"position": replace(held.after["position"], rms=SIGMA * np.sqrt(2 * square))}
        return evidence_of(problem, fit, errors, False, held.noise).unexplained.get("position", 0.0)

    assert unexplained(expected * (1 + 1.5 * expected * np.sqrt(2 / (2 * POINTS)))) == 0
    assert unexplained(expected + 4) == pytest.approx(2 * SIGMA, rel=0.01)


@pytest.mark.slow
def test_one_in_twenty_tables_of_noise_leaves_something() -> None:
    """150 campaigns; 12 % did when noise was thought to make 1 + p / n. Their size is that of the linear model."""
    made = [campaign(seed) for seed in range(150)]
    ratio = [held.after["position"].criterion / (2 * POINTS * SIGMA**2) / held.noise["position"] for *_, held in made]
    assert np.mean(ratio) == pytest.approx(1, abs=4 * np.std(ratio) / np.sqrt(150))
    left = [evidence_of(problem, fit, held.after, False, held.noise).unexplained for problem, fit, held in made]
    assert np.mean([bool(each) for each in left]) == pytest.approx(0.05, abs=0.05)


def test_noise_of_fitted_rows_is_that_of_the_linear_model() -> None:
    """What is known besides takes part: six parameters of which half is known already take less of it."""
    problem, fit, _ = campaign(0)
    whole = slopes(problem, fit).reshape(-1, 6)
    assert fitted_noise(problem, fit)["position"] == pytest.approx(1 - 6 / (2 * POINTS), abs=5e-3), "ranges say little"
    known = np.linalg.inv(whole.T @ whole)
    prior = prior_of_covariance(fit.selected, known, fit.values[[problem.model.names.index(n) for n in fit.selected]])
    again = replace(problem, prior=prior)
    fitted = identify(again, fit.selected)
    left = np.linalg.inv(np.eye(len(whole)) + whole @ known @ whole.T)
    assert left.trace() / len(whole) == pytest.approx(1 - 3 / (2 * POINTS), rel=1e-3)
    assert fitted_noise(again, fitted)["position"] == pytest.approx(left.trace() / len(whole), rel=1e-3)


def test_six_points_with_a_prior_leave_no_more_than_noise(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With more parameters than readings a fit takes less than all noise: something was said to be left every time."""
    monkeypatch.chdir(tmp_path)
    machine, left = str(MACHINES / "biglide.yaml"), 0
    old = write_table(tmp_path / "old.csv", "biglide", true_values("biglide", 3), 1, 60)
    assert run("calibrate", machine, old, "-o", "old.yaml", "-q", "--holdout", "none").code == 0
    for seed in range(12):
        six = write_table(tmp_path / "six.csv", "biglide", true_values("biglide", 3, l1=0.1e-3), 40 + seed, 6)
        asked = ("calibrate", machine, six, "--prior", "old.yaml", "--loosen", "l1", "-o", "new.yaml", "--force", "-q")
        assert run(*asked).code == 0
        left += "\nunexplained:" in Path("new.yaml").read_text()
    assert left <= 3


def test_improve_states_what_is_left_beyond_the_noise_of_rows_that_report(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A constant that is not looked for is left over; not where noise is said to make a million times its variance."""
    table = Path(write_table(tmp_path / "m.csv", "biglide", true_values("biglide", 3), 1, 60))
    head, *lines = table.read_text(encoding="utf-8").splitlines()
    bent = [line if k % 2 else shifted(line) for k, line in enumerate(lines)]
    table.write_text("\n".join([head, *bent, ""]), encoding="utf-8")
    better, left = tmp_path / "b.yaml", []
    for noise in (1.0, 1e6):
        monkeypatch.setattr(improved_files, "reported_noise", lambda parts, noise=noise: {"position": noise})
        done = run("improve", MACHINES / "biglide.yaml", table, "--only", "scale@q1", "-q", "--force", "-o", better)
        assert done.code == 1
        _, _, after = better.with_name("b.params.yaml").read_text(encoding="utf-8").partition("unexplained:")
        left.append("position:" in after)
    assert left == [True, False]


def shifted(line: str) -> str:
    """A row of a table, its last reading 0.2 mm larger."""
    *others, last = line.split(",")
    return ",".join([*others, f"{float(last) + 0.2:.6f}"])
