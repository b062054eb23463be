"""Where an instrument stands, from readings in which coordinates are missing: a line of sight is cut now and then."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array, exp
from pkmcal_cli.calibration.frame_start import with_frames
from pkmcal_cli.prediction import Rows, predict
from tests.command import MACHINES, SCISSORS, run
from tests.support import model, overlay

TURN, SHIFT = np.array([[0.4, -2.1, 1.3]]), np.array([2.5, -1.2, 0.7])
DELTA = model(overlay("delta4", "sensors: {tracker: {frame: fitted}}\n"))


def readings(rows: int, turn: Array = TURN) -> tuple[Rows, Array]:
    """Rows of the delta, and what an instrument reads (N, 3) that is turned and shifted."""
    there = Rows.at(0.04 * np.random.default_rng(2).uniform(-1, 1, size=(rows, len(DELTA.actuators))))
    return there, predict(DELTA, DELTA.nominal, there).values @ exp(turn)[0].T + SHIFT


def place(rows: Rows, seen: Array) -> Array:
    """Turn and shift (6,) that are found."""
    found = with_frames(DELTA, rows, seen)
    by_name = found.by_name(found.nominal)
    return np.array([by_name[f"frame@tracker.{kind}{axis}"] for kind in "rt" for axis in "xyz"])


@pytest.mark.parametrize("seed", range(5))
def test_two_whole_points_and_some_coordinates_of_others_are_enough(seed: int) -> None:
    """Of 18 coordinates 13 are read, which is more than the six freedoms of a motion."""
    rows, seen = readings(6)
    assert np.isfinite(seen).all()
    for row, axis in zip((1, 2, 3), np.random.default_rng(seed).integers(0, 3, size=3), strict=True):
        seen[row, axis] = np.nan
    seen[4, :2] = np.nan
    assert place(rows, seen) == pytest.approx(np.concatenate([TURN[0], SHIFT]), abs=1e-9)


@pytest.mark.parametrize(("seed", "count"), [(9, 12), pytest.param(5, 60, marks=pytest.mark.slow)])
def test_any_turn_is_found_beside_errors_of_geometry(seed: int, count: int) -> None:
    """Eleven coordinates of six points, 0.1 mm off: from the axes as they are one in fifteen goes wrong."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        turn = rng.normal(size=(1, 3))
        turn *= rng.uniform(0, 3) / np.linalg.norm(turn)
        rows, seen = readings(6, turn)
        seen += 1e-4 * rng.normal(size=seen.shape)
        seen.ravel()[rng.permutation(18)[:7]] = np.nan
        assert np.abs(exp(place(rows, seen)[None, :3])[0] - exp(turn)[0]).max() < 0.05


def test_where_too_little_is_read_it_stays_where_it_is() -> None:
    """Two points may turn about their line; of one coordinate alone any number tells no place."""
    rows, seen = readings(8)
    for only in (np.arange(8)[:, None] < [[2, 2, 2]], np.ones((8, 1)) > [[0, 1, 1]]):
        assert not place(rows, np.where(only, seen, np.nan)).any()


def test_a_session_that_fixes_no_place_spoils_no_other(tmp_path: Path) -> None:
    """A single row of a third session, with its plate elsewhere: two readings, and three unknowns of its frame."""
    machine, table = tmp_path / "m.yaml", tmp_path / "t.csv"
    machine.write_text(f"extends: {SCISSORS}\nsensors: {{grid: {{frame: fitted per session}}}}\n", encoding="utf-8")
    lines = (MACHINES / "scissors.csv").read_text(encoding="utf-8").splitlines()
    rows = [r for r in csv.reader(lines) if r and not r[0].startswith("#")]
    x, y = (next(k for k, h in enumerate(rows[0]) if h.split(" ")[0] == c) for c in "xy")
    for row in rows[-1:]:
        row[x], row[y] = str(float(row[y]) + 300.0), str(250.0 - float(row[x]))
    body = [[*rows[0], "session"], *([*row, "b" if row is rows[-1] else "a"] for row in rows[1:])]
    with table.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows(body)
    done = run("calibrate", machine, table, "--json")
    assert done.code == 0 and "far from what" not in done.err and "converged" in done.err
    before = done.json["before"]["position"]
    assert before["unit"] == "mm" and before["rms"] < 0.2, "without the row whose frame is not known"
    assert run("check", machine, table).err.count("farther") == 0


def test_sessions_that_an_instrument_did_not_read_have_no_lines(tmp_path: Path) -> None:
    """A camera reads beside the plate in the first of three sessions: the frames of the others are one line."""
    machine, table = tmp_path / "m.yaml", tmp_path / "t.csv"
    camera = "{kind: tcp, at: platform, reads: [x, y], sigma: 10 um, frame: fitted per session}"
    machine.write_text(f"extends: {SCISSORS}\nsensors: {{camera: {camera}}}\n", encoding="utf-8")
    lines = (MACHINES / "scissors.csv").read_text(encoding="utf-8").splitlines()
    rows = [r for r in csv.reader(lines) if r and not r[0].startswith("#")]
    x, y = (next(k for k, h in enumerate(rows[0]) if h.split(" ")[0] == c) for c in "xy")
    heads = [f"grid.{h}" if h[0] in "xy" else h for h in rows[0]]
    body = [[*heads, "session", "camera.x [mm]", "camera.y [mm]"]]
    for k, row in enumerate(rows[1:]):
        seen = [row[y], str(-float(row[x]))] if 3 * k < len(rows) else ["", ""]
        body.append([*row, "abc"[3 * k // len(rows)], *seen])
    with table.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows(body)
    done = run("calibrate", machine, table, "--holdout", "none")
    assert "frame@camera.tx[a]" in done.err and "frame@camera.tx[b]  " not in done.err
    assert done.err.count("have no effect on these readings") == 1 and "and 3 more have no effect" in done.err
