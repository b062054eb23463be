"""Plans of rope machines: every rope pulls as it must, by a statics of its own, at poses and on the ways to them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import minimize

from pkmcal_cli.loading.load_machine import load_machine
from pkmcal_cli.prediction import Rows
from pkmcal_cli.workflow import borne_loads
from tests.command import clean, column, run

Array = NDArray[np.float64]
ANCHORS = np.array([[0.0, 1.5], [2.0, 1.5], [1.0, 0.0]])
DRAWN, WEIGHT, STIFFNESS, LEAST, BELOW = np.array([1.0, 0.8]), 98.1, 50e3, 20.0, 60.0
MACHINE = """
units: {length: mm, angle: deg, force: N}
space: planar
gravity: [0, -9.81]
ranges: {length: 2}
parameters: {x2: 2000, y3: 0}
ground: {A1: [0, 1500], A2: [x2, 1500], A3: [1000, y3]}
nodes: {load: {at: [1000, 800], mass: 10}}
ropes:
  "r{i}": {each: {i: [1, 2, 3]}, between: ["A{i}", load], EA: 50 kN, t_min: 20}
actuators:
  "q{i}": {each: {i: [1, 2]}, winds: "r{i}", zero: home}
  q3: {winds: r3, zero: home, redundant: true, control: force, force: 60, sigma: 0.1}
sensors: {camera: {at: load, reads: [x, y], sigma: 0.1, frame: machine}}
tool_point: load
"""
HELD = ", control: force, force: 60, sigma: 0.1"
GRID = "x=100:1900:7,y=200:1450:6"
PLACES = np.array([[x, y] for x in np.linspace(0.1, 1.9, 7) for y in np.linspace(0.2, 1.45, 6)])


def tensions(readings: Array, below: float | None = BELOW) -> Array:
    """Tensions (n, 3), N, at readings (n, 2 or 3), m: where the energy of ropes that only pull is least.

    below: force of the third rope, None where it holds its position too.
    """
    drawn, out = np.hypot(*(DRAWN - ANCHORS).T), []
    for row in readings:
        lengths = (drawn + np.append(row, 0.0)[:3])[: 2 if below is not None else 3]
        anchors = ANCHORS[: len(lengths)]

        def potential(x: Array, lengths: Array = lengths, anchors: Array = anchors) -> tuple[float, Array]:
            chord = x - anchors
            long = np.hypot(*chord.T)
            e = np.maximum(long - lengths, 0.0)
            pull = STIFFNESS / lengths * e
            away = x - ANCHORS[2]
            energy = 0.5 * (pull * e).sum() + WEIGHT * x[1] + (below or 0.0) * np.hypot(*away)
            slope = (pull / long) @ chord + [0.0, WEIGHT] + (below or 0.0) * away / np.hypot(*away)
            return float(energy), slope

        place = minimize(potential, DRAWN, jac=True, method="BFGS", options={"gtol": 1e-7, "maxiter": 10_000}).x
        upper = STIFFNESS / lengths * np.maximum(np.hypot(*(place - anchors).T) - lengths, 0.0)
        out.append(upper if below is None else np.append(upper, below))
    return np.array(out)


def inverse(places: Array) -> Array:
    """Readings (n, 2) of the upper ropes without strain."""
    return np.asarray(np.hypot(*(places[:, None] - ANCHORS[:2]).T).T - np.hypot(*(DRAWN - ANCHORS[:2]).T))


def written(file: str, names: tuple[str, ...] = ("q1", "q2")) -> tuple[Array, Array]:
    """Set values and beginnings of approaches (n, D) of a plan, m."""
    there, back = (np.column_stack([column(file, f"{k}{n}") for n in names]) * 1e-3 for k in ("", "approach."))
    return there, back


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("m.yaml").write_text(MACHINE)


def assert_taut(there: Array, back: Array, below: float | None = BELOW) -> None:
    assert tensions(there, below).min() > LEAST - 1e-3
    for share in (0.25, 0.5, 1.0):
        assert tensions(there + share * (back - there), below).min() > 0.95 * LEAST - 1e-3


def test_poses_at_which_ropes_would_hang_loose_are_skipped_and_counted() -> None:
    """Those of the grid, and the points that `--aim` adds; no other is skipped but within 30 mm of such a one."""
    true = tensions(inverse(PLACES)).min(axis=1)
    near = np.array([tensions(inverse(PLACES + 0.03 * np.array(d))).min(axis=1) for d in ((1, 0), (-1, 0), (0, 1))])
    aim = ("--aim", "uncertainty", "--points", "5")
    done = clean(run("plan", "m.yaml", "--grid", GRID, *aim, "-o", "p.csv", "--json"))
    assert done.code == 0, done.err
    told = [line for line in done.err.splitlines() if line.startswith("skipped: ")]
    skipped, others = (
        sum(int(line.split()[1]) for line in told if (" slack, or below its `t_min`" in line) is ropes)
        for ropes in (True, False)
    )
    assert (true < LEAST).sum() <= skipped <= (np.minimum(true, near.min(axis=0)) < LEAST).sum()
    assert 5 < skipped < 30 and len(done.json["points"]) == 5 and "below its `t_min` of" not in done.err
    there, back = written("p.csv")
    assert len(np.unique(there, axis=0)) == len(PLACES) - skipped - others + 5 and others < 3
    assert_taut(there, back)


@pytest.mark.parametrize("form", ["gcode", "checklist"])
def test_no_form_has_such_a_pose(form: str) -> None:
    for file, more in (("p.csv", ()), (form, ("--as", form))):
        assert clean(run("plan", "m.yaml", "--grid", GRID, "-q", *more, "-o", file)).code == 0
    if form == "gcode":
        lines = Path(form).read_text().splitlines()
        stops = [lines[k - 1] for k, line in enumerate(lines) if line.startswith("G4")]
        there = np.array([[float(word[1:]) for word in line.split()[1:3]] for line in stops]) * 1e-3
    else:
        ways = [line.split("->")[1] for line in Path(form).read_text().splitlines() if "->" in line]
        there = np.array([float(way.split()[0]) for way in ways]).reshape(-1, 2) * 1e-3
    assert len(there) == len(written("p.csv")[0]) and tensions(there).min() > LEAST - 0.1


def test_points_to_measure_next_have_taut_ropes() -> None:
    """Candidates lie around the measured poses, of which some are where a rope hangs loose just outside."""
    good = inverse(PLACES)[tensions(inverse(PLACES)).min(axis=1) > LEAST]
    Path("poses.csv").write_text("q1,q2\n" + "".join(f"{a!r},{b!r}\n" for a, b in (1e3 * good).tolist()))
    assert run("simulate", "m.yaml", "poses.csv", "--noise", "declared", "-q", "-o", "meas.csv").code == 0
    done = run("plan", "m.yaml", "meas.csv", "--next", "--budget", "400", "--aim", "x2 40 um", "-o", "next.csv")
    assert done.code == 0 and "continue" in done.err, done.err
    assert_taut(*written("next.csv"))


def test_ropes_that_hold_their_positions_are_tensioned() -> None:
    """Poses of a grid, and points to add: with set values at which each rope has its `t_min`."""
    Path("held.yaml").write_text(MACHINE.replace(HELD, ""))
    aim = ("--aim", "uncertainty", "--points", "4")
    done = clean(run("plan", "held.yaml", "--grid", "x=600:1400:4,y=300:1200:4", *aim, "-o", "p.csv", "--json"))
    assert done.code == 0 and len(done.json["points"]) == 4, done.err
    there, back = written("p.csv", ("q1", "q2", "q3"))
    assert len(there) > 10
    assert_taut(there, back, below=None)


def test_where_no_pose_is_left_the_ropes_and_the_remedy_are_told() -> None:
    """Without `t_min` the set values are those without strain: the lower rope hangs loose everywhere. With the set
    values of `correct` there is a plan.
    """
    Path("held.yaml").write_text(MACHINE.replace(HELD, ""))
    Path("loose.yaml").write_text(MACHINE.replace(HELD, "").replace(", t_min: 20", ""))
    for command in (("--grid", GRID), ("--grid", GRID, "-o", "p.csv")):
        done = clean(run("plan", "loose.yaml", *command))
        assert done.code == 3 and "error[approach]: none of 42 poses can be measured: rope `r3` slack" in done.err
        assert "help: " in done.err and "state `t_min` of the ropes" in done.err and not Path("p.csv").exists()
    made = run("correct", "held.yaml", "--grid", "x=600:1400:4,y=300:1200:4", "-q", "-o", "set.csv")
    assert made.code == 0
    done = clean(run("plan", "loose.yaml", "set.csv", "-o", "p.csv"))
    there, back = written("p.csv", ("q1", "q2", "q3"))
    assert done.code == 0 and len(there) > 10 and tensions(there, None).min() > 0 and tensions(back, None).min() > 0
    done = clean(run("plan", "loose.yaml", "set.csv", "--aim", "uncertainty", "-o", "q.csv"))  # points have no tension
    assert done.code == 3 and "state `t_min` of the ropes" in done.err and not Path("q.csv").exists()


def test_ropes_without_a_least_tension_may_not_be_slack() -> None:
    Path("m.yaml").write_text(MACHINE.replace(", t_min: 20", ""))
    done = clean(run("plan", "m.yaml", "--grid", GRID, "-o", "p.csv"))
    there, back = written("p.csv")
    assert done.code == 0 and "slack ropes" not in done.err and tensions(there).min() > 0 and tensions(back).min() > 0
    assert len(there) > 20 and "skipped: " in done.err


def test_a_way_on_which_nothing_balances_is_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Its ends and all but the middle of the way are all right."""
    machine = tmp_path / "m.yaml"
    machine.write_text(MACHINE, encoding="utf-8")
    model = load_machine(str(machine)).model
    rows = Rows.at(model.reference_readings[None].repeat(2, axis=0))
    ways, plain, left = borne_loads.Ways.to(model, model.nominal, rows), borne_loads.BorneLoads.of, [1]

    def lost_once(*arguments: object) -> borne_loads.BorneLoads:
        borne = plain(*arguments)  # type: ignore[arg-type]
        return replace(borne, lost=np.array([False, bool(left) and bool(left.pop())]))

    assert not ways.refused(np.zeros((2, 3)), np.arange(2))
    monkeypatch.setattr(borne_loads.BorneLoads, "of", lost_once)
    assert ways.refused(np.zeros((2, 3)), np.arange(2)) == {1: borne_loads.LOST}
