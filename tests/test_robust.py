"""Bad rows: found, weighed down, audited; intervals by profile and bootstrap; priors."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.bootstrap import _freedom, _roots, _times, bootstrap_intervals
from pkmcal_cli.calibration.complete_fit import FitOptions, calibrated
from pkmcal_cli.calibration.error_budget import error_budget
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.intervals import linear_intervals, profile_intervals
from pkmcal_cli.calibration.prior import prior_of_ranges
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.robust import identify_robustly, plain_fit, weights_of
from tests.campaigns import Plan, by_engine, shipped
from tests.command import HANGPRINTER, HANGPRINTER_DATA, SCISSORS, run
from tests.in_ci import in_ci
from tests.support import MACHINES

SECOND = HANGPRINTER_DATA.replace("2021-12-16", "2022-04-12")


@cache
def campaign(name: str, seed: int = 0) -> tuple[Plan, Array, Problem]:
    plan = by_engine(shipped(name))
    rng = np.random.default_rng(seed)
    true = plan.drawn(rng)
    return plan, true, plan.measured(true, rng)


def spoilt(problem: Problem, sigma: float, rows: list[int]) -> Problem:
    """Gross errors of 20 to 2000 standard uncertainties in the first channel."""
    readings = problem.readings.copy()
    readings[rows, 0] += sigma * np.geomspace(20, 2000, len(rows)) * np.resize([1, -1], len(rows))
    return replace(problem, readings=readings)


def in_std(plan: Plan, fit: Fit, true: Array) -> Array:
    return np.asarray((fit.values - true)[plan.index] / fit.std)


@pytest.mark.parametrize("loss", ["huber", "tukey"])
@pytest.mark.parametrize("name", ["scissors", "delta4"])
def test_bad_rows_do_not_bend_a_robust_fit(name: str, loss: str) -> None:
    plan, true, problem = campaign(name)
    rows = [3, 17, 40, 61]
    bad = spoilt(problem, float(plan.sigma[0]), rows)
    first = identify(bad, plan.selected)
    assert np.nanmax(np.abs(in_std(plan, first, true))) > 8, "least squares are bent"
    found = identify_robustly(bad, first, loss)  # type: ignore[arg-type]
    assert np.nanmax(np.abs(in_std(plan, found.fit, true))) < 4
    assert {d.row for d in found.doubtful if abs(d.deviation) > 6} == set(rows)
    assert {d.channel for d in found.doubtful if abs(d.deviation) > 6} == {0}


@pytest.mark.parametrize(
    ("loss", "uncertainty"),
    in_ci(
        ["squares-linear", "squares-bootstrap", "tukey-linear"],
        product(["squares", "huber", "tukey"], ["linear", "bootstrap"]),
    ),
)
def test_a_row_that_nothing_predicts_has_no_part_in_any_fit(loss: str, uncertainty: str) -> None:
    """It is named, and values, intervals and audit are those of the other rows."""
    plan, _, problem = campaign("triglide-nonredundant")
    positions = plan.positions.copy()
    positions[17, 0] -= 1.0
    problem = replace(problem, rows=replace(problem.rows, readings=positions))
    options, session = FitOptions(loss=loss, uncertainty=uncertainty, starts=1), np.zeros(len(problem), dtype=np.intp)
    nominal = problem.model.nominal
    found, rest = (calibrated(p, plan.selected, nominal, options, session) for p in (problem, problem.without([17])))
    assert list(found.robust.fit.failed) == [17] and not rest.robust.fit.failed
    assert found.robust.fit.values == pytest.approx(rest.robust.fit.values, rel=1e-12)
    assert [(d.row, d.channel) for d in found.robust.doubtful] == [(d.row, d.channel) for d in rest.robust.doubtful]
    np.testing.assert_allclose(found.intervals.low_high, rest.intervals.low_high, rtol=1e-9)


@pytest.mark.parametrize("channel", in_ci(["D"], "xyzD"))
def test_the_channel_that_is_wrong_is_named(channel: str) -> None:
    """Noise of the lines is common to all readings of a row: what is off is judged by what the others tell.

    20 mm, or 5 rad of the motor that is read only, are found again to the noise of what the others tell.
    """
    plan, _, problem = campaign("hangprinter", 1)
    k = [c.name for c in problem.model.channels].index(channel)
    size = 5.0 if channel == "D" else 0.02
    for row in (4, 17):
        bad = replace(problem, readings=problem.readings.copy())
        bad.readings[row, k] += size
        found = identify_robustly(bad, identify(bad, plan.selected), "tukey")
        worst = found.doubtful[0]
        assert (worst.row, worst.channel) == (row, k) and worst.weight < 1e-3
        assert abs(worst.off - size) < 4 * abs(worst.off / worst.deviation) * found.scale[k]


def test_the_audit_says_what_a_row_moves() -> None:
    """Leave the row out, or let it stay: the parameter that is told moves by what is told, to first order."""
    plan, _, problem = campaign("scissors")
    bad = spoilt(problem, float(plan.sigma[0]), [17])
    fit = identify(bad, plan.selected)
    told = plain_fit(bad, fit).doubtful[0]
    assert told.row == 17
    without = identify(bad.take(np.delete(np.arange(len(bad)), 17)), plan.selected)
    y_too = identify(replace(bad, measured=without_cell(bad, 17, 0)), plan.selected)
    k = plan.selected.index(told.moved[0])
    step = (fit.values - y_too.values)[plan.index][k] / np.sqrt(np.diag(y_too.covariance))[k]
    assert told.moved[1] == pytest.approx(step, rel=0.1) and without.status == "converged"


def without_cell(problem: Problem, row: int, channel: int) -> Array:
    measured = problem.measured.copy()
    measured[row, channel] = False
    return measured


def test_weights_are_those_of_the_books() -> None:
    assert weights_of("huber", np.array([0.0, 1.0, 2.69])) == pytest.approx([1, 1, 0.5])
    assert weights_of("tukey", np.array([0.0, 4.685 / 2, 5.0])) == pytest.approx([1, 0.5625, 0], abs=1e-6)


def test_the_bad_row_of_the_hangprinter_is_named() -> None:
    """Index 17 of 2022-04-12, line 19 of the file: 12 mm off."""
    done = run(
        "calibrate", HANGPRINTER, SECOND, "--select", "auto,R_*", "--holdout", "none", "--loss", "tukey", "--json"
    )
    assert done.code == 0, done.err
    assert {o["line"] for o in done.json["outliers"][:3]} == {19}
    assert done.json["outliers"][0]["weight"] < 1e-6


def test_gross_errors_are_told_without_a_robust_loss_too(tmp_path: pytest.TempPathFactory) -> None:
    lines = (MACHINES / "scissors.csv").read_text(encoding="utf-8").splitlines()
    row = lines[20].split(",")
    row[-1] = f"{float(row[-1]) + 0.4}"
    lines[20] = ",".join(row)
    table = tmp_path / "bad.csv"  # type: ignore[operator]
    table.write_text("\n".join(lines) + "\n", encoding="utf-8")
    done = run("calibrate", SCISSORS, table, "--holdout", "none")
    assert "1 gross outlier: `--loss tukey` down-weights outliers" in done.err
    assert "bad.csv:21" in done.err and "Uncertainties are computed with noise of " in done.err


def test_a_profile_of_a_nearly_linear_problem_is_that_of_the_covariance() -> None:
    plan, _, problem = campaign("scissors")
    fit, index = identify(problem, plan.selected), np.array(plan.index)
    budget = error_budget(problem, fit)
    linear, profile = linear_intervals(fit, budget, index), profile_intervals(problem, fit, budget, index)
    assert profile.low_high == pytest.approx(linear.low_high, abs=0.02 * float(np.nanmax(linear.std)) * 2)
    assert profile.remark == ""


def test_an_end_of_a_profile_is_where_chi_square_has_grown() -> None:
    """Hold the parameter at the told end, fit the others anew: chi-square grows by 1.96 squared."""
    plan, _, problem = campaign("hangprinter")
    fit, index = identify(problem, plan.selected), np.array(plan.index)
    assert not fit.directions.held.any()
    budget = error_budget(problem, fit)
    ends = profile_intervals(problem, fit, budget, index).low_high
    for k in (2, 11):
        wider = budget.std[k] / fit.std[k]
        for end in ends[k]:
            values = fit.values.copy()
            values[index[k]] = end
            others = tuple(n for n in plan.selected if n != plan.selected[k])
            assert identify(problem, others, values).chi2 - fit.chi2 == pytest.approx((1.96 * wider) ** 2, rel=0.01)


def test_a_bootstrap_needs_no_sigma() -> None:
    """Stated three times too small: the covariance is three times too sure, the bootstrap is not."""
    plan, _, problem = campaign("scissors")
    index, session = np.array(plan.index), np.zeros(len(problem), dtype=np.intp)
    right = identify(problem, plan.selected)
    doubtful = replace(problem, sigma=problem.sigma / 3)
    fit = identify(doubtful, plan.selected)
    assert not right.directions.held.any()
    boot = bootstrap_intervals(doubtful, fit, index, session, 0)
    assert fit.std == pytest.approx(right.std / 3, rel=0.01)
    assert np.median(boot.std / right.std) == pytest.approx(1.0, abs=0.15)
    assert np.median(error_budget(doubtful, fit).std / right.std) == pytest.approx(1.0, abs=0.15)


def test_degrees_of_freedom_of_a_variance_by_blocks() -> None:
    """The formula, and the variance itself, against twenty thousand drawn residuals; blocks of any leverage."""
    rng = np.random.default_rng(0)
    label = np.minimum(np.repeat(np.arange(14), 3), 12)[:40]
    q, _ = np.linalg.qr(rng.normal(size=(40, 5)) * np.exp(rng.normal(size=(40, 1))))
    by_score = rng.normal(size=(3, 5))
    roots = _roots(q, label, 13)
    errors = rng.normal(size=(20_000, 40))
    scores = _times(roots, (errors - errors @ q @ q.T).T)[:, :, None] * q[:, None]
    summed = np.stack([scores[label == g].sum(axis=0) for g in range(13)])  # (G, R, d)
    variance = ((summed @ by_score.T) ** 2).sum(axis=0)  # (R, p)
    assert variance.mean(axis=0) == pytest.approx((by_score**2).sum(axis=1), rel=0.02)
    freedom = 2 * variance.mean(axis=0) ** 2 / variance.var(axis=0)
    assert _freedom(q, roots, by_score) == pytest.approx(freedom, rel=0.05)


def test_a_prior_is_half_the_range() -> None:
    """Nothing measured of the lengths but what ranges say: the estimate is nominal, its uncertainty half the range."""
    plan, _, problem = campaign("triglide")
    blind = replace(problem, sigma=np.full(problem.sigma.shape, 1e3))
    fit = identify(replace(blind, prior=prior_of_ranges(plan.model, plan.selected)), plan.selected)
    assert fit.std == pytest.approx(plan.ranges / 2, rel=1e-6) and not fit.directions.null.any()
    assert fit.values[plan.index] == pytest.approx(plan.model.nominal[plan.index], abs=1e-9)
