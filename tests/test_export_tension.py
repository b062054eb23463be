"""Tables of single drives on redundant ropes: what pulls too little is said, as an independent machine has it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import minimize

from tests.command import run
from tests.export_readers import added, csv_tables

EA, WEIGHT, LEAST, MOST = 50e3, 98.1, 20.0, 25.0  # N
WINCH = f"""
units: {{length: mm, angle: deg, force: N}}
space: planar
gravity: [0, -9.81]
ranges: {{length: 2}}
parameters: {{x2: 2000, y3: 0}}
ground: {{A1: [0, 1500], A2: [x2, 1500], A3: [1000, y3]}}
nodes: {{load: {{at: [1000, 800], mass: 10}}}}
ropes:
  "r{{i}}": {{each: {{i: [1, 2, 3]}}, between: ["A{{i}}", load], EA: 50 kN, t_min: {LEAST:g}}}
actuators:
  q1: {{winds: r1, zero: home, force_limit: 200}}
  q2: {{winds: r2, zero: home, force_limit: 200}}
  q3: {{winds: r3, zero: home, force_limit: {MOST:g}, redundant: true}}
sensors: {{camera: {{at: load, reads: [x, y], sigma: 0.1, frame: machine}}}}
"""
ANCHORS, HOME = np.array([[0.0, 1.5], [2.0, 1.5], [1.0, 0.0]]), np.array([1.0, 0.8])
GRID = [(x, y) for x in np.linspace(0.8, 1.2, 4) for y in np.linspace(0.7, 1.1, 4)]


def lengths(place: np.ndarray) -> np.ndarray:
    """Of the three ropes (..., 3), m."""
    return np.asarray(np.linalg.norm(place[..., None, :] - ANCHORS, axis=-1))


def tensions(rest: np.ndarray, near: tuple[float, float]) -> np.ndarray:
    """Of three ropes of lengths without tension (3,), m, where their energy and that of the weight are least, N."""

    def pull(place: np.ndarray) -> np.ndarray:
        return np.asarray(EA * np.maximum(lengths(place) - rest, 0.0) / rest)

    def energy(place: np.ndarray) -> float:
        return float((pull(place) ** 2 * rest).sum() / (2 * EA) + WEIGHT * place[1])

    def slope(place: np.ndarray) -> np.ndarray:
        along = (place - ANCHORS) / lengths(place)[:, None]
        return np.asarray(pull(place) @ along + np.array([0.0, WEIGHT]))

    done = minimize(energy, np.array(near), jac=slope, method="BFGS", options={"gtol": 1e-7})
    assert np.abs(slope(done.x)).max() < 1e-3  # N
    return pull(done.x)


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("m.yaml").write_text(WINCH)


def test_ropes_that_tables_leave_slack_are_named() -> None:
    """Corrected set values pull with 20 N or more everywhere; a table of one drive cannot hold that, and says where."""
    grid = "x=800:1200:4,y=700:1100:4"
    done = run("correct", "m.yaml", "--grid", grid, "--as", "csv", "-o", "t.csv", "--json")
    assert done.code == 0, done.err
    at = np.array(GRID)
    commanded = {f"q{k + 1}": lengths(at)[:, k] - lengths(HOME)[k] for k in range(3)}
    rest = added(csv_tables(Path("t.csv")), commanded) + lengths(HOME)
    pulls = np.array([tensions(row, near) for row, near in zip(rest, GRID, strict=True)])
    entry = next(e for e in done.json["export"]["loads"]["t_min"] if e["rope"] == "r3")
    below = pulls[:, 2] < 0.99 * LEAST
    assert entry["n_rows"] == below.sum() and 2 < below.sum() < 16
    assert entry["least"] == pytest.approx(pulls[:, 2].min(), abs=0.05)
    assert done.json["loads"]["t_min"][2]["n_rows"] == 0
    slack = int((pulls[:, 2] <= 0.0).sum())
    assert done.json["export"]["loads"]["slack"]["n_rows"] == slack
    above = (pulls[:, 2] > 1.01 * MOST).sum()
    over = {e["actuator"]: e["n_rows"] for e in done.json["export"]["loads"]["force_limit"]}
    assert over == {"q1": 0, "q2": 0, "q3": above} and 2 < above < 16
    assert f"with `csv`: force of `q3` above its `force_limit` of 25 N in {above} of 16 rows" in done.err
    assert f"with `csv`: tension of rope `r3` below its `t_min` of 20 N in {below.sum()} of 16 rows" in done.err
    assert "tension of rope `r3` below" in Path("t.csv.provenance.yaml").read_text()


def test_digits_of_a_program_are_no_lack_of_tension() -> None:
    """Set values in steps of 10 nm miss 20 N by less than 1 mN."""
    grid = "x=800:1200:4,y=700:1100:4"
    done = run("correct", "m.yaml", "--grid", grid, "--as", "gcode-drives", "-o", "t.ngc", "--json")
    assert done.code == 0, done.err
    assert {e["n_rows"] for e in done.json["export"]["loads"]["t_min"]} == {0}
    assert "below its `t_min`" not in done.err + Path("t.ngc").read_text()
