"""Tables of single drives: by each control's own rule, on independent machines, they leave the error that is told."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.command import MACHINES, SCISSORS, run
from tests.correction_cases import csv_text, planar_leg, rms
from tests.export_readers import added, comp_table, ssfk_table, tables_of
from tests.in_ci import in_ci

TABLES = ("linuxcnc", "beckhoff", "csv")

STACKED = """
units: {length: mm, angle: deg, force: N}
space: planar
ranges: {length: 0.5, angle: 0.1, scale: 1e-2}
parameters:
  sx: {nominal: 1}
  sy: {nominal: 1}
  square: {nominal: 0, unit: deg}
frames: {head: {body: slide, turn: square}}
guides: {rail: {along: x}, column: {frame: head, along: y}}
bodies:
  slide: {guide: rail, at: 100}
  ram: {guide: column, at: 100, points: {tip: [0, 0]}}
actuators:
  X: {moves: slide, scale: sx}
  Y: {moves: ram, scale: sy}
sensors: {grid: {at: tip, reads: [x, y], sigma: 1 um, frame: machine}}
tool_point: tip
"""
GRID = "x=0:200:9,y=0:200:9"


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("m.yaml").write_text(STACKED)


def export(keyword: str, parameters: str, *more: str, grid: str = GRID) -> dict[str, dict[str, float]]:
    """Errors of the position that are told to remain, um."""
    Path("p.yaml").write_text(f"parameters: {parameters}\n")
    done = run("correct", "m.yaml", "--grid", grid, "-p", "p.yaml", "--as", keyword, "-o", "t.txt", "--json", "--force",
               *more)  # fmt: skip
    assert done.code == 0, done.err
    remaining: dict[str, dict[str, float]] = done.json["export"]["remaining"]["position"]
    return remaining


def targets() -> np.ndarray:
    return np.array([[x, y] for x in np.linspace(0, 200, 9) for y in np.linspace(0, 200, 9)])


@pytest.mark.parametrize("keyword", in_ci(["linuxcnc"], TABLES))
def test_what_remains_is_so_on_an_independent_machine(keyword: str, tmp_path: Path) -> None:
    """The Biglide with lengths off: tables leave what depends on the pose, and `correct` says how much."""
    case = planar_leg()
    case.calibrated(tmp_path)
    x, y = np.meshgrid(np.linspace(0.22, 0.48, 9), np.linspace(0.22, 0.33, 7), indexing="ij")
    wanted = np.stack([x.ravel(), y.ravel()], axis=1)
    Path("t.csv").write_text(csv_text(case.coordinates, 1e3 * wanted))
    done = run("correct", "machine.yaml", "t.csv", "-p", "p.yaml", "--as", keyword, "-o", "out.tab", "--json")
    assert done.code == 0, done.err
    told = done.json["export"]["remaining"]["position"]
    names = [d.split(" ")[0] for d in case.drives]
    nominal = case.nominal(wanted)
    commanded = dict(zip(names, nominal.T, strict=True))
    sent = added(tables_of(keyword, Path("out.tab"), names), commanded)
    before, after = (1e6 * rms(case.forward(q)[0] - wanted) for q in (nominal, sent))
    assert told["before"]["rms"] == pytest.approx(before, rel=0.02)
    assert told["export"]["rms"] == pytest.approx(after, abs=2.0)
    assert 5 < told["export"]["rms"] < before / 5
    assert told["corrected"]["rms"] < 1e-3
    x, y = np.meshgrid(np.linspace(0.23, 0.47, 8), np.linspace(0.225, 0.325, 6), indexing="ij")
    between = np.stack([x.ravel(), y.ravel()], axis=1)
    sent = added(tables_of(keyword, Path("out.tab"), names), dict(zip(names, case.nominal(between).T, strict=True)))
    assert 0.7 < told["not_fitted"]["rms"] / (1e6 * rms(case.forward(sent)[0] - between)) < 1.5


def test_tables_of_few_targets_do_not_swing_between_them() -> None:
    """48 targets of a delta, 50 numbers of three drives: without regard to other targets 4 mm at some of them."""
    text = (MACHINES / "delta-printer.yaml", MACHINES / "delta-printer.csv")
    assert run("calibrate", *text, "-o", "d.yaml", "-q", "--holdout", "none").code == 0
    remaining = []
    for grid in ("x=-60:60:4,y=-60:60:4,z=0:100:3", "x=-60:60:7,y=-60:60:7,z=0:100:4"):
        done = run("correct", text[0], "--grid", grid, "-p", "d.yaml", "--as", "csv", "-o", "d.csv", "--force",
                   "--json")  # fmt: skip
        remaining.append(done.json["export"]["remaining"]["position"])
    few, many = remaining
    assert few["not_fitted"]["rms"] < 1.3 * many["export"]["rms"] and few["not_fitted"]["max"] < 1000
    one = run("correct", text[0], "--grid", "x=0:0:1,y=0:0:1,z=50:50:1", "-p", "d.yaml", "--as", "csv", "-o", "e.csv")
    assert "between the targets: unknown with 1 target" in one.err


@pytest.mark.parametrize("keyword", TABLES)
def test_errors_of_single_drives_leave_nothing(keyword: str) -> None:
    """x = sx q: the table of a drive can hold it."""
    left = export(keyword, "{sx: 1.002, sy: 0.999}")
    assert left["before"]["rms"] > 200 and left["export"]["max"] < 0.2
    q = targets()
    sent = added(tables_of(keyword, Path("t.txt"), ["X", "Y"]), {"X": 1e-3 * q[:, 0], "Y": 1e-3 * q[:, 1]})
    assert sent * [1.002, 0.999] == pytest.approx(1e-3 * q, abs=1e-7)


def test_squareness_stays() -> None:
    """With x = qx - qy sin(s), the table of X is best with the mean of y: sin(s) times the spread of y remains."""
    left = export("csv", "{square: 0.05}")
    size, y = 1e6 * np.sin(np.radians(0.05)), np.linspace(0, 0.2, 9)
    assert left["export"]["rms"] == pytest.approx(size * np.std(y), rel=1e-3)
    assert left["before"]["rms"] == pytest.approx(size * np.sqrt((y**2).mean()), rel=1e-3)


@pytest.mark.parametrize("scale", [1, -1])
@pytest.mark.parametrize("keyword", TABLES)
def test_backlash_has_two_columns(keyword: str, scale: int) -> None:
    """A drive that arrives b/2 short from either side, also one whose readings count against its travel: forward and
    reverse differ by b, and nothing remains."""
    machine = STACKED.replace("sy: {nominal: 1}", f"sy: {{nominal: {scale}}}")
    Path("m.yaml").write_text(machine + "effects: {backlash@Y: {b: 20 um}}\n")
    left = export(keyword, "{sx: 1.0}")
    assert left["before"]["max"] == pytest.approx(10, abs=0.1)
    tables = tables_of(keyword, Path("t.txt"), ["X", "Y"])
    at, ahead, back = tables["Y"]
    assert np.abs(ahead - back) == pytest.approx(np.full(len(at), 20e-6), abs=1e-6)
    assert np.abs(tables["X"][1]).max() < 1e-7
    assert left["export"]["rms"] < 3  # the side of the first target is not known


def test_a_reversal_is_in_the_table_of_its_drive_alone() -> None:
    """Redundant drives, and errors that no table holds: these are not spread over both directions of all drives."""
    Path("m.yaml").write_text(f"extends: {SCISSORS}\neffects: {{backlash@q3: {{b: 30 um}}}}\n")
    at = np.random.default_rng(1).uniform(-90, 90, (60, 2)).round(3)
    Path("t.csv").write_text("\n".join(["x,y", *(f"{x},{y}" for x, y in at), ""]))
    Path("p.yaml").write_text("parameters: {l3: 950.2, xa1: 519.8, ya4: 280.1, g1: 0.02}\n")
    done = run("correct", "m.yaml", "t.csv", "-p", "p.yaml", "--as", "csv", "-o", "t.txt", "--json")
    assert done.code == 0, done.err
    tables = tables_of("csv", Path("t.txt"), ["q1", "q2", "q3", "q4"])
    for name, size in (("q1", 0.0), ("q2", 0.0), ("q3", 30e-6), ("q4", 0.0)):
        _, ahead, back = tables[name]
        assert ahead - back == pytest.approx(np.full(len(ahead), size), abs=3e-9), name
    left = done.json["export"]["remaining"]["position"]
    assert left["export"]["rms"] < 0.2 * left["before"]["rms"]


def test_reversal_that_grows_with_the_force_keeps_two_columns() -> None:
    Path("m.yaml").write_text(f"extends: {SCISSORS}\neffects: {{windup@q3: {{w: 5 um/kN}}}}\n")
    Path("p.yaml").write_text("parameters: {l3: 950.02}\n")
    at = np.random.default_rng(1).uniform(-90, 90, (40, 2)).round(3)
    Path("t.csv").write_text("\n".join(["x,y", *(f"{x},{y}" for x, y in at), ""]))
    asked = ("--redundant", "nominal", "--as", "csv", "-o", "t.txt")
    assert run("correct", "m.yaml", "t.csv", "-p", "p.yaml", *asked).code == 0
    tables = tables_of("csv", Path("t.txt"), ["q1", "q2", "q3", "q4"])
    spans = {name: np.abs(ahead - back).max() for name, (_, ahead, back) in tables.items()}
    assert spans["q3"] > 1e-6 and max(spans[n] for n in ("q1", "q2", "q4")) == 0


def test_one_direction_is_said_where_it_does_not_matter() -> None:
    export("beckhoff", "{sx: 1.001}")
    text = Path("t.X.txt").read_text()
    assert "kw.ssfk.bilateral               0" in text and ".neg" not in text
    _, ahead, back = ssfk_table(Path("t.X.txt"))
    assert (ahead == back).all()


def test_remarks_end_the_table_of_linuxcnc() -> None:
    """The control stops reading at the first line that is no triplet: nothing may stand before the numbers."""
    export("linuxcnc", "{sx: 1.001}")
    lines = Path("t.X.txt").read_text().splitlines()
    first = next(k for k, line in enumerate(lines) if line.startswith("#"))
    assert len(comp_table(Path("t.X.txt"))[0]) == first and all(line.startswith("#") for line in lines[first:])
    assert any("remains, position" in line for line in lines) and any("linuxcnc.org" in line for line in lines)


def test_tables_do_not_fit_the_targets_alone() -> None:
    """Few targets, few knots: between the targets the error is as told."""
    few = export("csv", "{square: 0.05, sx: 1.003}", grid="x=0:200:3,y=0:200:3")
    assert len(tables_of("csv", Path("t.txt"), ["X", "Y"])["X"][0]) <= 3
    q = 1e-3 * targets()
    sent = added(tables_of("csv", Path("t.txt"), ["X", "Y"]), {"X": q[:, 0], "Y": q[:, 1]})
    s = np.radians(0.05)
    true = np.stack([1.003 * sent[:, 0] - np.sin(s) * sent[:, 1], np.cos(s) * sent[:, 1]], axis=1)
    assert 1e6 * rms(true - q) < 1.2 * few["export"]["rms"]


def test_a_drive_that_stands_still_has_a_table() -> None:
    left = export("linuxcnc", "{sx: 1.002}", grid="x=0:200:9,y=100:100:1")
    at, ahead, _ = comp_table(Path("t.Y.txt"))
    assert left["export"]["max"] < 0.2 and (np.diff(at) > 0).all() and np.abs(ahead).max() < 1e-6


TABLE = """
units: {length: mm, angle: rad}
space: planar
ranges: {scale: 1e-2}
parameters: {sa: {nominal: 1}}
ground: {O: [0, 0]}
bodies: {table: {at: [0, 0]}}
joints: {bearing: {between: [O, table], type: revolute}}
actuators: {A: {turns: table, scale: sa}}
tool_point: table
"""


@pytest.mark.parametrize(("keyword", "digit"), [("linuxcnc", 1e-6), ("beckhoff", 1e-4)])
def test_rotary_drives_are_counted_in_degrees(keyword: str, digit: float) -> None:
    """A turntable that turns by 1.002 times its reading, whatever the units of the file."""
    Path("m.yaml").write_text(TABLE)
    Path("p.yaml").write_text("parameters: {sa: 1.002}\n")
    grid = f"rz={-np.pi / 3}:{np.pi / 3}:13"
    done = run("correct", "m.yaml", "--grid", grid, "-p", "p.yaml", "--as", keyword, "-o", "t.txt", "--json")
    assert done.code == 0, done.err
    left = done.json["export"]["remaining"]["orientation"]
    read = comp_table if keyword == "linuxcnc" else ssfk_table
    at, ahead = (1e3 * column for column in read(Path("t.A.txt"))[:2])  # read as mm, 0.1 um; 0.0001 deg for these
    turned = np.linspace(-60, 60, 13)
    sent = turned + np.interp(turned, at, ahead)
    assert 1.002 * sent == pytest.approx(turned, abs=2 * digit)
    assert left["before"]["max"] == pytest.approx(1e6 * np.radians(0.12), rel=1e-2) and left["export"]["max"] < 4
