"""Friction of a force-controlled drive: it takes a part of the commanded force, against the drive's last motion.

The truth: three rods hold a point, of which the third ends on a carriage that a force pushes along its rail
(`test_force_columns.held`); friction is against the motion of this carriage from row to row.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.problem import design_problem
from pkmcal_cli.calibration.unknown_sides import with_unknown_sides
from pkmcal_cli.loading.load_machine import load_machine
from pkmcal_cli.prediction import Request, Rows, predict
from pkmcal_cli.report.effect_signs import sign_text
from tests.command import clean, run
from tests.csv_tables import read_table
from tests.test_force_columns import SLIDERS, held

FRICTION = 300.0  # N
COLUMNS = "q1 [mm],q2 [mm],q3.force [N],x [mm],y [mm]"


def campaign(seed: int, friction: float, rows: int = 40) -> tuple[Array, Array]:
    """A table (N, 5) without a reading or side of the carriage, and from where (N,) it came; at first from below."""
    rng = np.random.default_rng([3, seed])
    places = rng.uniform([300, 240, -1500], [700, 400, 1500], (rows, 3))
    travel = places[:, 0] + np.sqrt(700**2 - (places[:, 1] - 50) ** 2)
    sides = np.sign(np.diff(travel, prepend=travel[0] - 1.0))
    half = np.sqrt(400**2 - (places[:, 1] - 50) ** 2)
    given = np.round(np.column_stack([places[:, 0] - half, places[:, 0] + half, places[:, 2]]), 4)
    seen = [held(q1, q2, f - friction * side)[:2] for (q1, q2, f), side in zip(given, sides, strict=True)]
    return np.hstack([given, seen + rng.normal(0, 3e-3, (rows, 2))]), sides


def write(folder: Path, table: Array, more: str = "") -> tuple[Path, Path]:
    """The machine, with a declared size, and the table."""
    file, data = folder / "m.yaml", folder / "t.csv"
    file.write_text(SLIDERS + more)
    data.write_text("\n".join([COLUMNS, *(",".join(f"{v:.7f}" for v in row) for row in table), ""]))
    return file, data


@pytest.mark.parametrize("seed", range(3))
def test_it_is_named_with_its_size(seed: int, tmp_path: Path) -> None:
    """Sides follow from where the nominal machine takes the carriage; of the first row nobody knows it."""
    done = run("diagnose", *write(tmp_path, campaign(seed, FRICTION)[0]), "--json")
    (found,) = done.json["effects"]
    (size,) = found["parameters"]
    assert (found["effect"], found["at"], done.json["outliers"]) == ("friction", "q3", [])
    assert size["value"] == pytest.approx(FRICTION, abs=3 * size["std"]) and size["std"] < 0.1 * FRICTION


def test_a_table_without_it_is_clean(tmp_path: Path) -> None:
    assert run("diagnose", *write(tmp_path, campaign(5, 0.0)[0]), "--json").json["verdict"] == "clean"


def test_an_improved_machine_predicts_and_corrects_with_it(tmp_path: Path) -> None:
    """Targets under the set values of `correct`, with the friction of the sides from which these come."""
    file, table = write(tmp_path, campaign(1, FRICTION)[0])
    improved, params = tmp_path / "better.yaml", tmp_path / "better.params.yaml"
    clean(run("improve", file, table, "-o", improved))
    targets, commands = tmp_path / "targets.csv", tmp_path / "commands.csv"
    rows = ["q3.force [N],x [mm],y [mm],dir.q3", "500,400,300,1", "500,480,310,", "-200,520,370,", "500,430,280,"]
    targets.write_text("\n".join([*rows, ""]))
    clean(run("correct", improved, targets, "-p", params, "-o", commands))
    made = read_table(commands)
    q1, q2, force, side = (made.numbers[n] for n in ("q1", "q2", "q3.force", "dir.q3"))
    assert side.tolist() == [1, 1, 1, -1]
    there = np.array([held(*row)[:2] for row in np.column_stack([q1, q2, force - FRICTION * side])])
    u = np.column_stack([made.numbers[f"u.{c}"] for c in "xy"]) * 1e-3
    off = there - np.array([[400, 300], [480, 310], [520, 370], [430, 280]])
    assert (np.abs(off) < 3 * u).all() and u.max() < 0.01, off


def test_what_nobody_knows_the_side_of_is_off_by_what_the_force_does(tmp_path: Path) -> None:
    """Of a drive that has play too: newtons are no metres."""
    effects = "effects: {friction@q3: {f: 300 N}, backlash@q3: {b: 0.4 mm}, backlash@q1: {b: 0.1 mm}}\n"
    loaded = load_machine(str(write(tmp_path, campaign(0, 0.0)[0], effects)[0]))
    machine, table = loaded.model, campaign(0, 0.0, 4)[0]
    names = machine.drive_names
    readings = np.column_stack([table[:, :2] / 1e3, np.full(4, np.nan)])
    forces = np.column_stack([np.full((4, 2), np.nan), table[:, 2]])

    def at(*sides: float) -> Rows:
        return Rows(readings, forces, {f"dir.{n}": np.full(4, s) for n, s in zip(names, sides, strict=True)})

    problem = with_unknown_sides(design_problem(machine, at(1, 1, 0)), values=machine.nominal)
    assert problem.side_sigma is not None
    np.testing.assert_allclose(problem.side_sigma, [[0, 0, 300]] * 4)
    ahead, back = (predict(machine, machine.nominal, at(1, 1, s)).values[:, :2] for s in (1, -1))
    slopes = predict(machine, machine.nominal, at(1, 1, 0), Request(by_drive=True)).by_drive
    assert slopes is not None
    half = (slopes[:, :2] * problem.reading_sigma[:, None]).sum(axis=2)
    np.testing.assert_allclose(np.abs(half), 0.5 * np.abs(ahead - back), rtol=1e-2)
    both = with_unknown_sides(design_problem(machine, at(0, 1, 0)), values=machine.nominal).side_sigma
    np.testing.assert_allclose(both, [[0.05e-3, 0, 300]] * 4)


@pytest.mark.parametrize("method", ["linear", "exact"])
def test_a_first_row_bends_no_fit(method: str, tmp_path: Path) -> None:
    """Its force is off by the friction, as its side was; the others tell both."""
    table = campaign(2, FRICTION)[0]
    file, data = write(tmp_path, table, "effects: {friction@q3: {f: {identify: true, range: 400 N}}}\n")
    done = run("calibrate", file, data, "--json", "--holdout", "none", "--method", method)
    (f,) = (p for p in done.json["parameters"] if p["name"] == "friction@q3.f")
    assert f["value"] == pytest.approx(FRICTION, abs=3 * f["std"]) and f["std"] < 0.1 * FRICTION
    assert 0.6 < done.json["chi2_per_dof"] < 1.5
    assert "t.csv:2: from which side q3 came is unknown" in done.err


def test_a_plan_states_the_sides_of_drives_that_follow(tmp_path: Path) -> None:
    """A schedule approaches each pose from beside it, not from the pose before."""
    file, plan = write(tmp_path, campaign(0, 0.0)[0])[0], tmp_path / "plan.csv"
    clean(run("plan", file, "--grid", "x=400:560:3,y=280:360:3", "-o", plan))
    made = read_table(plan)
    here, from_ = (np.column_stack([made.numbers[f"{k}{n}"] for n in ("q1", "q2")]) for k in ("", "approach."))
    travels = []
    for q1, q2 in (here.T, from_.T):
        x, half = 0.5 * (q1 + q2), 0.5 * (q2 - q1)
        travels.append(x + np.sqrt(700**2 - (400**2 - half**2)))
    side = made.numbers["dir.q3"]
    moved = travels[0] - travels[1]
    assert set(side) >= {-1.0, 1.0} and (np.sign(moved) == side)[side != 0].all()
    assert np.abs(moved[side == 0]).max(initial=0.0) < 0.1, "it rests"


@pytest.mark.parametrize("scale", [1, -1])
def test_it_is_against_the_travel_however_readings_count(scale: int, tmp_path: Path) -> None:
    file, table = tmp_path / "m.yaml", tmp_path / "t.csv"
    text = SLIDERS.replace("control: force,", f"control: force, scale: {scale},")
    file.write_text(text + "effects: {friction@q3: {f: 300 N}}\n")
    table.write_text("q1 [mm],q2 [mm],q3.force [N],dir.q3\n235,765,500,1\n235,765,500,-1\n")
    out = tmp_path / "out.csv"
    clean(run("simulate", file, table, "-o", out))
    x = read_table(out).numbers["x"]
    drawn = np.array([400.0, 400.0, 700.0]), 8000.0
    less, more = (held(235.0, 765.0, f, *drawn)[0] for f in (200.0, 800.0))
    assert x == pytest.approx([less, more][:: scale], abs=1e-6)
    model = load_machine(str(file)).model
    assert "is helped along its last motion" in sign_text(model, "friction@q3.f", -300.0, 20.0)
    assert sign_text(model, "friction@q3.f", 300.0, 20.0) == ""
