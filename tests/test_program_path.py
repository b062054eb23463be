"""Programs of corrected set values: from the side that counts, and nothing strained on the way."""

from __future__ import annotations

import itertools
import re
from pathlib import Path

import numpy as np
import pytest
import yaml

from tests.command import MACHINES, SCISSORS, run
from tests.export_readers import Array
from tests.test_export_firmware import TRUE, true_position
from tests.test_export_programs import nominal_readings
from tests.test_export_tables import STACKED
from tests.truth.generate import campaigns
from tests.truth.machines import PINNED

PLAY = {"X": 40.0, "Y": 25.0}  # um


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def stops(text: str) -> tuple[Array, Array, list[int]]:
    """Words of all moves (m, axes), where drives with play are that follow them (m, axes), and at which moves the
    program waits. What is behind play stands until the drive has taken it up."""
    words: list[list[float]] = []
    followed: list[list[float]] = []
    waits: list[int] = []
    for line in text.splitlines():
        if line.startswith("G1 "):
            words.append([float(w[1:]) for w in line.split()[1:3]])
            before = followed[-1] if followed else words[-1]
            half = [0.5e-3 * p for p in PLAY.values()]
            followed.append([min(max(y, x - h), x + h) for x, y, h in zip(words[-1], before, half, strict=True)])
        elif line.startswith("G4 "):
            waits.append(len(words) - 1)
    return np.array(words), np.array(followed), waits


@pytest.mark.parametrize("keyword", ["gcode", "gcode-drives", "gcode-printer"])
def test_targets_are_approached_from_their_sides(keyword: str) -> None:
    """Play that is followed move by move, by a rule of its own: every target is met, however its side is stated."""
    effects = ", ".join(f"backlash@{drive}: {{b: {play} um}}" for drive, play in PLAY.items())
    Path("m.yaml").write_text(f"{STACKED}effects: {{{effects}}}\n")
    sides, rng = ("1", "-1", ""), np.random.default_rng(3)
    targets = rng.uniform(20, 180, (40, 2)).round(3)
    stated = [["", "-1"], *([sides[k] for k in rng.integers(0, 3, 2)] for _ in targets[1:])]
    lines = [f"{x},{y},{a},{b}" for (x, y), (a, b) in zip(targets, stated, strict=True)]
    Path("t.csv").write_text("\n".join(["x,y,dir.X,dir.Y", *lines, ""]))
    done = run("correct", "m.yaml", "t.csv", "--as", keyword, "-o", "out.txt", "--json")
    assert done.code == 0 and done.json["export"]["notes"] == []
    text = Path("out.txt").read_text()
    words, followed, waits = stops(text)
    assert followed[waits] == pytest.approx(targets, abs=2e-5), "five decimals are written"
    arriving = np.sign(np.diff(words, axis=0))[np.array(waits) - 1]
    wanted = np.array([[float(s or 0) for s in row] for row in stated])
    assert (arriving == wanted)[wanted != 0].all()
    assert len(words) < 2 * len(targets), "only where the way comes from another side"


def test_a_drive_that_turns_round_on_the_way_comes_from_its_side_too() -> None:
    """Straight moves of the tool of a linear delta: carriages with play follow them, each by a rule of its own, by
    the kinematics of the control. From far targets a carriage may arrive from another side than the order tells."""
    delta, play = str(MACHINES / "delta-printer.yaml"), 0.06
    effects = ", ".join(f"backlash@q{k}: {{b: {play} mm}}" for k in (1, 2, 3))
    Path("m.yaml").write_text(f"extends: {delta}\neffects: {{{effects}}}\n")
    targets = np.random.default_rng(5).uniform((-60, -60, 0), (60, 60, 60), (25, 3)).round(3)
    Path("t.csv").write_text("\n".join(["x,y,z", *(f"{x},{y},{z}" for x, y, z in targets), ""]))
    Path("p.yaml").write_text(yaml.safe_dump({"parameters": TRUE}))
    assert run("correct", "m.yaml", "t.csv", "-p", "p.yaml", "--as", "gcode", "-o", "out.txt").code == 0
    lines = [line for line in Path("out.txt").read_text().splitlines() if line.startswith(("G1 ", "G4 "))]
    points = np.array([[float(w[1:]) for w in line.split()[1:4]] for line in lines if line.startswith("G1 ")])
    waits = np.cumsum([line.startswith("G1 ") for line in lines])[[line.startswith("G4 ") for line in lines]] - 1
    share = np.linspace(0, 1, 400)[1:, None]
    way = np.concatenate([points[:1], *(a + share * (b - a) for a, b in itertools.pairwise(points))])
    behind, at_rest = nominal_readings(way), []
    for k in range(1, len(behind)):
        behind[k] = np.clip(behind[k - 1], behind[k] - play / 2, behind[k] + play / 2)
        if k % 399 == 0 and k // 399 in waits:
            at_rest.append(behind[k])
    there = np.array([true_position(q, p) for q, p in zip(at_rest, targets, strict=True)])
    assert there == pytest.approx(targets, abs=5e-5), "the first one has an approach of its own"
    assert len(targets) < len(points) < 2 * len(targets)


def test_sides_that_no_move_of_the_tool_point_has_are_told() -> None:
    """Carriages 1 and 3 of the Scissors run alike in its middle: they cannot come from opposite sides."""
    effects = "{backlash@q1: {b: 40 um}, backlash@q3: {b: 40 um}}"
    Path("m.yaml").write_text(f"extends: {SCISSORS}\neffects: {effects}\n")
    Path("t.csv").write_text("id,x,y,dir.q1,dir.q3\na,0,0,1,1\nb,1,0,1,-1\nc,40,0,-1,-1\n")
    done = run("correct", "m.yaml", "t.csv", "--as", "gcode-drives", "-o", "out.txt")
    assert done.code == 0 and "1 target (`b`): no move of the tool point comes from the sides of `dir`" in done.err
    text = Path("out.txt").read_text()
    targets = [part.splitlines() for part in text.split("; target ")[1:]]
    last = [[float(line.split()[1][1:]) for line in lines if line.startswith("G1 ")][-2:] for lines in targets]
    assert len(last[0]) == 2 and last[0][0] < last[0][1] - 1 and last[2][0] > last[2][1] + 1, "mm"
    assert "the error there is larger than stated" in text


def test_a_program_of_redundant_drives_strains_nothing_on_its_way() -> None:
    """The Scissors with errors planted, in the independent simulator: at each move, and half-way to the next, forces
    are small beside those of nominal set values; moved straight from target to target they would be thousands of kN.
    """
    truth, si = PINNED["scissors"](), campaigns()["scissors"].planted()
    planted = yaml.safe_load((MACHINES / "scissors.csv.provenance.yaml").read_text())["planted"]["parameters"]
    Path("p.yaml").write_text(yaml.safe_dump({"parameters": planted}))
    grid = ("--grid", "x=-200:200:2,y=-200:200:2")
    done = run("correct", SCISSORS, *grid, "-p", "p.yaml", "--as", "gcode-drives", "-o", "out.txt", "--json")
    assert done.code == 0, done.err
    nominal = truth.inverse([[x, y] for x in (-0.2, 0.2) for y in (-0.2, 0.2)])
    uncorrected = np.abs(truth.forward(nominal, si).drive_force).max()
    text = Path("out.txt").read_text()
    words = np.array([[float(w[1:]) for w in m.split()] for m in re.findall(r"^G1 (.*) F", text, re.MULTILINE)]) * 1e-3
    ends = text.split("; target")[1:]
    targets = np.array([[float(w[1:]) for w in end.split("G1 ")[-1].split()[:4]] for end in ends]) * 1e-3
    assert len(words) > 100 and len(targets) == 4
    for row in (words, 0.5 * (words[1:] + words[:-1])):
        forces = np.abs(truth.forward(row[::7], si).drive_force).max()
        assert forces < 0.25 * uncorrected, f"{forces:.0f} N beside {uncorrected:.0f} N"
    straight = truth.forward(0.5 * (targets[1:] + targets[:-1]), si).drive_force
    assert np.abs(straight).max() > 100 * uncorrected


@pytest.mark.parametrize("grid", ["x=0:0.1:2,y=0:0:1", "x=0:0:1,y=0:0:1"])
def test_targets_side_by_side_need_no_points_between(grid: str) -> None:
    done = run("correct", SCISSORS, "--grid", grid, "--as", "gcode-drives", "-o", "out.txt", "--json")
    assert done.code == 0, done.err
    assert len(re.findall(r"^G1 ", Path("out.txt").read_text(), re.MULTILINE)) == done.json["n_targets"]
    assert run("plan", SCISSORS, "--grid", grid, "--as", "gcode", "-o", "plan.ngc").code == 0
