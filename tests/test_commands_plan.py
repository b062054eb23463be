"""`pkmcal plan`, run: points improve what they are for and can be reached; the table is one that can be measured."""

from __future__ import annotations

import csv
import re
from functools import cache
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest

from pkmcal_cli.diagnosis.detection import Detection
from pkmcal_cli.report.added_points import Reached
from tests.command import HANGPRINTER, HANGPRINTER_DATA, MACHINES, SCISSORS, SHOPFLOOR, Done, clean, column, run
from tests.in_ci import in_ci
from tests.support import model

GRID = ("--grid", "x=-200:200:5,y=-200:200:5")


@cache
def planned(*options: str) -> Done:
    return clean(run("plan", SCISSORS, *GRID, *options, "--json"))


def effects(done: Done) -> dict[str, dict[str, Any]]:
    return {f"{e['effect']}@{e['at']}": e for e in done.json["effects"]}


@pytest.fixture(scope="module")
def separating(tmp_path_factory: pytest.TempPathFactory) -> tuple[Done, Path]:
    """A plan with five further points, and its table."""
    file = tmp_path_factory.mktemp("separating") / "plan.csv"
    aim = ("--aim", "separate:backlash@q1,backlash@q2", "--points", "5")
    return clean(run("plan", SCISSORS, *GRID, *aim, "-o", file)), file


# --- what a plan shows ---------------------------------------------------------------------
@pytest.mark.slow
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


def test_what_is_shown_is_readable(separating: tuple[Done, Path]) -> None:
    shown = separating[0].err
    assert "e+0" not in shown and "prior standard" not in shown and "\u2026" not in shown
    assert "smallest separable size" in shown and " um -> " in shown
    assert "not testable: thermal_base, thermal_foot, " in shown


# --- further points ------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("aimed", "kind"),
    in_ci(
        ["xa1,l3-determine"],
        [
            ("backlash@q3", "see"),
            ("straight@left.x", "see"),
            ("separate:backlash@q2,backlash@q4", "separate"),
            ("separate:scale@q1,straight@left.x", "separate"),
            ("xa1,l3", "determine"),
            ("uncertainty", "determine"),
        ],
    ),
)
def test_points_improve_their_figure_within_the_limits(aimed: str, kind: str) -> None:
    with patch.object(Detection, "size", lambda *_: np.nan):  # no campaigns: sizes of other effects do not count
        result = clean(run("plan", SCISSORS, *GRID, "--aim", aimed, "--points", "6", "--json")).json
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


def test_more_points_are_advised_only_where_they_help() -> None:
    """Nothing is strained at nominal dimensions, so no pose tells of a stiffness."""
    done = planned("--select", "auto,k1", "--aim", "k1 1 kN/mm", "--points", "2")
    assert not done.json["aim"]["reached"] and "more points hardly help, only other measurements" in done.err
    for after, helps in ((1.9, True), (1.9999, False), (2.0, False)):  # best points first, up to 400 of them
        assert Reached("l1", limit=1.0, before=2.0, after=after).within_reach(6) == helps


def limits() -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    found = np.array([a.limits for a in model("scissors").actuators]) * 1e3
    return found[:, 0] - 1e-9, found[:, 1] + 1e-9


@pytest.mark.slow
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


@pytest.mark.slow
def test_chosen_points_are_better_than_more_of_the_same() -> None:
    """Six chosen points lower the smallest detectable size by more than six average ones."""
    aim = planned("--aim", "backlash@q3", "--points", "6").json["aim"]
    assert aim["after"] < aim["before"] * np.sqrt(25 / 31)


# --- the table to run ----------------------------------------------------------------------
def test_the_table_can_be_run(separating: tuple[Done, Path], tmp_path: Path) -> None:
    """Every pose once in random order, a datum again and again, all kinds of sides."""
    done, file = separating
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


@pytest.mark.slow
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


@pytest.mark.slow
def test_one_seed_one_plan() -> None:
    options = ("plan", SCISSORS, *GRID, "--aim", "backlash@q1", "-o", "-", "--seed")
    first, again, other = (run(*options, s).out for s in ("1", "1", "2"))
    assert first == again != other


def test_force_controlled_drives_are_no_set_values(tmp_path: Path) -> None:
    file = tmp_path / "plan.csv"
    done = clean(run("plan", HANGPRINTER, HANGPRINTER_DATA, "--aim", "buildup@all", "--points", "3", "-o", file))
    assert done.code == 0
    head = file.read_text(encoding="utf-8").splitlines()[0]
    assert "dir.A" in head and "dir.D" in head and "approach.D" not in head
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
        (["--aim", "l3 5 K"], 2, "is not an uncertainty of `l3`\nhelp: write e.g. 20 um"),
        (["--select", ""], 2, "which `check` lists"),
        (["--aim", "l3 60"], 2, 'with its unit, for example "20 um"'),
        (["--aim", ""], 2, "write `uncertainty`"),
        (["--aim", " , "], 2, "write `uncertainty`"),
        (["--aim", "l3 -5 um"], 2, "is not an uncertainty of `l3`"),
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
    other = clean(run("plan", SCISSORS, *GRID, "--aim", "backlash@q9")).err
    assert other.endswith(told), "no place is nearer to q9 than another"


def test_existing_files_and_nothing_to_plan(tmp_path: Path) -> None:
    there = tmp_path / "there.csv"
    there.write_text("mine", encoding="utf-8")
    done = clean(run("plan", SCISSORS, *GRID, "-o", there))
    assert done.code == 4 and "--force" in done.err and there.read_text(encoding="utf-8") == "mine"
    assert clean(run("plan", MACHINES / "triglide-nonredundant.yaml")).code == 2, "no poses, and no workspace"
