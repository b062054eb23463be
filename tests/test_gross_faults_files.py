"""Gross mistakes in files: told by `check` and `calibrate`, with their lines."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.calibration.measured_problem import problem_of
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.gross_errors.hints import copied_rows
from pkmcal_cli.loading.load_machine import load_machine, load_measurements
from tests.campaigns import shipped
from tests.command import SCISSORS, TRIGLIDE, run


@pytest.fixture(autouse=True)
def _in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.mark.slow
def test_rotated_drives_are_told_before_the_fit_ends_badly() -> None:
    text = Path(TRIGLIDE).with_suffix(".csv").read_text()
    Path("m.csv").write_text(text.replace("q1 [mm],q2 [mm],q3 [mm]", "q3 [mm],q1 [mm],q2 [mm]"))
    done = run("calibrate", TRIGLIDE, "m.csv", "--holdout", "none")
    told, *_ = done.err.splitlines()
    assert "out of reach" in done.err.partition(told)[2]
    assert told.startswith("warning: `q1`, `q2` and `q3` look shifted by one column (`q1` has the readings of `q2`, ")
    assert told.endswith("after correction") and "residual rms" in told
    assert run("check", TRIGLIDE, "m.csv").code == 1


def test_a_reading_that_was_left_out_is_told_with_its_lines() -> None:
    head, *lines = Path(SCISSORS).with_suffix(".csv").read_text().splitlines()
    cells = [line.split(",") for line in lines]
    moved = [a[:5] + b[5:] for a, b in pairwise(cells[30:])]  # the 31st reading is missing
    Path("m.csv").write_text("\n".join([head, *lines[:30], *(",".join(row) for row in moved)]))
    told = run("check", SCISSORS, "m.csv").err
    assert "the readings look shifted by one row from m.csv:33 (32) to m.csv:80 (79): `" in told
    assert "when each row takes the readings of the row before" in told


def test_copies_are_told_and_are_no_fault() -> None:
    head, *lines = Path(SCISSORS).with_suffix(".csv").read_text().splitlines()
    Path("m.csv").write_text("\n".join([head, *lines, f"again,{lines[6].partition(',')[2]}"]))
    words = "1 row is an exact copy of another (m.csv:8 (7) and m.csv:82 (again))"
    done = run("check", SCISSORS, "m.csv", "--json")
    assert done.code == 0 and done.json["measurements"]["warnings"][0].startswith(words)
    fit = run("calibrate", SCISSORS, "m.csv", "--holdout", "none")
    assert f"warning: {words}" in done.err and f"warning: {words}" in fit.err


def test_repetitions_that_agree_by_rounding_are_no_copies() -> None:
    """Ten repetitions of eight poses, written to 1 um where sigma is 0.5 um: many agree."""
    loaded = load_machine(SCISSORS)
    plan, rng = shipped("scissors"), np.random.default_rng(2)
    poses = np.repeat(np.arange(0, 80, 10), 10)
    true = plan.take(poses).measured(plan.model.nominal, rng)
    coarse = replace(true, readings=np.round(true.readings, 6))
    Path("m.csv").write_text(csv_text(coarse))
    data = load_measurements(loaded, ("m.csv",))
    assert len(np.unique(coarse.readings, axis=0)) < len(poses)
    assert copied_rows(problem_of(loaded.model, data), data) == ()


def csv_text(problem: Problem) -> str:
    names = [a.name for a in problem.model.actuators] + [c.name for c in problem.model.channels]
    rows = np.hstack([problem.rows.readings, problem.readings]) * 1e3
    return "\n".join([",".join(f"{n} [mm]" for n in names), *(",".join(f"{v:.6f}" for v in row) for row in rows)])


@pytest.mark.parametrize(
    ("name", "factor", "words"), [("sign", -1.0, "reversed in sign"), ("unit", 1e-3, "1000 times")]
)
def test_a_column_with_cells_in_few_rows_is_told(name: str, factor: float, words: str) -> None:
    """A column that is wrong in each of its cells, which stand in 5 rows of 80."""
    head, *lines = Path(SCISSORS).with_suffix(".csv").read_text().splitlines()
    cells = [line.split(",") for line in lines]
    k = head.split(",").index("x [mm]")
    for row, cell in enumerate(cells):
        cell[k] = repr(factor * float(cell[k])) if row in (0, 20, 40, 60, 78) else ""
    Path("m.csv").write_text("\n".join([head, *(",".join(cell) for cell in cells)]))
    told = run("check", SCISSORS, "m.csv").err
    assert "`x` " in told and words in told
