"""Drives whose log begins a row late, or loses a reading on the way: told, and the table put right."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.gross_errors.late_drives import explain_late_drives
from pkmcal_cli.gross_errors.plausibility import Hint, MovedReadings
from pkmcal_cli.gross_errors.row_shift import apply_shifts
from tests.command import MACHINES, clean, run

pytestmark = pytest.mark.usefixtures("unsized")


def late(column: Array, rows: int = 1) -> Array:
    """The log begins with what was read before the first row."""
    return np.concatenate([column[:1] + np.arange(rows) + 30.0, column[:-rows]])


def lost(row: int) -> Callable[[Array], Array]:
    """One row was not logged, and all that follow moved up; the last one is read again."""
    return lambda column: np.concatenate([np.delete(column, row), column[-1:]])


def changed(
    folder: Path, machine: str, drive: str, change: Callable[[Array], Array], without: tuple[str, ...] = ()
) -> Path:
    """A shipped table with one column changed, and without others."""
    lines = [r for r in (MACHINES / f"{machine}.csv").read_text(encoding="utf-8").splitlines() if r[:1] != "#"]
    head, *rows = csv.reader(lines)
    k = [h.split(" ")[0] for h in head].index(drive)
    for row, value in zip(rows, change(np.array([float(row[k]) for row in rows])).tolist(), strict=True):
        row[k] = repr(value)
    kept = [i for i, h in enumerate(head) if h.split(" ")[0] not in without]
    file = folder / f"{machine}.csv"
    file.write_text("\n".join(",".join(row[i] for i in kept) for row in [head, *rows]) + "\n", encoding="utf-8")
    return file


@pytest.mark.parametrize(("machine", "drive"), [("delta4", "q4"), ("gantry", "Y1"), ("biglide", "q1")])
def test_a_drive_that_is_a_row_late_is_named_and_put_right(machine: str, drive: str, tmp_path: Path) -> None:
    """By that the tables are the shipped ones, but for the last row: clean. Another name for it mends nothing."""
    table = changed(tmp_path, machine, drive, late)
    done = clean(run("diagnose", MACHINES / f"{machine}.yaml", table, "--json"))
    assert done.json["verdict"] == "measurement_fault" and done.json["effects"] == []
    assert f"the readings of `{drive}` look shifted by one row: at the measured poses" in done.err
    assert "takes that of the next row" in done.err
    assert done.code == 1 and done.json["chi2_per_dof_after"] < 1.3


def test_a_reading_that_was_lost_on_the_way(tmp_path: Path) -> None:
    """Row 16; where the rows begin that are put right, a sample of them leaves open by some."""
    table = changed(tmp_path, "delta4", "q4", lost(15))
    done = clean(run("diagnose", MACHINES / "delta4.yaml", table, "--json"))
    (line,) = [x for x in done.err.splitlines() if x.startswith("warning") and "look shifted" in x]
    assert "`q4` look shifted by one row from " in line and "takes that of the row before" in line
    assert 17 <= int(line.split("delta4.csv:")[1].split()[0]) <= 22
    assert done.json["verdict"] == "measurement_fault" and done.json["chi2_per_dof_after"] < 1.3


def test_a_reading_that_was_lost_near_the_end(tmp_path: Path) -> None:
    """Of the last rows a sample of all has too few."""
    done = run("check", MACHINES / "biglide.yaml", changed(tmp_path, "biglide", "q1", lost(40)))
    assert "biglide.csv:42 (41) on: the readings of `q1` look shifted by one row" in done.err


def test_where_no_pose_is_measured_it_is_seen_by_predicting(tmp_path: Path) -> None:
    """Two coordinates of three."""
    table = changed(tmp_path, "delta4", "q4", late, without=("z",))
    done = clean(run("diagnose", MACHINES / "delta4.yaml", table, "--json"))
    assert "`q4` looks shifted by one row (each row with the reading of the next row)" in done.err
    assert done.json["verdict"] == "measurement_fault" and done.json["chi2_per_dof_after"] < 1.3


def told(readings: Array, expected: Array, rows: Array, sessions: Array) -> dict[str, list[int]]:
    """Drives, with the shifts that put them right; by these they read what they should."""
    names = [f"q{k + 1}" for k in range(readings.shape[1])]
    words = {"names": names, "units": ["mm"] * len(names)}
    found = explain_late_drives(readings, expected, rows, sessions, row_origin=str, **words)
    out: dict[str, list[int]] = {}
    for hint in found.hints:
        for moved in hint.moved:
            k = names.index(moved.names[0])
            out.setdefault(moved.names[0], []).append(moved.shift)
            right = apply_shifts(readings[:, [k]], sessions, [(moved.shift, moved.first, moved.unsure)])[rows, 0]
            here = (sessions[rows] == sessions[moved.first]) & (rows >= moved.first) & np.isfinite(right)
            assert np.abs(right - expected[:, k])[here].max() < 1e-3
            assert np.abs(found.corrected[:, k] - expected[:, k])[here].max() < 1e-3
    return out


def test_drives_and_sessions_are_judged_by_themselves() -> None:
    rng = np.random.default_rng(3)
    true, sessions = rng.uniform(0.1, 0.9, (60, 4)), np.repeat([0, 1], 30)
    readings = true + 1e-4 * rng.standard_normal(true.shape)
    for session in (0, 1):
        part = slice(30 * session, 30 * session + 30)
        readings[part, 1] = late(readings[part, 1])
    readings[30:, 2] = late(readings[30:, 2], 2)
    rows = np.arange(1, 60, 2)
    assert told(readings, true[rows], rows, sessions) == {"q2": [1, 1], "q3": [2]}


def test_what_is_an_alternative_mends_nothing() -> None:
    moved = (MovedReadings(("q1",), 1, 0, 1),)
    hint = Hint(kind="rows", names=("q1",), message="late", before=1.0, after=0.0, rows=(3, 4), moved=moved)
    assert hint.mends
    other, part = hint.unmended("alternatively, "), hint.of_some(np.arange(10, 20), "from row 10 on: ")
    assert other.message == "alternatively, late" and not other.mends
    assert part.message == "from row 10 on: late" and part.rows == (13, 14) and not part.mends


@pytest.mark.parametrize(("rows", "half"), [(24, 6), (60, 6), (600, 150)])
def test_on_a_raster_in_equal_steps_a_plainer_cause_is_left_to_the_search(rows: int, half: int) -> None:
    """There a zero, or a play where the drive turns, reads nearly the same as a row late; scales do not."""
    back_and_forth = 0.01 * np.abs((np.arange(rows) + half) % (2 * half) - half)
    up = 0.01 * np.arange(rows)
    moves = np.sign(np.diff(back_and_forth, prepend=0.01 * (half + 1)))
    true = np.stack([up, back_and_forth + 0.01 * moves, np.random.default_rng(1).uniform(0.1, 0.9, rows)], axis=1)
    readings = np.stack([up - 0.01, back_and_forth, 1.02 * true[:, 2]], axis=1)
    assert told(readings, true, np.arange(rows), np.zeros(rows, dtype=int)) == {}
    assert told(np.stack([late(c) for c in true.T], axis=1)[:, 2:], true[:, 2:], np.arange(rows), np.zeros(rows)) == {
        "q1": [1]
    }
