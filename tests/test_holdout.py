"""Held-out error: who is held out with whom, that nothing leaks, and that noise gives what theory says."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.errors_before_after import error_figures
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.holdout import (
    cross_validate,
    enough_values,
    fold_labels,
    replicate_groups,
    validate,
)
from pkmcal_cli.calibration.identify import RowsFailed, identify
from pkmcal_cli.calibration.measured_problem import problem_of
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import evaluate, linearise
from pkmcal_cli.calibration.selection import select
from pkmcal_cli.language.machine_yaml import read_machine
from pkmcal_cli.tables.measurement_set import Measurements
from pkmcal_cli.tables.measurements import read_measurements
from tests.campaigns import by_engine, shipped
from tests.command import TRIGLIDE, TRIGLIDE_DATA, run
from tests.hangprinter_cases import SESSIONS
from tests.support import MACHINES, model

NAME = "triglide-nonredundant"


def table(*files: str, machine: str = NAME) -> tuple[Problem, Measurements]:
    """Shipped files as a problem."""
    found = read_measurements([MACHINES / f for f in files], read_machine(MACHINES / f"{machine}.yaml"))
    return problem_of(model(machine), found), found


def campaign(rows: Array, seed: int = 0) -> Problem:
    """Rows of the two-legged Triglide, measured with noise."""
    plan, rng = shipped(NAME).take(rows), np.random.default_rng(seed)
    return plan.measured(plan.drawn(rng), rng)


# who is held out with whom --------------------------------------------------------------------------------------------


def test_readings_of_one_pose_do_not_fall_apart() -> None:
    """77 poses, each visited twice within 40 um: less than a thousandth of the drives' spread, wherever they are."""
    problem = table("triglide.csv", machine="triglide")[0].take(np.arange(0, 231, 3))
    near = np.random.default_rng(0).uniform(-2e-5, 2e-5, problem.rows.readings.shape)
    both = np.vstack([problem.rows.readings, problem.rows.readings + near])
    twice = problem.take(np.tile(np.arange(len(problem)), 2))
    groups = replicate_groups(replace(twice, rows=replace(twice.rows, readings=both)))
    np.testing.assert_array_equal(groups[: len(problem)], groups[len(problem) :])
    assert len(np.unique(groups)) == len(problem)


def test_repeated_poses_stay_together() -> None:
    """Twelve poses, each measured four times in another order every time, set values alike to 1 um."""
    rng = np.random.default_rng(0)
    rows = np.concatenate([rng.permutation(12) for _ in range(4)])
    problem = campaign(np.arange(0, 228, 19))
    positions = problem.rows.readings[rows] + rng.uniform(-5e-7, 5e-7, (48, 2))
    problem = replace(problem.take(rows), rows=replace(problem.rows.take(rows), readings=positions))
    groups = replicate_groups(problem)
    assert len(np.unique(groups)) == 12
    for pose in range(12):
        assert len(np.unique(groups[rows == pose])) == 1
    _, measured = table(f"{NAME}.csv")
    for folds in (2, 5, 12):
        labels, words = fold_labels(str(folds), problem, measured)
        assert len(np.unique(labels)) == folds
        assert "repeated poses kept together" in words
        for pose in range(12):
            assert len(np.unique(labels[rows == pose])) == 1
    with pytest.raises(ValueError, match="13 folds"):
        fold_labels("13", problem, measured)
    with pytest.raises(ValueError, match="1 folds"):
        fold_labels("1", problem, measured)


def test_folds_are_of_like_size() -> None:
    """A few neighbours on the fine grid of 231 are as near as repeated poses, and go together."""
    problem, measured = table(f"{NAME}.csv")
    labels, _ = fold_labels("5", problem, measured)
    counts = np.bincount(labels)
    assert counts.sum() == 231
    assert counts.max() - counts.min() <= 4


def test_by_session() -> None:
    files = [f"hangprinter_{s}.csv" for s in SESSIONS]
    problem, measured = table(*files, machine="hangprinter")
    labels, words = fold_labels("session", problem, measured)
    assert labels.tolist() == [0] * 25 + [1] * 44
    assert words == "by session, 2 sessions"
    one = table(files[0], machine="hangprinter")
    with pytest.raises(ValueError, match="only one session"):
        fold_labels("session", *one)


def test_by_cells() -> None:
    """The grid of 6 by 10 positions falls in 4 by 4 cells, which do not overlap."""
    problem, measured = table("biglide.csv", machine="biglide")
    labels, words = fold_labels("cells", problem, measured)
    assert words == "by workspace cell, 16 cells"
    places = [problem.readings[labels == k] for k in range(16)]
    boxes = [(p.min(axis=0), p.max(axis=0)) for p in places]
    for k, (low, high) in enumerate(boxes):
        for other_low, other_high in boxes[:k]:
            assert (high < other_low).any() or (other_high < low).any()


def test_values_for_a_held_out_error_by_default() -> None:
    problem, selected = campaign(np.arange(9)), shipped(NAME).selected
    assert (problem.count, len(selected)) == (18, 6) and enough_values(problem, selected)
    assert not enough_values(problem.take(np.arange(8)), selected)


# nothing leaks --------------------------------------------------------------------------------------------------------


def test_figures_are_those_of_fits_without_the_fold() -> None:
    """Each fold predicted by a fit from nominal of the other rows only; gross errors in it change no parameter."""
    problem = campaign(np.arange(0, 230, 10))
    spoilt = problem.readings.copy()
    spoilt[::5] += 1e-3
    problem = replace(problem, readings=spoilt)
    names = shipped(NAME).selected
    labels = np.arange(len(problem)) % 5
    held = cross_validate(problem, identify(problem, names), labels, "by hand")
    squares = []
    for k in range(5):
        fit = identify(problem.take(np.nonzero(labels != k)[0]), names)
        part = problem.take(np.nonzero(labels == k)[0])
        squares.append((evaluate(part, fit.values).residual ** 2).sum(axis=1))
    by_hand = np.concatenate(squares)
    after = held.after["position"]
    assert held.folds == 5
    assert held.failed == 0
    assert after.criterion == pytest.approx(by_hand.sum(), rel=1e-9)
    assert after.rms == pytest.approx(np.sqrt(by_hand.mean()), rel=1e-9)
    assert after.largest == pytest.approx(np.sqrt(by_hand.max()), rel=1e-9)
    assert after.count == len(problem)


def test_what_a_fold_does_not_determine_stays_nominal() -> None:
    """Only the held-out rows see k1 (the others have no weight): what is predicted for them is the nominal machine."""
    plan = shipped("triglide")
    plan = by_engine(replace(plan, positions=plan.positions[::10] + np.array([0, 0, 3e-4])))  # the third drive pulls
    machine, count = plan.model, len(plan.positions)
    k1 = machine.names.index("k1")
    values = machine.nominal
    values[k1] *= 1.1
    late = np.arange(count) >= 16
    sigma = np.where(late, 1e-7, 1.0)[:, None] * np.ones(2)
    problem = plan.problem(plan.simulate(values), sigma=sigma)
    fit = identify(problem, ("k1",))
    assert fit.values[k1] == pytest.approx(values[k1], rel=1e-6)
    held = cross_validate(problem, fit, late.astype(np.intp), "by hand")
    nominal = (evaluate(problem, machine.nominal).residual[late] ** 2).sum()
    assert held.after["position"].criterion == pytest.approx(nominal, rel=1e-6)


def test_another_file() -> None:
    problem, _ = table("hangprinter_2021-12-16.csv", machine="hangprinter")
    other, _ = table("hangprinter_2022-04-12.csv", machine="hangprinter")
    fit = identify(problem, select(problem.model, "auto,R_low,R_high"))
    held = validate(other, problem.model, fit, "rows of another file")
    assert held.folds == 1
    assert held.before["length"].rms == pytest.approx(7.81e-3, rel=1e-3)
    assert held.after["length"].rms == error_figures(other, evaluate(other, fit.values))["length"].rms
    assert held.after["length"].rms > error_figures(problem, fit.after)["length"].rms


def test_the_command_holds_out(tmp_path: Path) -> None:
    """Folds by default, none with fewer than three values a parameter, and the reason for it."""
    machine, data = MACHINES / f"{NAME}.yaml", MACHINES / f"{NAME}.csv"
    heldout = run("calibrate", machine, data, "--json").json["heldout"]
    assert heldout["rms_before"] > heldout["rms_after"] > 0
    assert heldout["scheme"].startswith("5 folds")
    few = tmp_path / "few.csv"
    few.write_text("\n".join(data.read_text().splitlines()[:9]) + "\n")
    heldout = run("calibrate", machine, few, "--json").json["heldout"]
    assert heldout["rms_after"] is None
    assert "16 measured values for 6 parameters" in heldout["reason"]
    heldout = run("calibrate", machine, few, "--holdout", str(data), "--json").json["heldout"]
    assert heldout["rms_after"] > 0
    assert run("calibrate", machine, few, "--holdout", "session").code == 2


# what theory says -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class NoiseHeldOut:
    """Mean squares over those of the linear model, and its scatter by chance; held-out rms over the rule of thumb's."""

    over_theory: float
    fitted_over_theory: float
    scatter: float
    over_thumb: float


@cache
def noise_against_theory(count: int = 25, folds: int = 6) -> NoiseHeldOut:
    """36 points of the two-legged Triglide, six parameters, all seen."""
    plan = shipped(NAME).take(np.random.default_rng(0).permutation(231)[:36])
    plan = replace(plan, sigma=np.full(2, 1e-7))
    labels, n = np.arange(36) % folds, 72
    held, fitted = [], []
    for seed in range(count):
        rng = np.random.default_rng(seed)
        problem = plan.measured(plan.drawn(rng), rng)
        fit = identify(problem, plan.selected)
        assert not fit.directions.held.any()
        held.append(cross_validate(problem, fit, labels, "").after["position"].criterion)
        fitted.append(error_figures(problem, fit.after)["position"].criterion)
    near = linearise(problem, evaluate(problem, plan.model.nominal, plan.selected)).jacobian.reshape(36, 2, -1)
    expected = 0.0
    for k in range(folds):
        out, used = near[labels == k].reshape(-1, 6), near[labels != k].reshape(-1, 6)
        expected += len(out) + np.trace(out @ np.linalg.solve(used.T @ used, out.T))
    squares = np.array([np.mean(held), np.mean(fitted)]) / plan.sigma[0] ** 2
    thumb = n * (1 + 6 / (n * (1 - 1 / folds)))
    over = squares / [expected, n - 6]
    return NoiseHeldOut(float(over[0]), float(over[1]), np.sqrt(2 / (count * n)), float(np.sqrt(squares[0] / thumb)))


@pytest.mark.slow
def test_held_out_error_of_noise() -> None:
    """The linear model gives the expected square exactly: larger than that of noise, and the fit's is smaller.

    Within four standard deviations of chance (3 % in the square). The rule of thumb sigma sqrt(1 + p/n), n values in a
    fold's fit, leaves out that held-out points may lie outside the others: some per cent here.
    """
    found = noise_against_theory()
    assert found.over_theory == pytest.approx(1, abs=4 * found.scatter)
    assert found.fitted_over_theory == pytest.approx(1, abs=4 * found.scatter)
    assert found.over_thumb == pytest.approx(1, abs=2 * found.scatter + 0.02)


def test_a_holdout_that_is_none_is_refused(tmp_path: Path) -> None:
    """Words that are no scheme, and the very rows that are fitted: their error would say nothing."""
    word = run("calibrate", TRIGLIDE, TRIGLIDE_DATA, "--holdout", "sessions")
    assert word.code == 2 and "`sessions` is not a scheme\nhelp: did you mean `session`?" in word.err
    same = run("calibrate", TRIGLIDE, TRIGLIDE_DATA, "--holdout", TRIGLIDE_DATA)
    assert same.code == 2 and "are fitted" in same.err
    copy = tmp_path / "copy.csv"
    copy.write_bytes(Path(TRIGLIDE_DATA).read_bytes())
    assert run("calibrate", TRIGLIDE, TRIGLIDE_DATA, "--holdout", copy).code == 2


# what is held out is the estimate that was asked for ------------------------------------------------------------------


def test_folds_are_fitted_as_the_whole(tmp_path: Path) -> None:
    """Four grossly wrong rows bend a fold's fit by squares, not that with a robust loss."""
    bad = tmp_path / "bad.csv"
    lines = [line for line in Path(TRIGLIDE_DATA).read_text(encoding="utf-8").splitlines() if line[:1] != "#"]
    place = lines[0].split(",").index("x [mm]")
    for row in (9, 60, 120, 200):
        cells = lines[row].split(",")
        lines[row] = ",".join([*cells[:place], str(float(cells[place]) + 0.5), *cells[place + 1 :]])
    bad.write_text("\n".join(lines), encoding="utf-8")
    good = run("calibrate", TRIGLIDE, TRIGLIDE_DATA, "--holdout", "none", "--json").json["parameters"]
    right, held, moved = {p["name"]: p["value"] for p in good}, {}, {}
    for loss in ("squares", "tukey"):
        done = run("calibrate", TRIGLIDE, bad, "--holdout", "2", "--json", "--loss", loss)
        held[loss] = done.json["heldout"]["after"]["position"]
        moved[loss] = max(abs(p["value"] - right[p["name"]]) / p["std"] for p in done.json["parameters"])
    assert held["tukey"]["max"] == pytest.approx(0.5, rel=0.05), "wrong rows are off by what they are wrong, and noise"
    assert abs(held["squares"]["rms"] / held["tukey"]["rms"] - 1) > 1e-4, "another estimate has another error"
    assert moved["tukey"] < 0.5


def test_a_fold_that_cannot_begin_where_the_fit_began_begins_where_it_ended() -> None:
    """And if it cannot begin there either, it has failed, its rows are not predicted, and that is said."""
    (problem, measured), names = table(f"{NAME}.csv"), select(table(f"{NAME}.csv")[0].model, "auto")
    fit, nominal = identify(problem, names), problem.model.nominal
    labels, words = fold_labels("5", problem, measured)

    def unwilling(part: Problem, selected: tuple[str, ...], start: Array, _: object) -> Fit:
        if len(part) < len(problem) - 60 or (start == nominal).all():
            raise RowsFailed(evaluate(part, start))
        return identify(part, selected, start)

    held = cross_validate(problem, fit, labels, words, unwilling)
    plain = cross_validate(problem, fit, labels, words)
    assert held.failed == 0 and held.scheme == words
    assert held.after["position"].rms == pytest.approx(plain.after["position"].rms, rel=1e-6)
    held = cross_validate(problem, fit, (np.arange(231) >= 40).astype(np.intp), "by hand", unwilling)
    assert held.failed == 1 and held.scheme == "by hand; 191 of 231 rows could not be predicted"
    assert held.after["position"].count == 40
