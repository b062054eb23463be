"""`check M.yaml TABLE`: a table against the nominal machine, and the constant of one drive that explains its misfit."""

from __future__ import annotations

import re
from pathlib import Path

import pandas as pd
import pytest

from tests.command import MACHINES, run

MACHINE = "triglide.yaml"
FRAME = """
units: {length: mm, angle: deg, force: N}
space: planar
ranges: {length: 0.1}
ground: {A: [0, 0], B: [1000, 0]}
nodes: {C: [500, 400]}
parameters: {h: {nominal: 640, range: 0.1}}
bars: {b1: {between: [A, C], EA: 20 MN, length: h}, b2: {between: [B, C], EA: 20 MN}}
sensors: {t: {at: C, reads: [x, y], frame: machine, sigma: 10 um}}
"""
STACKED = """
units: {length: mm, angle: deg, force: N}
space: planar
ranges: {length: 0.1}
guides: {rail: {at: [0, 0]}, upper: {body: car}}
bodies:
  car: {guide: rail, at: 500}
  fine: {guide: upper, at: 50, points: {tip: [0, l]}}
actuators: {q1: {moves: car}, q2: {moves: fine}}
parameters: {l: {nominal: 30, range: 0.1}}
sensors: {t: {at: tip, reads: [x, y], frame: machine, sigma: 10 um}}
"""


def spoilt(folder: Path, off: dict[str, float]) -> Path:
    """A table simulated on the nominal Triglide, whose drives read so many millimetres more than they should."""
    path = folder / "t.csv"
    grid = ("--grid", "x=200:700:6,y=200:350:4", "--noise", "declared", "--seed", "3")
    assert run("simulate", MACHINES / MACHINE, *grid, "-o", path).code == 0
    table = pd.read_csv(path)
    for name, size in off.items():
        table[f"{name} [mm]"] += size
    table.to_csv(folder / "off.csv", index=False)
    return folder / "off.csv"


@pytest.mark.parametrize(("drive", "size"), [("q1", 8.0), ("q2", -8.0), ("q3", 20.0)])
def test_the_zero_of_one_drive_is_named_with_its_size(drive: str, size: float, tmp_path: Path) -> None:
    done = run("check", MACHINES / MACHINE, spoilt(tmp_path, {drive: size}), "--json")
    assert done.code == 0, done.err
    text = done.json["measurements"]["warnings"][-1]  # after that of drives that strain the structure
    found = re.search(r"Drive `(\w+)` explains it: it reads ([\d.]+) mm too (much|little) throughout", text)
    assert found is not None, text
    assert found[1] == drive
    assert float(found[2]) * {"much": 1, "little": -1}[found[3]] == pytest.approx(size, abs=0.02)  # noise: 10 um
    assert text in done.err


def test_of_two_drives_that_are_off_none_is_named(tmp_path: Path) -> None:
    done = run("check", MACHINES / MACHINE, spoilt(tmp_path, {"q1": 9.0, "q3": -7.0}), "--json")
    text = done.json["measurements"]["warnings"][-1]
    assert "times farther from the nominal machine" in text and "Drive" not in text


def test_what_ranges_and_noise_explain_is_no_warning(tmp_path: Path) -> None:
    """The noise alone is as stated; a drive that is off by less than ranges explain is a parameter's business."""
    good = run("check", MACHINES / MACHINE, spoilt(tmp_path, {}), "--json").json["measurements"]
    assert good["warnings"] == []
    sigma = 0.01  # mm, of the Triglide's sensor
    assert all(0.7 * sigma < c["rms"] < 1.3 * sigma for c in good["nominal"])
    assert all(c["expected"] > c["rms"] for c in good["nominal"])
    (tmp_path / "little").mkdir()
    little = run("check", MACHINES / MACHINE, spoilt(tmp_path / "little", {"q1": 0.1}), "--json").json["measurements"]
    assert little["warnings"] == []


def test_the_row_that_is_furthest_off_is_told(tmp_path: Path) -> None:
    path = spoilt(tmp_path, {})
    table = pd.read_csv(path)
    table.loc[7, "y [mm]"] += 0.5
    table.to_csv(path, index=False)
    by_name = {c["name"]: c for c in run("check", MACHINES / MACHINE, path, "--json").json["measurements"]["nominal"]}
    assert by_name["y"]["line"] == 9 and by_name["y"]["max"] == pytest.approx(0.5, abs=0.05)


def test_what_explains_no_drive_has_a_remedy(tmp_path: Path) -> None:
    """One wrong cell of a drive: its row is named; two drives that are off: what to check."""
    path = spoilt(tmp_path, {})
    table = pd.read_csv(path)
    table.loc[7, "q1 [mm]"] += 60.0
    table.to_csv(path, index=False)
    text = run("check", MACHINES / MACHINE, path, "--json").json["measurements"]["warnings"][-1]
    assert f"so far off as {path}:9" in text and "check every cell there" in text
    (tmp_path / "both").mkdir()
    both = run("check", MACHINES / MACHINE, spoilt(tmp_path / "both", {"q1": 9.0, "q3": -7.0}), "--json")
    assert "Check signs, units and zeros" in both.json["measurements"]["warnings"][-1]


def test_a_frame_without_drives_is_far_off_by_no_drive(tmp_path: Path) -> None:
    """Its point was measured 20 mm above where it is."""
    (tmp_path / "m.yaml").write_text(FRAME, encoding="utf-8")
    (tmp_path / "t.csv").write_text("x,y\n500,420\n500.01,420.01\n499.99,420\n500,419.99\n", encoding="utf-8")
    done = run("check", tmp_path / "m.yaml", tmp_path / "t.csv", "--json")
    assert done.code == 0, done.err
    (text,) = done.json["measurements"]["warnings"]
    assert "times farther from the nominal machine" in text and "Drive" not in text


def test_of_two_drives_that_explain_it_as_well_none_is_named(tmp_path: Path) -> None:
    """A fine axis on a coarse one, both along x, which reads 5 mm too much."""
    (tmp_path / "m.yaml").write_text(STACKED, encoding="utf-8")
    (tmp_path / "t.csv").write_text("q1,q2,x,y\n100,20,125,30\n300,-20,285,30.01\n0,10,15,30\n", encoding="utf-8")
    (text,) = run("check", tmp_path / "m.yaml", tmp_path / "t.csv", "--json").json["measurements"]["warnings"]
    assert "the readings of `x` are" in text and "Drive" not in text


def test_of_a_long_table_the_sample_is_told(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    grid = ("--grid", "x=200:700:20,y=200:350:15", "--noise", "declared", "-o", path)
    assert run("simulate", MACHINES / MACHINE, *grid).code == 0
    assert "nominal parameters, 200 of 300 rows;" in run("check", MACHINES / MACHINE, path).err


def test_readings_in_a_frame_that_is_fitted_are_compared_as_points_or_said_not_to_be(tmp_path: Path) -> None:
    machine, table = MACHINES / "hexapod7.yaml", MACHINES / "hexapod7.csv"
    fitted = tmp_path / "m.yaml"
    fitted.write_text(f"extends: {machine}\nsensors: {{tracker: {{frame: fitted}}}}\n", encoding="utf-8")
    done = run("check", fitted, table, "--json")
    assert {c["name"] for c in done.json["measurements"]["nominal"]} == {"x", "y", "z", "rx", "ry", "rz"}
    assert "not compared" not in run("check", fitted, table).err
    assert "not compared" not in run("check", machine, table).err
    fitted.write_text(f"extends: {machine}\nsensors: {{tracker: {{reads: [x, y, rx, ry, rz], frame: fitted}}}}\n")
    assert "not compared: x, y, rx, ry, rz (read in a frame" in run("check", fitted, table).err
