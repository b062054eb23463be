"""A step in time of all readings: told alone, by time wherever rows stand, and neither a drift nor an effect."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.loading.covariates import with_directions
from pkmcal_cli.prediction import Rows
from tests.command import TRIGLIDE, clean, run
from tests.computed_once import run_once
from tests.truth.campaigns import Planted, Scenario, campaign

pytestmark = pytest.mark.usefixtures("unsized")

SEED, ROWS, FIRST = 6, 120, 71  # of 120 rows, the first after the step
SHIFT = 0.05  # mm


def moved(planted: tuple[Planted, ...], shift: Callable[[Array], Array], stream: int = 0) -> list[list[str]]:
    """A table of the Triglide by an independent simulator, x of its rows shifted by a function of time (0 ... 1).

    `stream`: of other poses. Without temperatures and sessions: no drift or set-up is an effect that could be tested.
    """
    text = campaign("triglide", list(planted), SEED, scenario=Scenario(stream=stream)).csv_text()
    rows = [line.split(",") for line in text.splitlines() if not line.startswith("#")]
    kept = [k for k, name in enumerate(rows[0]) if not name.startswith(("T", "session"))]
    rows = [[row[k] for k in kept] for row in rows[: ROWS + 1]]
    x, time = (next(k for k, n in enumerate(rows[0]) if n.split(" ")[0] == name) for name in ("x", "time"))
    for k, row in enumerate(rows[1:]):
        row[time] = str(90 * k)
        row[x] = f"{float(row[x]) + float(shift(np.array(k / (ROWS - 1)))):.6f}"
    return rows


def step(u: Array) -> Array:
    return SHIFT * (u * (ROWS - 1) >= FIRST)


def written(file: Path, rows: list[list[str]]) -> Path:
    file.write_text("".join(",".join(row) + "\n" for row in rows), encoding="utf-8")
    return file


def test_a_step_is_told_alone(tmp_path: Path) -> None:
    """No effect that imitates a part of it, none of its harmonics; and what is to be done."""
    table = written(tmp_path / "t.csv", moved((), step))
    done = clean(run_once("diagnose", TRIGLIDE, table, "--json"))
    assert done.json["verdict"] == "unknown" and done.json["effects"] == []
    (unknown,) = done.json["unknown"]
    assert unknown["depends_on"] == "time" and unknown["hint"] == f"step at row {FIRST + 1} after {90 * FIRST} s"
    assert f"a step at row {FIRST + 1} after {90 * FIRST} s describes it" in done.err
    assert "session (column `session`)" in done.err and "compensation table" not in done.err


@pytest.mark.slow
def test_a_step_is_not_improved_upon(tmp_path: Path) -> None:
    table = written(tmp_path / "t.csv", moved((), step))
    assert clean(run_once("improve", TRIGLIDE, table, "--json")).json["steps"] == []


@pytest.mark.slow
def test_rows_out_of_order_are_judged_by_time(tmp_path: Path) -> None:
    head, *rows = moved((), step)
    first = rows[FIRST]
    np.random.default_rng(1).shuffle(rows)
    done = clean(run_once("diagnose", TRIGLIDE, written(tmp_path / "t.csv", [head, *rows]), "--json"))
    (unknown,) = done.json["unknown"]
    assert unknown["hint"] == f"step at row {rows.index(first) + 1} after {90 * FIRST} s"
    assert "the order of the rows is taken from `time`" in done.err


@pytest.mark.slow
def test_what_is_there_besides_comes_out_as_advised(tmp_path: Path) -> None:
    """Rows from the step on as another session: the set-up and the play of a drive are found, and nothing unknown."""
    rows = moved((Planted("backlash", "q1", {"b": 60e-6}),), step)
    table = written(tmp_path / "t.csv", rows)
    done = clean(run_once("diagnose", TRIGLIDE, table, "--json"))
    assert [u["hint"].partition(" after")[0] for u in done.json["unknown"]] == [f"step at row {FIRST + 1}"]
    sessions = ["session", *("ab"[k >= FIRST] for k in range(ROWS))]
    table = written(tmp_path / "s.csv", [[*row, name] for row, name in zip(rows, sessions, strict=True)])
    done = clean(run_once("diagnose", TRIGLIDE, table, "--json"))
    assert {(e["effect"], e["at"]) for e in done.json["effects"]} == {("backlash", "q1"), ("resetup", "b")}
    assert done.json["unknown"] == []


@pytest.mark.slow
def test_a_smooth_drift_is_no_step_and_told_alone_too(tmp_path: Path) -> None:
    table = written(tmp_path / "t.csv", moved((), lambda u: 2 * SHIFT * u))
    done = clean(run_once("diagnose", TRIGLIDE, table, "--json"))
    assert [(u["depends_on"], u["hint"]) for u in done.json["unknown"]] == [("time", "smooth drift")]
    assert done.json["effects"] == []


@pytest.mark.parametrize("size", [0.03, 0.05])
def test_a_small_drift_that_settles_is_no_step(tmp_path: Path, size: float) -> None:
    """By 26 and 44 um, of 10 um of noise: a curve has so many numbers that a step, of one, had more evidence."""
    table = written(tmp_path / "t.csv", moved((), lambda u: size * (1 - np.exp(-2.1 * u))))
    done = clean(run_once("diagnose", TRIGLIDE, table, "--json"))
    assert [(u["depends_on"], u["hint"]) for u in done.json["unknown"]] == [("time", "smooth drift")]
    assert "Something was moved" not in done.err


# --- the order of the rows -----------------------------------------------------------------
def test_directions_of_approach_follow_time() -> None:
    """Whatever the order in which rows stand: those of the same rows in the order of time, of each session."""
    rng = np.random.default_rng(2)
    readings, time = rng.normal(size=(40, 2)), np.arange(40.0)
    second = (time >= 25).astype(float)
    sessions = {"session.a": 1.0 - second, "session.b": second}
    rows = replace(Rows.at(readings), columns={"time": time, **sessions})
    straight = with_directions(rows, ["q1", "q2"]).columns
    assert set(np.unique(straight["dir.q1"])) == {-1, 0, 1}
    order = rng.permutation(40)
    mixed = with_directions(rows.take(order), ["q1", "q2"]).columns
    for name in ("dir.q1", "dir.q2"):
        assert (mixed[name] == straight[name][order]).all()
    still = replace(rows.take(order), columns={k: v[order] for k, v in sessions.items()})
    assert not (with_directions(still, ["q1"]).columns["dir.q1"] == straight["dir.q1"][order]).all()


def test_only_times_that_go_back_are_noted(tmp_path: Path) -> None:
    head, *rows = moved((), lambda u: 0 * u)
    straight = clean(run("calibrate", TRIGLIDE, written(tmp_path / "s.csv", [head, *rows])))
    back = clean(run("calibrate", TRIGLIDE, written(tmp_path / "b.csv", [head, *rows[::-1]])))
    assert "goes back" not in straight.err + straight.out
    assert "`time` goes back 119 times" in back.err + back.out
