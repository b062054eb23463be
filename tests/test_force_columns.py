"""Commanded forces of a force-controlled drive that are not what acts: of the opposite sign, in another unit.

The truth: three rods hold a point, of which the third ends on a carriage that a force pushes along its rail; and a
weight hangs on a wire of length l and stiffness EA, and a drive on a rail pushes it up with F: its height is
-l (1 + (m g - F) / EA).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import root

from pkmcal_cli.base.rotation import Array
from tests.command import clean, run
from tests.csv_tables import read_table

LENGTH, TENSION, WEIGHT = 0.5003, 20e3, 3 * 9.81  # m, N, N
MACHINE = """units: {length: mm, angle: deg, force: N}
space: planar
gravity: [0, -9.81]
parameters: {l: {nominal: 500, range: 1}}
ground: {A: [0, 0]}
nodes: {bob: {at: [0, -500], mass: 3}}
guides: {rail: {at: [0, -500], along: y}}
bodies: {slide: {guide: rail, at: 0, points: {P: [0, 0]}}}
joints: {pin: {between: [bob, P], type: revolute}}
bars: {wire: {between: [A, bob], length: l, EA: 20 kN}}
actuators: {t: {moves: slide, redundant: true, control: force, force: 40}}
sensors: {dial: {at: bob, reads: [y], sigma: 1 um, frame: machine}}
"""


def diagnosed(folder: Path, commanded: Array, acting: Array) -> dict[str, object]:
    """What `diagnose` says of a table of commanded forces where others act, with noise of the stated size."""
    file, table = folder / "m.yaml", folder / "t.csv"
    file.write_text(MACHINE)
    y = -1e3 * LENGTH * (1 + (WEIGHT - acting) / TENSION) + np.random.default_rng(3).normal(0, 1e-3, len(acting))
    rows = "".join(f"{f:.6f},{v:.9f}\n" for f, v in zip(commanded, y, strict=True))
    table.write_text("t.force [N],y [mm]\n" + rows)
    return run("diagnose", file, table, "--json").json


SLIDERS = """units: {length: mm, angle: deg, force: N}
space: planar
ranges: {length: 0.3 mm}
guides: {rail: {along: x}}
bodies:
  "c{i}": {each: {i: [1, 2, 3], at: [235, 765, 1130]}, guide: rail, at: "{at}", points: {"B{i}": [0, 50]}}
nodes: {tcp: [500, 350]}
bars: {"rod{i}": {each: {i: [1, 2, 3]}, between: ["B{i}", tcp], length: "l{i}", k: k}}
parameters: {l1: 400, l2: 400, l3: 700, k: {nominal: 8 kN/mm, range: 1 kN/mm}}
actuators:
  q1: {moves: c1, stiffness: 20 kN/mm}
  q2: {moves: c2, stiffness: 20 kN/mm}
  q3: {moves: c3, redundant: true, control: force, sigma: 5 um}
sensors: {grid: {at: tcp, reads: [x, y], sigma: 3 um, frame: machine}}
"""
GRID = "x=400:500:2,y=300:350:2"
RODS, STIFF, DRIVES = np.array([400.13, 399.91, 700.07]), 8500.0, 20e3  # mm, N/mm


def held(q1: float, q2: float, force: float, rods: Array = RODS, stiff: float = STIFF) -> Array:
    """Places x, y and travel of the three carriages, the third first (mm), where rods, drives and its force balance."""
    half = 0.5 * (q2 - q1)
    x, y = q1 + half, 50 + np.sqrt(400**2 - half**2)
    near = np.array([x, y, x + np.sqrt(700**2 - (y - 50) ** 2), q1, q2])

    def forces(at: Array) -> Array:
        chords = at[:2] - np.array([[at[3], 50], [at[4], 50], [at[2], 50]])
        lengths = np.hypot(*chords.T)
        pulls = (stiff * (lengths - rods) / lengths)[:, None] * chords
        carriages = -pulls[[2, 0, 1], 0] + [-force, DRIVES * (at[3] - q1), DRIVES * (at[4] - q2)]
        return np.array([*pulls.sum(axis=0), *carriages])

    found = root(forces, near, tol=1e-13).x
    assert np.abs(forces(found)).max() < 1e-5
    return np.asarray(found)


def measured(folder: Path, share: float) -> tuple[Path, Path]:
    """A table of commanded forces where this share of them acts."""
    rng, lines = np.random.default_rng(1), ["q1 [mm],q2 [mm],q3.force [N],x [mm],y [mm],q3 [mm]"]
    for x, y, f in zip(rng.uniform(300, 700, 40), rng.uniform(240, 400, 40), rng.uniform(-1500, 1500, 40), strict=True):
        half = np.sqrt(400**2 - (y - 50) ** 2)
        given = np.round([x - half, x + half, f], 4)
        seen = held(given[0], given[1], share * given[2])[:3] + rng.normal(0, [0.003, 0.003, 0.005])
        lines.append(",".join(f"{v:.7f}" for v in (*given, *seen)))
    file, table = folder / "m.yaml", folder / "t.csv"
    file.write_text(SLIDERS)
    table.write_text("\n".join(lines) + "\n")
    return file, table


def test_a_column_of_forces_of_the_opposite_sign_is_told(tmp_path: Path) -> None:
    done = run("diagnose", *measured(tmp_path, -1.0), "--json")
    assert (done.json["verdict"], done.json["effects"]) == ("measurement_fault", [])
    (hint,) = done.json["mistakes"]
    assert hint.startswith("`q3.force` looks reversed in sign: ")


def test_forces_that_hardly_act_are_told(tmp_path: Path) -> None:
    share = 0.001
    file, table = measured(tmp_path, share)
    done = run("diagnose", file, table, "--json")
    first = done.json["effects"][0]
    (size,) = first["parameters"]
    assert (first["effect"], first["at"]) == ("force_scale", "q3")
    assert size["value"] == pytest.approx(share - 1, abs=4 * size["std"]) and size["std"] < 0.1
    assert "Check sign and unit of the column `q3.force`" in run("diagnose", file, table).err


def test_the_share_of_forces_that_acts_is_identified(tmp_path: Path) -> None:
    file, table = measured(tmp_path, 0.7)
    file.write_text(SLIDERS + "effects: {force_scale@q3: {s: {identify: true}}}\n")
    (s,) = (p for p in run("calibrate", file, table, "--json").json["parameters"] if p["name"] == "force_scale@q3.s")
    assert s["value"] == pytest.approx(-0.3, abs=3 * s["std"]) and s["std"] < 0.07


def test_forces_as_commanded_are_clean(tmp_path: Path) -> None:
    commanded = np.linspace(-300, 600, 40)
    assert diagnosed(tmp_path, commanded, commanded)["verdict"] == "clean"


def test_the_scale_of_a_force_that_stays_is_no_cause(tmp_path: Path) -> None:
    """It would be an offset of the force, which has a name of its own."""
    lacks = diagnosed(tmp_path, np.full(20, 40.0), np.full(20, 40.0))["not_testable"]
    needs = {each["effect"]: each["needs"] for each in lacks}  # type: ignore[attr-defined]
    assert "in which the force varies" in needs["force_scale"]


def test_a_declared_scale_acts_on_the_force_of_the_machine_too(tmp_path: Path) -> None:
    file, table = tmp_path / "m.yaml", tmp_path / "t.csv"
    file.write_text(MACHINE + "effects: {force_scale@t: {s: 0.25}}\n")
    table.write_text("id,t.force [N]\n1,40\n2,100\n")
    lines = clean(run("simulate", file, table, "-q")).out.splitlines()
    y = [float(line.split(",")[lines[-3].split(",").index("y [mm]")]) for line in lines[-2:]]
    assert y == pytest.approx([-500 * (1 + (WEIGHT - 1.25 * f) / TENSION) for f in (40, 100)], abs=1e-8)


@pytest.mark.parametrize(
    "command",
    [["simulate", "--grid", GRID], ["correct", "--grid", GRID], ["observability"]],
)
def test_a_force_that_nothing_states_is_said_to_be_zero(command: list[str], tmp_path: Path) -> None:
    file = tmp_path / "m.yaml"
    for said, force in ((True, ""), (False, " force: 100,")):
        file.write_text(SLIDERS.replace("control: force,", f"control: force,{force}"))
        done = clean(run(command[0], file, *command[1:]))
        assert ("force of `q3`: 0, as nothing states it" in done.err) is said


def test_the_remedy_of_a_missing_column_of_forces_names_the_machine_file(tmp_path: Path) -> None:
    file, table = measured(tmp_path, 1.0)
    table.write_text(table.read_text().replace("q3.force [N]", "pressure"))
    done = run("calibrate", file, table)
    assert done.code and "missing column `q3.force`" in done.err
    assert "or state a constant `force` of q3 in the machine file" in done.err


@pytest.mark.parametrize("command", ["observability", "plan"])
def test_a_machine_that_a_force_strains_is_not_called_unstrained(command: str, tmp_path: Path) -> None:
    file = tmp_path / "m.yaml"
    for said, force in ((True, 0), (False, 20)):
        file.write_text(SLIDERS.replace("control: force,", f"control: force, force: {force},"))
        done = clean(run(command, file, "--grid", "x=300:700:5,y=250:380:4"))
        assert ("the machine is hardly strained" in done.err) is said, done.err


@pytest.mark.parametrize(
    ("header", "said"),
    [
        ("q3.force [N]", ""),
        ("q3_force [N]", "column `q3_force [N]` is not used and the force of actuator q3 has no column"),
        ("Q3.force [N]", "did you mean `q3.force [N]`?"),
    ],
)
def test_a_column_of_forces_that_is_nearly_there_is_not_taken_for_a_constant(
    header: str, said: str, tmp_path: Path
) -> None:
    file, table = measured(tmp_path, 1.0)
    file.write_text(file.read_text().replace("control: force,", "control: force, force: 100,"))
    table.write_text(table.read_text().replace("q3.force [N]", header))
    done = run("check", file, table)
    assert said in done.err and bool(done.code) is bool(said)


def test_which_force_is_used_where_the_table_has_none(tmp_path: Path) -> None:
    file, table = measured(tmp_path, 1.0)
    declared = "control: force, force: {column: pull, otherwise: 100},"
    file.write_text(file.read_text().replace("control: force,", declared))
    table.write_text(table.read_text().replace("q3.force [N]", "pressure"))
    said = "no force of q3 in 40 of 40 rows: the force of the machine file is used, 100 N"
    assert said in run("check", file, table).err


def test_a_plan_gives_the_forces_that_it_was_made_with(tmp_path: Path) -> None:
    """By row, of the poses of a table; else what was assumed: a program that is simulated lacks nothing."""
    (file, table), plan = measured(tmp_path, 1.0), tmp_path / "plan.csv"
    clean(run("plan", file, table, "--aim", "preload@q3", "--points", "2", "-o", plan))
    given, asked = read_table(table), read_table(plan)
    rows = {name: k for k, name in enumerate(asked.texts["id"])}
    for k in range(40):
        if (name := f"p{k + 1}") in rows:
            assert asked.numbers["q3.force"][rows[name]] == given.numbers["q3.force"][k]
            assert asked.numbers["q1"][rows[name]] == given.numbers["q1"][k]
    assert asked.numbers["q3.force"][[rows["p41"], rows["p42"]]].tolist() == [0, 0]
    clean(run("simulate", file, plan, "-q"))
    clean(run("plan", file, table, "--as", "checklist", "-o", tmp_path / "plan.txt"))
    force = given.numbers["q3.force"][0]
    assert f"q3.force: {force:.6g} N" in (tmp_path / "plan.txt").read_text()
