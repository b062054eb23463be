"""`pkmcal plan --aim "NAME VALUE"`: what parameters that are not identified add to an uncertainty is told."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.command import clean, run

MACHINE = """
units: {length: mm, angle: deg, force: N}
space: planar
ranges: {length: 0.4}
parameters:
  o1: 300
  o2: 300
  xb: {nominal: 800, identify: false}
ground: {A: [0, 0], B: [xb, 0]}
nodes: {tip: [400, 500]}
bars:
  leg1: {between: [A, tip], length: 600}
  leg2: {between: [B, tip], length: 600}
actuators:
  q1: {drives: leg1, offset: o1}
  q2: {drives: leg2, offset: o2}
sensors: {tracker: {at: tip, reads: [x, y], sigma: 0.01, frame: machine}}
"""
X, Y = np.linspace(200, 600, 5), np.linspace(300, 700, 5)


def tip(legs: np.ndarray, base: float) -> np.ndarray:
    """Where two legs (n, 2) from (0, 0) and (base, 0) meet, above the base: two circles."""
    x = (legs[:, 0] ** 2 - legs[:, 1] ** 2 + base**2) / (2 * base)
    return np.stack([x, np.sqrt(legs[:, 0] ** 2 - x**2)], axis=1)


def jacobian() -> np.ndarray:
    """Of all coordinates by o1, o2 and xb, by central differences."""
    points = np.array([(x, y) for x in X for y in Y])
    legs, step, columns = np.stack([np.hypot(*points.T), np.hypot(points[:, 0] - 800, points[:, 1])], axis=1), 1e-4, []
    for leg1, leg2, base in np.eye(3) * step:
        ends = [tip(legs + s * np.array([leg1, leg2]), 800 + s * base) for s in (1, -1)]
        columns.append(((ends[0] - ends[1]) / (2 * step)).ravel())
    return np.stack(columns, axis=1)


def known() -> tuple[float, float]:
    """Standard uncertainty of o2 by noise, and what half a range of xb adds to it, mm: least squares by hand."""
    columns = jacobian()
    gain = np.linalg.pinv(columns[:, :2])
    return 0.01 * float(np.linalg.norm(gain[1])), 0.2 * abs(float(gain[1] @ columns[:, 2]))


@pytest.fixture
def machine(tmp_path: Path) -> Path:
    file = tmp_path / "legs.yaml"
    file.write_text(MACHINE, encoding="utf-8")
    return file


GRID = ("--grid", "x=200:600:5,y=300:700:5")


def test_what_held_parameters_add_is_told(machine: Path) -> None:
    """Otherwise a plan promises what no calibration of its rows will state."""
    noise, held = known()
    assert held > 10 * noise
    done = clean(run("plan", machine, *GRID, "--aim", f"o2 {2 * noise:.6f} mm", "--json"))
    aim = done.json["aim"]
    assert aim["reached"] and aim["before"] == pytest.approx(noise, rel=1e-3)
    assert aim["held_adds"] == pytest.approx(held, rel=1e-3)
    assert "note: parameters that are not identified add 0.1" in done.err and "no points take away" in done.err


def test_it_is_what_a_calibration_of_these_rows_states(machine: Path, tmp_path: Path) -> None:
    """With offsets as large as the ranges say: these are half of the ranges."""
    true, table, result = tmp_path / "true.yaml", tmp_path / "table.csv", tmp_path / "p.yaml"
    true.write_text("parameters: {o1: 300.2, o2: 299.8, xb: 800.2}\n", encoding="utf-8")
    clean(run("simulate", machine, *GRID, "-p", true, "--noise", "declared", "--seed", "1", "-o", table))
    stated = clean(run("calibrate", machine, table, "--holdout", "none", "--json", "-o", result)).json["parameters"]
    planned = clean(run("plan", machine, table, "--aim", "o2 1 mm", "--json")).json["aim"]
    o2 = next(p for p in stated if p["name"] == "o2")
    assert planned["held_adds"] == pytest.approx(o2["std_by_held"], rel=0.5)
    assert planned["held_adds"] > 5 * planned["before"]


def test_nothing_is_said_where_all_are_identified(machine: Path) -> None:
    done = clean(run("plan", machine, *GRID, "--select", "all", "--aim", "o2 1 mm", "--json"))
    assert done.json["aim"]["held_adds"] == 0.0 and "not identified add" not in done.err


def test_a_plan_without_poses_says_what_would_give_some(machine: Path) -> None:
    """A file that states no workspace: the help was a grid only, though 50 poses come by themselves with one."""
    done = run("plan", machine)
    assert done.code == 2 and "`workspace` in the machine file" in done.err
