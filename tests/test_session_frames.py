"""Frames of many sessions: eliminated from a fit, and all is as if they were parameters like others."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.complete_fit import Calibration, FitOptions, calibrated
from pkmcal_cli.calibration.eliminated_frames import MANY, without_frames
from pkmcal_cli.calibration.error_budget import COVER, error_budget, held_parameters
from pkmcal_cli.calibration.expected_noise import fitted_noise, held_out_noise
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.prior import prior_of_covariance
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import evaluate
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import Request, Rows, predict
from pkmcal_cli.prediction.inverse_kinematics import drive_positions
from tests.command import run
from tests.support import model, overlay

BARE = model(overlay("triglide"))
RODS = ("l1", "l2", "l3")
CHOSEN = "auto,-xb1r,-xb2r,-xb3r,-yb1r,-yb2r,-yb3r"
SIGMA = 1e-6
SESSIONS, ROWS = 22, 6


def frames(seed: int, sessions: int = SESSIONS) -> Array:
    """Shifts and turns (S, 3) of an instrument, m and rad."""
    return np.random.default_rng(seed).normal(size=(sessions, 3)) * [3e-4, 3e-4, 1e-3]


def moved(points: Array, motion: Array) -> Array:
    """Points (n, 2) in the frame of an instrument: turned by the last number, then shifted."""
    c, s = np.cos(motion[2]), np.sin(motion[2])
    return np.asarray(points @ np.array([[c, s], [-s, c]]) + motion[:2])


def measured_by(
    machine: Model, names: tuple[str, ...], seed: int, noise: float = SIGMA, each: int = ROWS
) -> Problem:
    """A campaign by an instrument that is set up anew in each session, its rows in no order."""
    rng, count = np.random.default_rng(seed), len(names) * each
    values = BARE.nominal
    values[[BARE.names.index(n) for n in RODS]] += rng.normal(size=len(RODS)) * 3e-5
    poses = np.tile(BARE.tool.reference, (count, 1))
    poses[:, :2] = rng.uniform([0.25, 0.2], [0.65, 0.34], size=(count, 2))
    bare = Rows.at(drive_positions(BARE, poses).readings)
    there = predict(BARE, values, bare).values
    assert np.isfinite(there).all()
    session = rng.permutation(np.repeat(np.arange(len(names)), each))
    readings = np.array([moved(p[None], frames(seed, len(names))[s])[0] for p, s in zip(there, session, strict=True)])
    readings += noise * rng.normal(size=readings.shape)
    columns = {f"session.{name}": (session == k).astype(float) for k, name in enumerate(names)}
    every = machine.for_sessions(names)
    return Problem(
        model=every,
        rows=Rows(bare.readings, bare.forces, columns),
        readings=readings,
        sigma=np.full(readings.shape, SIGMA),
        drive_sigma=np.zeros(bare.readings.shape),
        measured=np.ones(readings.shape, dtype=bool),
    )


FITTED = "sensors: {tracker: {frame: fitted per session, sigma: 1 um}}\n"
PER_SESSION = model(overlay("triglide", FITTED))
NAMES = tuple(f"day {k}" for k in range(SESSIONS))


def of_frames(problem: Problem) -> tuple[str, ...]:
    """Names of the numbers of all frames."""
    return tuple(p.name for p in problem.model.parameters if p.session)


def campaign(seed: int) -> tuple[Problem, Calibration]:
    """A campaign, and its calibration with frames eliminated."""
    problem = measured_by(PER_SESSION, NAMES, seed)
    less, left = without_frames(problem, (*RODS, *of_frames(problem)), plain=True)
    return problem, calibrated(less, left, problem.model.nominal, FitOptions(), problem.rows.session)


@pytest.mark.parametrize("drives", [0.0, 2e-6], ids=["exact drives", "drives with errors"])
def test_a_fit_is_the_same_as_with_all_frames_as_parameters(drives: float) -> None:
    """Values, chi-square, degrees of freedom, and the covariance of the rods by noise."""
    problem = measured_by(PER_SESSION, NAMES, 3)
    problem = replace(problem, drive_sigma=np.full(problem.rows.readings.shape, drives))
    selected = (*RODS, *of_frames(problem))
    less, left = without_frames(problem, selected, plain=True)
    assert left == RODS and set(less.eliminated) == set(of_frames(problem))
    dense, eliminated = identify(problem, selected), identify(less, left)
    assert eliminated.selected == RODS and eliminated.status == "converged"
    assert not (dense.directions.held.any() or eliminated.directions.held.any())
    assert eliminated.values == pytest.approx(dense.values, abs=1e-13)
    assert (eliminated.dof, problem.count - len(selected)) == (dense.dof, dense.dof)
    assert eliminated.chi2 == pytest.approx(dense.chi2, rel=1e-9)
    assert eliminated.covariance == pytest.approx(dense.covariance[:3, :3], rel=1e-8)
    assert eliminated.shift == pytest.approx(dense.shift, abs=1e-12)
    one, other = identify(problem, selected, iterations=1), identify(less, left, iterations=1)
    assert other.values == pytest.approx(one.values, abs=1e-13), "frames follow each step"


def test_noise_is_judged_by_the_equations_that_frames_leave() -> None:
    """Twice the stated noise in 264 readings, of which 66 numbers of frames take their share."""
    problem = measured_by(PER_SESSION, NAMES, 11, noise=2 * SIGMA)
    less, left = without_frames(problem, (*RODS, *of_frames(problem)), plain=True)
    budget = error_budget(less, identify(less, left), held_parameters(less, left, ()))
    taken = len(of_frames(problem)) + len(RODS)
    fit = identify(less, left)
    left_over = fit.chi2 / (problem.count - taken)
    assert budget.scales.typical_noise == pytest.approx([left_over], rel=0.06), "what is stated counts ten more"
    assert set(budget.held).isdisjoint(less.eliminated) and set(budget.every).isdisjoint(less.eliminated)


def by_noise(less: Calibration, name: str) -> float:
    """Standard uncertainty of a number of a frame without what is held."""
    return float(np.sqrt(less.frames[name].std ** 2 - less.frames[name].by_held ** 2))


def test_frames_have_the_uncertainty_that_all_together_give_them() -> None:
    """The inverse of the normal matrix of all parameters, by differences of predictions; what held ones shift."""
    problem, less = campaign(3)
    fit, names, held = less.robust.fit, (*RODS, *of_frames(problem)), less.budget.held
    columns = []
    for name in (*names, *held):
        off, k = np.zeros(len(fit.values)), problem.model.names.index(name)
        step = off[k] = 1e-3 * problem.model.ranges[k]
        above, below = (predict(problem.model, fit.values + s * off, problem.rows).values for s in (1, -1))
        columns.append((above - below).ravel() / (2 * step * SIGMA))
    a, h = np.stack(columns[: len(names)], axis=1), np.stack(columns[len(names) :], axis=1)
    std = np.sqrt(np.diag(np.linalg.inv(a.T @ a)) * float(less.budget.noise_variances[0]))
    assert [by_noise(less, n) for n in of_frames(problem)] == pytest.approx(std[len(RODS) :], rel=1e-3)
    half = 0.5 * problem.model.ranges[[problem.model.names.index(n) for n in held]]
    by_half = np.linalg.lstsq(a, h * half, rcond=None)[0]  # what half a range of each shifts
    shifted = np.linalg.norm(by_half, axis=1)[len(RODS) :]
    factor = (np.array([less.frames[n].by_held for n in of_frames(problem)]) / shifted)[: 2 * SESSIONS]  # shifts
    assert factor == pytest.approx(np.full(len(factor), factor[0]), rel=0.01), "ranges of lengths, as they turned out"
    assert 1.0 < factor[0] < 2.0


@pytest.mark.parametrize("campaigns", [6, pytest.param(40, marks=pytest.mark.slow)])
def test_intervals_hold_planted_frames_and_rods(campaigns: int) -> None:
    """Of 66 numbers of frames and three of rods a campaign, 95 % are within their intervals: 3 std of the count."""
    inside, count = 0, 0
    for seed in range(100, 100 + campaigns):
        problem, less = campaign(seed)
        fit, rng = less.robust.fit, np.random.default_rng(seed)
        true = dict(zip(RODS, rng.normal(size=len(RODS)) * 3e-5, strict=True))
        index = {n: k for k, n in enumerate(problem.model.names)}
        off = [fit.values[index[n]] - problem.model.nominal[index[n]] - true[n] for n in RODS]
        std = list(less.budget.std_by_data)
        for name, motion in zip(NAMES, frames(seed), strict=True):
            for kind, number in zip(("tx", "ty", "rz"), motion, strict=True):
                parameter = f"frame@tracker.{kind}[{name}]"
                off.append(fit.values[index[parameter]] - number)
                std.append(by_noise(less, parameter))
        inside += int((np.abs(off) < COVER * np.array(std)).sum())
        count += len(off)
    assert abs(inside / count - 0.95) < 3 * np.sqrt(0.95 * 0.05 / count) + 0.01, "rods' errors are common to frames"


def test_the_derivative_by_a_shared_name_is_that_by_each_rows_own() -> None:
    problem = measured_by(PER_SESSION, NAMES, 5)
    values = problem.model.nominal + 1e-3
    shared = ("frame@tracker.tx", "frame@tracker.rz")
    single = tuple(f"{name}[{session}]" for name in shared for session in NAMES)
    each = predict(problem.model, values, problem.rows, Request(parameters=single)).jacobian
    once = predict(problem.model, values, problem.rows, Request(parameters=shared)).jacobian
    assert each is not None and once is not None
    assert once == pytest.approx(each.reshape(*each.shape[:2], 2, SESSIONS).sum(axis=3), abs=1e-15)
    assert np.count_nonzero(each[:, 0]) == len(problem) * 2, "each row depends on its own session's frame"


def brute_force(problem: Problem, values: Array, labels: Array) -> tuple[float, float]:
    """Mean squares of errors of fitted and held-out readings, in variances, by dense normal equations.

    Frames that no row outside the fold tells are fitted to the fold's own rows.
    """
    names = (*RODS, *of_frames(problem))
    jacobian = evaluate(problem, values, names).prediction.jacobian
    assert jacobian is not None
    rods = np.arange(len(names)) < len(RODS)
    known = np.diag(rods.astype(float))  # half ranges of the rods
    half = np.where(rods, 0.5 * problem.model.ranges[[problem.model.names.index(n) for n in names]], 1.0)
    a = jacobian.reshape(-1, len(names)) / SIGMA * half
    label = np.repeat(labels, 2)
    fitted = len(a) - float(np.trace(a @ np.linalg.solve(a.T @ a + known, a.T)))
    held_out = 0.0
    for fold in np.unique(labels):
        inside, outside = a[label == fold], a[label != fold]
        untold = ~outside.any(axis=0)
        some, own = inside[:, ~untold], inside[:, untold]
        used = outside[:, ~untold]
        left = np.eye(len(inside)) - own @ np.linalg.pinv(own)
        spread = some @ np.linalg.solve(used.T @ used + known[np.ix_(~untold, ~untold)], some.T)
        held_out += float(np.trace(left @ (np.eye(len(inside)) + spread) @ left))
    return fitted / len(a), held_out / len(a)


@pytest.mark.parametrize("by", ["rows", "sessions"])
def test_errors_by_noise_are_those_of_all_parameters_together(by: str) -> None:
    problem = measured_by(PER_SESSION, NAMES, 7)
    less, left = without_frames(problem, (*RODS, *of_frames(problem)), plain=True)
    fit = identify(less, left)
    labels = np.arange(len(problem)) % 5 if by == "rows" else problem.rows.session
    fitted, held_out = brute_force(problem, fit.values, labels)
    assert fitted_noise(less, fit)["position"] == pytest.approx(fitted, rel=1e-6)
    assert held_out_noise(less, fit, labels)["position"] == pytest.approx(held_out, rel=1e-6)


def test_what_is_not_plain_or_few_or_known_keeps_its_frames() -> None:
    problem = measured_by(PER_SESSION, NAMES, 3)
    selected = (*RODS, *of_frames(problem))
    assert without_frames(problem, selected, plain=False) == (problem, selected)
    assert without_frames(problem, selected[:-1], plain=True)[1] == selected[:-1], "one number is held"
    assert without_frames(replace(problem, method="linear"), selected, plain=True)[1] == selected
    frame = problem.model.names.index(selected[-1])
    known = prior_of_covariance(selected[-1:], np.array([[1e-8]]), problem.model.nominal[[frame]])
    assert without_frames(replace(problem, prior=known), selected, plain=True)[1] == selected
    few = measured_by(PER_SESSION, NAMES[: MANY // 3 - 1], 3)
    chosen = (*RODS, *of_frames(few))
    assert without_frames(few, chosen, plain=True) == (few, chosen)
    tape = model(overlay("triglide", FITTED.replace("}}", "}, tape: {kind: span, at: tcp, sigma: 1 um}}")))
    joined = replace(problem, model=tape.for_sessions(NAMES), rows=replace(problem.rows, partner=np.full(132, -1)))
    assert without_frames(joined, selected, plain=True)[1] == selected


def written(path: Path, problem: Problem, without: int | None = None) -> Path:
    """A table of a campaign; without the readings of one session, but one."""
    session = problem.rows.session
    with path.open("w", newline="", encoding="utf-8") as file:
        out = csv.writer(file)
        out.writerow(["q1 [mm]", "q2 [mm]", "q3 [mm]", "x [mm]", "y [mm]", "session"])
        seen = 0
        for drives, reading, s in zip(problem.rows.readings, problem.readings, session, strict=True):
            if s == without and (seen := seen + 1) > 1:
                continue
            out.writerow([*(1e3 * drives).tolist(), *(1e3 * reading).tolist(), NAMES[s]])
    return path


def test_the_command_tells_frames_as_ever(tmp_path: Path) -> None:
    """As with fewer sessions: rows of the table, JSON, a file that other commands read; a session of a single row."""
    machine = tmp_path / "m.yaml"
    machine.write_text(overlay("triglide", FITTED), encoding="utf-8")
    table = written(tmp_path / "t.csv", measured_by(PER_SESSION, NAMES, 3), without=4)
    found = tmp_path / "found.yaml"
    done = run("calibrate", machine, table, "--select", CHOSEN, "--json", "-o", found)
    assert done.code == 0, done.err
    rows = {row["name"]: row for row in done.json["parameters"]}
    assert len(rows) == len(RODS) + 3 * SESSIONS
    for name, motion in zip(NAMES, frames(3), strict=True):
        row = rows[f"frame@tracker.tx[{name}]"]
        if name == NAMES[4]:
            assert not row["identified"] and "too few readings" in row["reason"] and row["std"] is None
            continue
        assert row["identified"] and row["unit"] == "mm" and row["std"] > row["std_by_data"] > 0
        assert row["value"] == pytest.approx(1e3 * motion[0], abs=5 * row["std"])
        assert row["interval"][1] - row["value"] == pytest.approx(COVER * row["std"], rel=1e-6)
    file = yaml.safe_load(found.read_text(encoding="utf-8"))
    assert set(RODS) < set(file["data"]["names"]) and not any("frame@" in n for n in file["data"]["names"])
    kept = file["parameters"]
    assert kept["frame@tracker.rz[day 0]"]["identified"] and kept["frame@tracker.rz[day 0]"]["std"] > 0
    again = run("calibrate", machine, table, "-p", found, "--select", CHOSEN, "--json")
    assert again.code == 0 and again.json["chi2"] == pytest.approx(done.json["chi2"], rel=1e-6)
    lost = [f"frame@tracker.{number}[{NAMES[4]}]" for number in ("tx", "ty", "rz")]
    named = run("calibrate", machine, table, "--select", ",".join([CHOSEN, *lost]), "--holdout", "none")
    assert named.code == 1 and f"named in --select but undetermined: {', '.join(lost)}" in named.err
    doubted = tmp_path / "doubted.yaml"
    doubted.write_text(found.read_text(encoding="utf-8").replace("status: converged", "status: not_converged"))
    once_more = run("calibrate", machine, table, "-p", doubted, "--select", CHOSEN, "--json")
    assert once_more.code == 0 and "not_converged" in once_more.err, "nothing of it is kept that was in doubt"
