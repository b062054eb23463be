"""`--grid 40`: so many poses over the workspace, for all commands that take a grid."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np
import pytest

from tests.command import SCISSORS, TRIGLIDE, run
from tests.in_ci import in_ci

FAST = ("simulate", "sensitivity", "observability", "effects")


def places(out: str) -> np.ndarray:
    rows = csv.DictReader(io.StringIO("".join(line for line in out.splitlines(True) if not line.startswith("#"))))
    return np.array([[float(row["x [mm]"]), float(row["y [mm]"])] for row in rows])


def test_they_fill_the_workspace_evenly() -> None:
    """40 poses in the box of 400 mm x 400 mm: all inside, in every ninth of it, none next to another."""
    found = places(run("simulate", SCISSORS, "--grid", "40", "-q").out)
    assert len(found) == 40 and np.abs(found).max() <= 200.001
    ninths = {tuple(cell) for cell in np.minimum((found + 200) * 3 // 400, 2).astype(int)}
    apart = np.linalg.norm(found[:, None] - found[None], axis=2)[np.triu_indices(40, 1)]
    assert len(ninths) == 9 and apart.min() > 0.3 * 400 / np.sqrt(40)


@pytest.mark.parametrize("command", in_ci(FAST, [*FAST, "plan"]))
def test_every_command_with_a_grid_takes_a_number(command: str, tmp_path: Path) -> None:
    more = {"simulate": ("-o", tmp_path / "t.csv"), "effects": ("--simulate",)}.get(command, ())
    done = run(command, SCISSORS, "--grid", "7", *more, "--json")
    assert done.code == 0, done.err
    assert done.json["n_poses" if command == "effects" else "n_rows"] == 7


@pytest.mark.parametrize("number", ["0", "-3", "100001", "9" * 40])
def test_numbers_that_are_none(number: str) -> None:
    done = run("observability", SCISSORS, "--grid", number)
    assert done.code == 2 and f"`{number}` is not a number of poses" in done.err


def test_a_machine_without_a_workspace_says_what_to_add() -> None:
    done = run("observability", TRIGLIDE, "--grid", "40")
    assert done.code == 2 and "the machine declares none" in done.err and "`workspace:`" in done.err


def test_points_are_for_an_aim() -> None:
    done = run("plan", SCISSORS, "--points", "40")
    assert done.code == 2 and "none is given" in done.err and "`--grid 40`" in done.err
