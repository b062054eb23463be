"""`pkmcal plan`, run: points improve what they are for and can be reached; the table is one that can be measured."""

from __future__ import annotations

import csv
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from tests.command import HANGPRINTER, HANGPRINTER_DATA, MACHINES, SCISSORS, SHOPFLOOR, Done, clean, column, run
from tests.support import model
from tests.truth.generate import campaigns
from tests.truth.machines import PINNED

GRID = ("--grid", "x=-200:200:5,y=-200:200:5")


def planned(*options: str) -> Done:
    return clean(run("plan", SCISSORS, *GRID, *options, "--json"))


def effects(done: Done) -> dict[str, dict[str, Any]]:
    return {f"{e['effect']}@{e['at']}": e for e in done.json["effects"]}


# --- what a plan shows ---------------------------------------------------------------------
def test_sizes_follow_the_noise_and_the_number_of_poses(tmp_path: Path) -> None:
    """Twice the noise: twice the smallest detectable size; a plan done twice: smaller by the root of two."""
    noisy = tmp_path / "noisy.yaml"
    sensor = "sensors: {grid: {sigma: 1 um}}"
    noisy.write_text(f"extends: {SCISSORS}\n{sensor}\n", encoding="utf-8")
    plain, coarse = effects(planned()), effects(clean(run("plan", noisy, *GRID, "--json")))
    for name in ("pitch_curve@q1", "straight@left.x", "scale@q2"):
        assert coarse[name]["mdb"] == pytest.approx(2 * plain[name]["mdb"], rel=0.02)
        assert plain[name]["status"] == "detectable" and plain[name]["mdb"] < plain[name]["plausible"]
        assert plain[name]["msb"] >= plain[name]["mdb"]


def test_columns_decide_what_is_testable() -> None:
    bare = {n["effect"] for n in planned().json["not_testable"]}
    assert {"drift", "thermal_strut", "runout"} <= bare
    assert "payload" not in bare, "without gravity no column would make it testable"
    logged = clean(run("plan", SCISSORS, SHOPFLOOR, "--json"))
    assert not {"drift", "thermal_strut"} & {n["effect"] for n in logged.json["not_testable"]}
    assert effects(logged)["thermal_strut@all"]["status"] == "detectable"


def test_without_strain_nothing_elastic_is_seen() -> None:
    """At nominal dimensions no rod carries force, so there is no stiffness, play or wind-up to see."""
    found = effects(planned())
    for name in ("stiffness@all", "clearance@all", "windup@all"):
        assert found[name]["status"] == "invisible"
    for group in planned().json["groups"]:
        assert len(group) > 1


def test_what_is_shown_is_readable() -> None:
    shown = planned("--aim", "separate:backlash@q1,backlash@q2").err
    assert "e+0" not in shown and "prior standard" not in shown and "\u2026" not in shown
    assert "smallest separable size" in shown and " um -> " in shown
    assert "not testable: thermal_base, thermal_foot, " in shown


# --- further points ------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("aimed", "kind"),
    [
        ("backlash@q3", "see"),
        ("straight@left.x", "see"),
        ("separate:backlash@q2,backlash@q4", "separate"),
        ("separate:scale@q1,straight@left.x", "separate"),
        ("xa1,l3", "determine"),
        ("uncertainty", "determine"),
    ],
)
def test_points_improve_their_figure_within_the_limits(aimed: str, kind: str) -> None:
    result = planned("--aim", aimed, "--points", "6").json
    aim, points = result["aim"], result["points"]
    assert aim["kind"] == kind and len(points) == 6
    better = aim["before"] < aim["after"] if aim["kind"] == "determine" else aim["after"] < aim["before"]
    assert better
    low, high = limits()
    for point in points:
        for k, name in enumerate(("q1", "q2", "q3", "q4")):
            assert low[k] <= point[name] <= high[k] and point[f"dir.{name}"] in (-1.0, 0.0, 1.0)
    text = "\n".join(f"{p['q1']},{p['q2']},{p['q3']},{p['q4']}" for p in points)
    reached = clean(run("simulate", SCISSORS, "-", stdin=f"q1,q2,q3,q4\n{text}\n"))
    assert reached.code == 0, "the machine takes every one of them"


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


def limits() -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    found = np.array([a.limits for a in model("scissors").actuators]) * 1e3
    return found[:, 0] - 1e-9, found[:, 1] + 1e-9


def test_rows_stay_joined_in_the_table_to_run(tmp_path: Path) -> None:
    """The same distances are read in the order of the plan, its datum pose being one end of one of them."""
    machine, table = (str(MACHINES / f"belt-router.{end}") for end in ("yaml", "csv"))
    for seed in ("0", "4"):
        file = tmp_path / f"{seed}.csv"
        assert clean(run("plan", machine, table, "-o", file, "--seed", seed)).code == 0
        read = []
        for poses in (table, file):
            target = tmp_path / "read.csv"
            assert clean(run("simulate", machine, poses, "-o", target, "--force")).code == 0
            tape = column(target, "tape")
            read.append(np.sort(tape[np.isfinite(tape)]))
        assert read[0].shape == (12,)
        np.testing.assert_allclose(read[1], read[0], rtol=0, atol=1e-5)  # mm; the plan has nine digits


def test_chosen_points_are_better_than_more_of_the_same() -> None:
    """Six chosen points lower the smallest detectable size by more than six average ones."""
    aim = planned("--aim", "backlash@q3", "--points", "6").json["aim"]
    assert aim["after"] < aim["before"] * np.sqrt(25 / 31)


# --- the table to run ----------------------------------------------------------------------
def test_the_table_can_be_run(tmp_path: Path) -> None:
    """Every pose once in random order, a datum again and again, all kinds of sides."""
    file = tmp_path / "plan.csv"
    done = clean(run("plan", SCISSORS, *GRID, "--aim", "backlash@q1", "--points", "5", "-o", file))
    with file.open(encoding="utf-8") as text:
        rows = list(csv.DictReader(text))
    assert done.code == 0 and f"written: {file} ({len(rows)} rows" in done.err
    datum = [r for r in rows if r["id"].startswith("datum")]
    assert len(datum) == 3 and len({(r["q1 [mm]"], r["q2 [mm]"]) for r in datum}) == 1
    assert len(rows) == 25 + 5 + 2 and rows[0] == datum[0] and rows[-1]["id"] == datum[-1]["id"]
    for name in ("q1", "q2", "q3", "q4"):
        assert 0.2 < np.mean(column(file, f"dir.{name}") > 0) < 0.8
    place = np.arange(len(rows))
    assert abs(np.corrcoef(place, column(file, "q1"))[0, 1]) < 0.5, "time and pose do not go together"
    simulated = clean(run("simulate", SCISSORS, file, "-o", tmp_path / "read.csv"))
    assert simulated.code == 0
    assert clean(run("calibrate", SCISSORS, tmp_path / "read.csv", "--holdout", "none")).code == 0


def test_drives_that_move_one_by_one_have_a_place_to_begin(tmp_path: Path) -> None:
    """Two drives for two freedoms: any side of each can be had, and the table says from where."""
    file = tmp_path / "plan.csv"
    machine, table = (MACHINES / f"triglide-nonredundant.{end}" for end in ("yaml", "csv"))
    assert clean(run("plan", machine, table, "-o", file)).code == 0
    both = []
    for name in ("q1", "q2"):
        way = column(file, name) - column(file, f"approach.{name}")
        side = column(file, f"dir.{name}")
        np.testing.assert_array_equal(np.sign(way)[side != 0], side[side != 0])
        assert np.mean(side == 0) < 0.05 and np.abs(way[side == 0]).max(initial=0.0) < np.abs(way[side != 0]).min()
        both.append(side)
    assert {(a, b) for a in (-1.0, 1.0) for b in (-1.0, 1.0)} <= set(zip(*both, strict=True))


def test_drives_begin_within_their_limits(tmp_path: Path) -> None:
    """The outermost readings of the plan are the limits: from outside these cannot be approached."""
    file, machine = tmp_path / "plan.csv", tmp_path / "m.yaml"
    base, table = (MACHINES / f"triglide-nonredundant.{end}" for end in ("yaml", "csv"))
    ends = {name: (np.min(column(table, name)), np.max(column(table, name))) for name in ("q1", "q2")}
    limits = ", ".join(f"{name}: {{limits: [{low}, {high}]}}" for name, (low, high) in ends.items())
    machine.write_text(f"extends: {base}\nactuators: {{{limits}}}\n", encoding="utf-8")
    for seed in range(3):
        assert clean(run("plan", machine, table, "-o", file, "--seed", str(seed), "--force")).code == 0
        for name, (low, high) in ends.items():  # as nine digits tell them
            begin, there, side = (column(file, f"{kind}{name}") for kind in ("approach.", "", "dir."))
            assert low - 1e-5 < begin.min() and begin.max() < high + 1e-5
            assert not ((there > high - 1e-5) & (side < 0) | (there < low + 1e-5) & (side > 0)).any(), "not promised"


@pytest.mark.parametrize(("lost", "code"), [(11, 0), (12, 3)])
def test_a_plan_of_which_half_cannot_be_reached_is_none(lost: int, code: int) -> None:
    """Both carriages at one end leave the rods of the Triglide apart."""
    machine, table = (MACHINES / f"triglide-nonredundant.{end}" for end in ("yaml", "csv"))
    good = list(zip(column(table, "q1"), column(table, "q2"), strict=True))[: 24 - lost]
    rows = [*good, *[(0.0, 5000.0)] * lost]
    text = "\n".join(["q1,q2", *(f"{a},{b}" for a, b in rows), ""])
    done = clean(run("plan", machine, "-", stdin=text))
    assert done.code == code, done.err
    assert code or f"{lost} of 24 rows are not used" in done.err


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


def test_one_seed_one_plan() -> None:
    options = ("plan", SCISSORS, *GRID, "--aim", "backlash@q1", "-o", "-", "--seed")
    first, again, other = (run(*options, s).out for s in ("1", "1", "2"))
    assert first == again != other


def test_force_controlled_drives_are_no_set_values(tmp_path: Path) -> None:
    file = tmp_path / "plan.csv"
    done = clean(run("plan", HANGPRINTER, HANGPRINTER_DATA, "--aim", "buildup@all", "--points", "3", "-o", file))
    assert done.code == 0
    assert "dir.A" in (head := file.read_text(encoding="utf-8").splitlines()[0]) and "dir.D" not in head
    assert "approach.A" in head, "three lines are held for three freedoms: each can go by itself"
    assert clean(run("simulate", HANGPRINTER, file)).code == 0


# --- refused -------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("options", "code", "said"),
    [
        (["--aim", "backlsh@q1"], 2, "did you mean `backlash@q1`?"),
        (["--aim", "drift"], 2, "column `time`"),
        (["--aim", "separate:backlash@q1"], 2, "--aim separate:backlash@q1,drift"),
        (["--aim", "separate:backlash@q1,backlash@q1"], 2, "two different effects"),
        (["--aim", "l3 5 K"], 2, "is no uncertainty of `l3`"),
        (["--aim", "l3 -5 um"], 2, "is no uncertainty of `l3`"),
        (["--aim", "l33 5 um"], 2, "did you mean `l3`?"),
        (["--aim", "l1"], 2, "--select auto,l1"),
        (["--points", "0"], 2, "--points"),
        (["--json", "-o", "-"], 2, "give `-o` a file"),
        (["extra.csv"], 2, "--grid"),
    ],
)
def test_wrong_options(options: list[str], code: int, said: str) -> None:
    done = clean(run("plan", SCISSORS, *GRID, *options))
    assert done.code == code and said in done.err and done.out == ""


def test_an_effect_without_a_place_is_told_its_places() -> None:
    done = clean(run("plan", SCISSORS, *GRID, "--aim", "backlash"))
    places = [name for name in effects(planned()) if name.startswith("backlash@")]
    assert done.code == 2 and len(places) > 4
    told = done.err[done.err.index("help: name one of ") :]
    assert sorted(re.findall(r"[\w.]+@[\w.]+", told)) == sorted(places)


def test_existing_files_and_nothing_to_plan(tmp_path: Path) -> None:
    there = tmp_path / "there.csv"
    there.write_text("mine", encoding="utf-8")
    done = clean(run("plan", SCISSORS, *GRID, "-o", there))
    assert done.code == 4 and "--force" in done.err and there.read_text(encoding="utf-8") == "mine"
    assert clean(run("plan", MACHINES / "triglide-nonredundant.yaml")).code == 2, "no poses, and no workspace"
