"""Plans that can be carried out: approaches, forces on the way, programs, as few points as are needed."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import numpy as np
import pytest
import yaml

from pkmcal_cli.calibration.problem import design_problem
from pkmcal_cli.loading.load_machine import load_machine
from pkmcal_cli.prediction import Rows
from pkmcal_cli.workflow.candidate_points import candidate_points
from tests.command import MACHINES, SCISSORS, clean, run
from tests.test_commands_plan import GRID, column, planned
from tests.truth.generate import campaigns
from tests.truth.machines import PINNED


@pytest.mark.slow
def test_a_stated_uncertainty_takes_as_few_points_as_reach_it(tmp_path: Path) -> None:
    """What is promised is what `observability` says of the plan with its points; with one less it is not reached."""
    first = planned("--aim", "ya2 1 um", "--points", "4")
    std = first.json["aim"]["before"]
    assert not first.json["aim"]["reached"] and "NOT REACHED" in first.err and len(first.json["points"]) == 4
    file = tmp_path / "plan.csv"
    done = clean(run("plan", SCISSORS, *GRID, "--aim", f"ya2 {0.8 * std} mm", "-o", file, "--json"))
    aim, points = done.json["aim"], done.json["points"]
    assert aim["reached"] and aim["after"] <= 0.8 * std < aim["before"] and aim["unit"] == "mm"
    assert 0 < len(points) < 30
    without = [line for line in file.read_text().splitlines() if not line.startswith("datum")]
    (tmp_path / "rows.csv").write_text("\n".join([*without, ""]))
    names = ("q1", "q2", "q3", "q4")
    grid = len(without) - 1 - len(points)
    rows = [[r[f"{n} [mm]"] for n in names] for r in csv.DictReader(file.read_text().splitlines()) if r["id"][0] == "p"]
    assert len(rows) + 1 >= grid
    seen = clean(run("observability", SCISSORS, tmp_path / "rows.csv", "--json")).json
    told = next(p["std"] for p in seen["parameters"] if p["name"] == "ya2")
    assert told == pytest.approx(aim["after"], rel=0.05), "the datum pose counts once"
    enough = planned("--aim", f"ya2 {1.1 * std} mm")
    assert enough.json["points"] == [] and "no further point" in enough.err


def test_approaches_are_moves_of_the_tool_point_where_drives_move_together(tmp_path: Path) -> None:
    """Four carriages of the Scissors for two freedoms, by the independent simulator: nothing is strained where an
    approach begins, and hardly on the way; the sides are those of the way.
    """
    file, truth = tmp_path / "plan.csv", PINNED["scissors"]()
    done = clean(run("plan", SCISSORS, *GRID, "--aim", "backlash@q3", "--points", "5", "-o", file))
    assert done.code == 0
    names = ("q1", "q2", "q3", "q4")
    q, begin, side = (np.stack([column(file, f"{k}{n}") for n in names], axis=1) for k in ("", "approach.", "dir."))
    np.testing.assert_array_equal(np.sign(q - begin)[side != 0], side[side != 0])
    assert np.mean(side == 0) < 0.05 and len({tuple(s) for s in side}) > 4
    overrun = 0.1 * 0.01 * np.ptp(q, axis=0)
    assert (np.abs(q - begin) > overrun)[side != 0].all(), "further than any clearance"
    for share in (0.0, 0.5, 1.0):
        forces = truth.forward(1e-3 * (begin + share * (q - begin))).drive_force
        assert np.abs(forces).max() < (5.0 if share != 0.5 else 2000.0), "N; nine digits make 1 N"


def test_forces_stay_within_limits_at_poses_and_on_the_way(tmp_path: Path) -> None:
    """The Scissors with errors planted, which strain it by up to 25 kN, in the independent simulator: poses beyond the
    limit are skipped and counted; on the way internal forces are at most 5 % of the limit more than at the pose.
    """
    truth, names, si = PINNED["scissors"](), ("q1", "q2", "q3", "q4"), campaigns()["scissors"].planted()
    nominal = truth.inverse([[x, y] for x in np.linspace(-0.2, 0.2, 7) for y in np.linspace(-0.2, 0.2, 7)])
    highest = np.abs(truth.forward(nominal, si).drive_force).max(axis=1)
    limit = float(np.round(np.quantile(highest, 0.7), -1))
    planted = yaml.safe_load((MACHINES / "scissors.csv.provenance.yaml").read_text())["planted"]["parameters"]
    (tmp_path / "p.yaml").write_text(yaml.safe_dump({"parameters": planted}))
    (tmp_path / "m.yaml").write_text(
        f"extends: {SCISSORS}\nactuators: {{{', '.join(f'{n}: {{force_limit: {limit / 1e3} kN}}' for n in names)}}}\n"
    )
    file = tmp_path / "plan.csv"
    grid = ("--grid", "x=-200:200:7,y=-200:200:7")
    done = clean(run("plan", tmp_path / "m.yaml", *grid, "-p", tmp_path / "p.yaml", "-o", file))
    skipped = [int(n) for n in re.findall(r"^skipped: (\d+) of 49 .*`force_limit`", done.err, re.MULTILINE)]
    assert done.code == 0 and len(skipped) == 1
    q, begin = (np.stack([column(file, f"{k}{n}") for n in names], axis=1) * 1e-3 for k in ("", "approach."))
    assert 49 - skipped[0] == len(np.unique(q.round(6), axis=0))
    there = truth.forward(q, si).drive_force
    for share in (0.0, 0.25, 0.5, 0.75):
        forces = truth.forward(begin + share * (q - begin), si).drive_force
        assert np.abs(forces).max() <= limit and np.abs(forces - there).max() <= 0.05 * limit + 5
    assert 0 < (highest > limit).sum() <= skipped[0] < 49


@pytest.mark.slow
def test_a_program_strains_nothing_on_its_way(tmp_path: Path) -> None:
    """Every line of the program, and half-way to the next, in the independent simulator; a list and a table say the
    same set values."""
    truth, files = PINNED["scissors"](), {form: tmp_path / form for form in ("gcode", "checklist", "csv")}
    for form, file in files.items():
        assert clean(run("plan", SCISSORS, "--grid", "x=-200:200:2,y=-200:200:2", "--as", form, "-o", file)).code == 0
    lines = [line for line in files["gcode"].read_text().splitlines() if line.startswith("G1")]
    words = np.array([[float(word[1:]) for word in line.split()[1:5]] for line in lines]) * 1e-3
    assert len(lines) > 100, "long ways have points on them"
    for row in (words, 0.5 * (words[1:] + words[:-1])):
        assert np.abs(truth.forward(row[::7]).drive_force).max() < 2000, "N"
    rows = np.stack([column(files["csv"], n) for n in ("q1", "q2", "q3", "q4")], axis=1)
    told = [float(t) for t in re.findall(r"-> (\S+) mm", files["checklist"].read_text())]
    np.testing.assert_allclose(np.reshape(told, (-1, 4)), rows, atol=5.1e-4)
    waits = files["gcode"].read_text().splitlines()
    ends = [waits[k - 1] for k, line in enumerate(waits) if line == "G4 P2"]
    at = np.array([[float(word[1:]) for word in line.split()[1:5]] for line in ends])
    np.testing.assert_allclose(at, rows, atol=2e-5)
    assert "x = ________ mm" in files["checklist"].read_text() and "x [mm],y [mm]" in files["csv"].read_text()
    wrong = clean(run("plan", SCISSORS, *GRID, "--as", "gcodes"))
    assert wrong.code == 2 and "did you mean `gcode`?" in wrong.err


def test_points_are_proposed_although_a_row_has_no_solution_at_the_fitted_values() -> None:
    """Such a row is nowhere, so it says nothing of where points may be; the others do."""
    loaded = load_machine(str(MACHINES / "triglide-nonredundant.yaml"))
    model = loaded.model
    apart = np.array([[0.04, 0.56], [0.24, 0.76], [0.0, 5.0]])  # m; no rod reaches over 5 m
    problem = design_problem(model, Rows.at(apart))
    pool, _ = candidate_points(loaded, problem, model.nominal, 20, 0)
    assert len(pool) > 5 and np.isfinite(pool.rows.readings).all()
    assert pool.rows.readings.min() > -0.1 and pool.rows.readings.max() < 1.0
