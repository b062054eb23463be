"""Drives that count from another zero or other steps, so far off that rows cannot be assembled: told before any fit."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.gross_errors.drive_zeros import explain_zeros
from tests.command import MACHINES, clean, run

pytestmark = pytest.mark.usefixtures("unsized")

MACHINE = MACHINES / "hexapod7.yaml"
Columns = dict[str, Array]


def changed(folder: Path, change: Callable[[Columns], None]) -> Path:
    """Every second row of the shipped table, with some columns changed."""
    lines = [line for line in (MACHINES / "hexapod7.csv").read_text(encoding="utf-8").splitlines() if line[:1] != "#"]
    head, *rows = csv.reader([lines[0], *lines[1::2]])
    columns = {h.split(" ")[0]: np.array([float(row[k]) for row in rows]) for k, h in enumerate(head)}
    change(columns)
    file = folder / "t.csv"
    table = np.array([*columns.values()]).T.tolist()
    file.write_text("\n".join([",".join(head), *(",".join(map(repr, row)) for row in table), ""]), encoding="utf-8")
    return file


def a_zero(columns: Columns) -> None:
    columns["q7"] += 10.0


def two_zeros(columns: Columns) -> None:
    columns["q2"] += 30.0
    columns["q5"] -= 18.0


def steps(columns: Columns) -> None:
    columns["q7"] *= 1.6


@pytest.mark.parametrize(
    ("change", "told", "left"),
    [
        (a_zero, {"q7": ("zero", 10.0)}, []),
        (two_zeros, {"q2": ("zero", 30.0), "q5": ("zero", -18.0)}, []),
        (steps, {"q7": ("steps", 1.6)}, ["scale@q7"]),
    ],
)
def test_what_was_planted_is_told_and_put_right(
    change: Callable[[Columns], None], told: dict[str, tuple[str, float]], left: list[str], tmp_path: Path
) -> None:
    """As well as lengths within 0.1 mm allow; with it put right the table is what it was, which is clean.

    What these lengths hide of wrong steps is found as such; a zero is one of the parameters.
    """
    done = clean(run("diagnose", MACHINE, changed(tmp_path, change), "--json"))
    assert done.code == 1 and ("besides, `" if left else "the measurement is at fault: `") in done.err
    assert [f"{e['effect']}@{e['at']}" for e in done.json["effects"]] == left
    seen = {}
    for hint in (line for line in done.err.splitlines() if line.startswith("warning: ")):
        if zero := re.search(r"`(\w+)` reads (\S+) mm (more|less) .*is its zero right", hint):
            seen[zero[1]] = ("zero", float(zero[2]) * (1 if zero[3] == "more" else -1))
        if count := re.search(r"`(\w+)` reads (\S+) times .*are its steps right", hint):
            seen[count[1]] = ("steps", float(count[2]))
    assert {drive: kind for drive, (kind, _) in seen.items()} == {drive: kind for drive, (kind, _) in told.items()}
    for drive, (kind, size) in told.items():
        assert abs(seen[drive][1] - size) < (0.2 if kind == "zero" else 0.005), seen


def test_calibrate_tells_it_and_looks_no_further(tmp_path: Path) -> None:
    done = run("calibrate", MACHINE, changed(tmp_path, a_zero))
    assert done.code == 3 and "`q7` reads 9.9" in done.err and "is its zero right" in done.err
    assert "further starts" not in done.err


def test_check_tells_it_too(tmp_path: Path) -> None:
    done = run("check", MACHINE, changed(tmp_path, a_zero))
    assert done.code != 0 and "`q7` reads 9.9" in done.err


def mixed_up(columns: Columns) -> None:
    """Poses of other rows."""
    order = np.random.default_rng(5).permutation(len(columns["q1"]))
    for name in ("x", "y", "z", "rx", "ry", "rz"):
        columns[name] = columns[name][order]


def small(columns: Columns) -> None:
    """Two ranges: all rows are predicted."""
    columns["q7"] += 0.2


@pytest.mark.parametrize("change", [mixed_up, small])
def test_nothing_of_the_sort_is_told_where_it_is_not_so(change: Callable[[Columns], None], tmp_path: Path) -> None:
    done = run("check", MACHINE, changed(tmp_path, change))
    assert "at the measured poses" not in done.err


def test_a_zero_by_which_rows_are_predicted_is_left_to_the_search(tmp_path: Path) -> None:
    """Of the Triglide, 10 mm: the machine strains, and a fit tells the zero with its uncertainty."""
    lines = [line for line in (MACHINES / "triglide.csv").read_text(encoding="utf-8").splitlines() if line[:1] != "#"]
    head, *rows = csv.reader([lines[0], *lines[1::8]])
    k, table = head.index("q1 [mm]"), tmp_path / "t.csv"
    moved = [[*row[:k], repr(float(row[k]) + 10.0), *row[k + 1 :]] for row in rows]
    table.write_text("\n".join(",".join(row) for row in [head, *moved]) + "\n", encoding="utf-8")
    assert "at the measured poses" not in run("check", MACHINES / "triglide.yaml", table).err


def test_what_neither_a_zero_nor_steps_explain_is_not_told() -> None:
    """Readings of other rows, 20 poses; beside a drive with a zero, which is told."""
    rng = np.random.default_rng(2)
    expected = rng.uniform(0.1, 0.3, (20, 2))
    readings = np.column_stack([rng.permutation(expected[:, 0]), expected[:, 1] + 0.05])
    found = explain_zeros(readings, expected, ("q1", "q2"), ("mm", "mm"))
    assert [h.names for h in found.hints] == [("q2",)]
    assert found.corrected[:, 0] == pytest.approx(readings[:, 0], rel=0, abs=0)
    assert found.corrected[:, 1] == pytest.approx(expected[:, 1], abs=1e-12)
