"""Noise by repeated poses: right on average, a stated sigma that is wrong is found, copies and neighbours count not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import kstest

from pkmcal_cli.calibration.copies import copies
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.replicates import ReplicateNoise, repeated_poses, replicate_noise
from pkmcal_cli.prediction import Rows
from tests.campaigns import Plan, by_engine, shipped
from tests.command import SCISSORS, run


def plan_of(poses: int, times: int) -> Plan:
    """Some of the Scissors' poses, one round after the other."""
    plan = shipped("scissors")
    return by_engine(replace(plan, positions=np.tile(plan.positions[:: 80 // poses][:poses], (times, 1))))


def noises(problem: Problem, plan: Plan) -> tuple[ReplicateNoise, ...]:
    return replicate_noise(problem, identify(problem, plan.selected))


def test_mean_and_test_are_right() -> None:
    plan, rng = plan_of(16, 4), np.random.default_rng(0)
    values = plan.drawn(rng)
    found = [n for _ in range(40) for n in noises(plan.measured(values, rng), plan)]
    assert {n.degrees_of_freedom for n in found} == {48} and {n.n_groups for n in found} == {16}
    assert np.sqrt(np.mean([n.std**2 for n in found])) == pytest.approx(0.5e-6, rel=0.05)
    assert kstest([n.p_value for n in found], "uniform").pvalue > 0.01


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_a_wrong_sigma_is_found(factor: float) -> None:
    plan, rng = plan_of(16, 4), np.random.default_rng(1)
    problem = plan.measured(plan.drawn(rng), rng)
    for noise in noises(replace(problem, sigma=factor * problem.sigma), plan):
        assert noise.doubtful and noise.sigma == pytest.approx(factor * 0.5e-6)


def test_what_is_predicted_to_differ_is_taken_out() -> None:
    """Drives 10 um apart in one pose: readings differ twenty sigma."""
    plan, rng = plan_of(16, 4), np.random.default_rng(2)
    moved = replace(plan, positions=plan.positions + 1e-5 * rng.normal(size=plan.positions.shape))
    for noise in noises(by_engine(moved).measured(plan.drawn(rng), rng), plan):
        assert noise.degrees_of_freedom == 48 and not noise.doubtful


@pytest.mark.parametrize("repeats", [True, False])
def test_errors_of_drives_may_repeat_with_the_pose_or_not(repeats: bool) -> None:
    plan, rng = plan_of(16, 4), np.random.default_rng(3)
    plan = replace(plan, drive_sigma=np.full(4, 2e-6))
    error = 2e-6 * rng.normal(size=(16, 4))
    off = np.tile(error, (4, 1)) if repeats else 2e-6 * rng.normal(size=(64, 4))
    true = by_engine(replace(plan, positions=plan.positions + off)).simulate(plan.model.nominal)
    problem = plan.problem(true + plan.sigma * rng.normal(size=true.shape))
    for noise in noises(problem, plan):
        assert noise.p_value > 0.001


def test_copies_and_neighbours_do_not_count() -> None:
    plan = shipped("scissors")
    problem = plan.problem(plan.simulate(plan.model.nominal))
    doubled = Problem(
        model=problem.model,
        rows=Rows.at(np.vstack([problem.rows.readings] * 2)),
        readings=np.vstack([problem.readings] * 2),
        sigma=np.vstack([problem.sigma] * 2),
        drive_sigma=np.vstack([problem.drive_sigma] * 2),
        measured=np.vstack([problem.measured] * 2),
    )
    doubled = replace(doubled, copies=tuple(copies(doubled)))
    assert len(doubled.copies) == len(problem)
    assert (repeated_poses(doubled) == -1).all() and (repeated_poses(problem) == -1).all()
    lines = shipped("triglide")
    assert (repeated_poses(lines.problem(lines.simulate(lines.model.nominal))) == -1).all()


def test_poses_repeat_within_a_session_only() -> None:
    plan, rng = plan_of(16, 4), np.random.default_rng(4)
    problem = plan.measured(plan.model.nominal, rng)
    flags = {f"session.{k}": (np.arange(64) // 16 == k).astype(float) for k in range(4)}
    assert (repeated_poses(problem) >= 0).all()
    assert (repeated_poses(replace(problem, rows=replace(problem.rows, columns=flags))) == -1).all()


def test_the_command_says_it(tmp_path: Path) -> None:
    plan, rng = plan_of(16, 4), np.random.default_rng(5)
    problem = plan.measured(plan.drawn(rng), rng)
    names = [a.name for a in plan.model.actuators] + [c.name for c in plan.model.channels]
    table = tmp_path / "m.csv"
    rows = np.hstack([problem.rows.readings, problem.readings]) * 1e3
    head = ",".join(f"{n} [mm]" for n in names)
    table.write_text("\n".join([head, *(",".join(f"{v:.7f}" for v in row) for row in rows)]))
    done = run("calibrate", SCISSORS, table, "--json", "--holdout", "none")
    (x, y) = done.json["replicates"]
    assert (x["channel"], x["n_groups"], x["degrees_of_freedom"], x["unit"]) == ("x", 16, 48, "mm")
    assert x["sigma"] == pytest.approx(5e-4) and x["std"] == pytest.approx(5e-4, rel=0.3) and y["p_value"] > 0.01
    assert f"repeated poses: noise of x {1e3 * x['std']:.4g} um (48 degrees of freedom), stated 0.5 um; y " in done.err
