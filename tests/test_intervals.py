"""Intervals where something is special: one parameter, bounds, priors beside a wrong sigma, lengths on the bench."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration import bootstrap
from pkmcal_cli.calibration.bootstrap import _blocks, bootstrap_intervals
from pkmcal_cli.calibration.error_budget import error_budget
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.intervals import profile_intervals
from pkmcal_cli.calibration.measured_problem import problem_of
from pkmcal_cli.calibration.prior import prior_of_ranges
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.robust import Loss, identify_robustly
from pkmcal_cli.calibration.selection import select
from pkmcal_cli.loading.load_machine import load_machine, load_measurements
from tests.campaigns import Plan, by_engine, shipped
from tests.command import MACHINES, run
from tests.in_ci import in_ci


@cache
def campaign(name: str, seed: int = 0) -> tuple[Plan, Problem]:
    plan, rng = by_engine(shipped(name)), np.random.default_rng(seed)
    return plan, plan.measured(plan.drawn(rng), rng)


def places(problem: Problem, fit: Fit) -> Array:
    return np.array([problem.model.names.index(n) for n in fit.selected])


@pytest.mark.parametrize("name", ["Ax", "Bz", "Dy"])
def test_the_profile_of_one_parameter_knows_the_errors_of_the_drives(name: str) -> None:
    """Ten times the camera's noise on the lines: with the drives' errors held the interval would be a tenth as wide."""
    _, problem = campaign("hangprinter")
    fit = identify(problem, (name,))
    assert fit.status == "converged"
    budget = error_budget(problem, fit)
    found = profile_intervals(problem, fit, budget, places(problem, fit)).std
    assert found == pytest.approx(budget.std, rel=0.1)  # as others are held, far from a good fit: bent


def test_a_profile_ends_at_a_bound() -> None:
    plan, problem = campaign("scissors")
    fit = identify(problem, plan.selected)
    high = fit.values[plan.index[0]] + 0.5 * fit.std[0]
    bounded = [replace(p, bounds=(-np.inf, high)) if p.name == plan.selected[0] else p for p in plan.model.parameters]
    problem = replace(problem, model=replace(problem.model, parameters=tuple(bounded)))
    again = identify(problem, plan.selected)
    found = profile_intervals(problem, again, error_budget(problem, again), places(problem, fit)).low_high[0]
    assert found[1] == high and found[0] == pytest.approx(fit.values[plan.index[0]] - 1.96 * fit.std[0], rel=0.01)


def test_what_ranges_know_is_not_widened_with_the_data() -> None:
    """Sigma stated a third: what data tell is three times less sure, what the range alone tells is half the range.

    In between it is the variance of the mean with weights as stated, by the law of propagation (GUM 5.2).
    """
    plan, right = campaign("triglide")
    names = tuple(plan.model.names)
    prior = prior_of_ranges(plan.model, names)
    problem = replace(right, sigma=right.sigma / 3, drive_sigma=right.drive_sigma / 3, prior=prior)
    fit = identify(problem, names)
    budget = error_budget(problem, fit)
    spread = budget.scales.typical_noise
    assert spread == pytest.approx(9, rel=0.3)
    both = fit.directions.vectors.T * fit.directions.singular_values**2 @ fit.directions.vectors  # in ranges
    information = both - 4 * np.eye(len(names))
    inverse = np.linalg.inv(information + 4 * np.eye(len(names)))
    own = (budget.scales.typical / 2) ** 2  # what offsets are, in ranges squared
    variance = inverse @ (spread * information + 16 * np.diag(own)) @ inverse
    std = np.sqrt(np.diag(variance)) * plan.model.ranges
    assert np.median(budget.std / std) == pytest.approx(1.08, abs=0.1)  # tails make them wider
    seen = budget.share_of_ranges < 0.5
    assert seen.any() and budget.std[seen] == pytest.approx(std[seen], rel=0.1)
    profile = profile_intervals(problem, fit, budget, places(problem, fit))
    assert profile.std == pytest.approx(budget.std, rel=0.03)
    assert not fit.directions.held.any()


def test_the_bootstrap_takes_what_the_ranges_know_as_it_is() -> None:
    plan, problem = campaign("triglide")
    blind = replace(problem, sigma=np.full(problem.sigma.shape, 1e3), prior=prior_of_ranges(plan.model, plan.selected))
    fit = identify(blind, plan.selected)
    found = bootstrap_intervals(blind, fit, places(blind, fit), np.zeros(len(blind)), 0)
    assert found.std == pytest.approx(plan.ranges / 2, rel=0.1)  # 1000 draws
    assert np.ptp(found.low_high, axis=1) / 2 == pytest.approx(1.96 * plan.ranges / 2, rel=0.15)


def test_the_bootstrap_draws_the_same_in_segments(monkeypatch: pytest.MonkeyPatch) -> None:
    """However many numbers fit into memory at a time."""
    _, problem = campaign("triglide")
    fit = identify(problem, select(problem.model, "auto"))
    whole = bootstrap_intervals(problem, fit, places(problem, fit), np.zeros(len(problem)), 0)
    monkeypatch.setattr(bootstrap, "_SEGMENT", 1700)
    parts = bootstrap_intervals(problem, fit, places(problem, fit), np.zeros(len(problem)), 0)
    np.testing.assert_allclose(parts.low_high, whole.low_high, rtol=1e-12)


def test_the_bootstrap_scales_what_the_ranges_know_as_a_fit_says() -> None:
    """Ranges that stand over the root of a spread of 4: nothing but the prior is known, and std is twice as large."""
    plan, problem = campaign("triglide")
    blind = replace(problem, sigma=np.full(problem.sigma.shape, 1e3), prior=prior_of_ranges(plan.model, plan.selected))
    fit, session = identify(blind, plan.selected), np.zeros(len(blind))
    plain, wide = (
        bootstrap_intervals(blind, f, places(blind, fit), session, 0).std for f in (fit, fit.with_spread(4.0))
    )
    assert wide == pytest.approx(2 * plain, rel=0.02)


@pytest.mark.parametrize("reading", [287.4, 287.95])
def test_a_length_on_the_bench_is_as_sure_as_stated_whatever_it_read(reading: float, tmp_path: Path) -> None:
    machine = tmp_path / "m.yaml"
    bench = f"rule: {{kind: bench, of: rod, reading: {reading}, sigma: 0.1 mm, sigma_is: exact}}"
    machine.write_text(f"extends: {MACHINES / 'delta-printer.yaml'}\nsensors: {{{bench}}}\n", encoding="utf-8")
    args = ("calibrate", machine, MACHINES / "delta-printer.csv", "--select", "all", "--holdout", "none", "--json")
    linear, drawn = (
        next(p for p in run(*args, *more).json["parameters"] if p["name"] == "rod")
        for more in ((), ("--uncertainty", "bootstrap"))
    )
    assert linear["std"] == pytest.approx(0.098, abs=0.001)
    assert drawn["std"] == pytest.approx(linear["std"], rel=0.1)


@pytest.mark.parametrize("loss", in_ci(["huber"], ["huber", "tukey"]))
def test_the_bootstrap_of_a_robust_fit(loss: Loss) -> None:
    """Weights that change with the parameters make steps longer: without bad rows as long as those by squares.

    Five campaigns, whose ratios scatter by 7 %; with the weights held they would average 0.85.
    """
    ratios = []
    for seed in range(5):
        plan, problem = campaign("scissors", seed)
        plain = identify(problem, plan.selected)
        index, session = places(problem, plain), np.zeros(len(problem))
        found = identify_robustly(problem, plain, loss)
        drawn = bootstrap_intervals(found.problem, found.fit, index, session, 0, found.gain)
        ratios.append(np.median(drawn.std / bootstrap_intervals(problem, plain, index, session, 0).std))
        assert (found.fit.std > plain.std).all(), "never narrower than what is stated"
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.06)


@pytest.mark.parametrize("loss", ["huber", "tukey"])
def test_a_wrong_length_on_the_bench_is_seen(loss: str, tmp_path: Path) -> None:
    """One reading says nothing of its own scale. Radius and tower angles known, heights to 1 um, rod 3 mm off."""
    machine = tmp_path / "m.yaml"
    text = "sensors: {probe: {sigma: 1 um}, rule: {kind: bench, of: rod, reading: 291, sigma: 50 um}}"
    machine.write_text(f"extends: {MACHINES / 'delta-printer.yaml'}\n{text}\n", encoding="utf-8")
    poses = tmp_path / "t.csv"
    done = run("simulate", machine, MACHINES / "delta-printer.csv", "-o", poses, "--noise", "declared", "-q")
    assert done.code == 0, done.err
    args = ("calibrate", machine, poses, "--select", "all,-radius", "--holdout", "none", "--json", "--loss", loss)
    result = run(*args).json
    (worst,) = result["bench"]
    assert worst["name"] == "rule" and abs(worst["deviation"]) > 20 and result["outliers"] == []


def test_degrees_of_freedom_count_what_is_known() -> None:
    """Every parameter costs one; what its range says gives one back."""
    plan, problem = campaign("scissors")
    count = len(plan.selected)
    assert identify(problem, plan.selected).dof == problem.count - count
    known = replace(problem, prior=prior_of_ranges(plan.model, plan.selected))
    assert identify(known, plan.selected).dof == problem.count


def test_an_excess_is_significant_at_one_percent() -> None:
    """Chi-square with 100 degrees of freedom is above 135.8 with a probability of 1 % (tables)."""
    plan, problem = campaign("scissors")
    fit = replace(identify(problem, plan.selected), dof=100)
    assert replace(fit, chi2=135.0).excess == 1.0
    assert replace(fit, chi2=136.5).excess == pytest.approx(1.365)


def test_rows_that_a_length_joins_are_one_block_of_the_bootstrap() -> None:
    loaded = load_machine(str(MACHINES / "belt-router.yaml"))
    problem = problem_of(loaded.model, load_measurements(loaded, [str(MACHINES / "belt-router.csv")]))
    partner, label = problem.rows.partner, _blocks(problem, np.zeros(len(problem)))
    assert partner is not None and (partner >= 0).sum() == 12
    np.testing.assert_array_equal(label[partner >= 0], label[partner[partner >= 0]])
    assert len(problem) - 12 <= len(np.unique(label)) < len(problem) - 6  # others stay apart
