"""Corrected set points as programs, and what shims and screws change."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.command import MACHINES, TRIGLIDE, Done, run
from tests.export_readers import Array, carriage
from tests.test_export_firmware import TRUE, points, true_heights, true_position
from tests.test_export_tables import STACKED

DELTA = str(MACHINES / "delta-printer.yaml")
GRID = "x=-60:60:3,y=-60:60:3,z=0:100:2"


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("p.yaml").write_text(f"parameters: {{{', '.join(f'{n}: {v}' for n, v in TRUE.items())}}}\n")


def export(keyword: str, machine: str, *more: str) -> Done:
    done = run("correct", machine, "-p", "p.yaml", "--as", keyword, "-o", "out.txt", "--json", "--force", *more)
    assert done.code == 0, done.err
    return done


def moves(text: str) -> list[dict[str, float]]:
    """Words of the G1 lines."""
    lines = [re.sub(r";.*", "", line) for line in text.splitlines()]
    return [{w[0]: float(w[1:]) for w in line.split()[1:]} for line in lines if line.startswith("G1 ")]


def nominal_readings(positions: Array) -> Array:
    """Readings (N, 3) of the delta printer as drawn, mm: what its control computes."""
    turns = np.radians([210.0, 330.0, 90.0])
    return np.stack([carriage(positions, 136.0, t, 288.0, 0.0, (0, 0)) for t in turns], axis=1) + np.sqrt(
        288.0**2 - 136.0**2
    )


@pytest.mark.parametrize("keyword", ["gcode", "gcode-printer"])
def test_points_bring_the_true_printer_there(keyword: str) -> None:
    """The control's kinematics of the points of the program, on the true printer: targets, to the digits."""
    export(keyword, DELTA, "--grid", GRID)
    found = moves(Path("out.txt").read_text())
    sent = nominal_readings(np.array([[m[c] for c in "XYZ"] for m in found]))
    wanted = points((-60, 60, 3), (-60, 60, 3), (0, 100, 2))
    there = np.array([true_position(q, p) for q, p in zip(sent, wanted, strict=True)])
    assert len(found) == len(wanted) and there == pytest.approx(wanted, abs=5e-5)


def test_set_values_of_drives() -> None:
    """Words X, Y, Z are the readings that bring the true printer there."""
    export("gcode-drives", DELTA, "--grid", GRID)
    sent = np.array([[m[c] for c in "XYZ"] for m in moves(Path("out.txt").read_text())])
    wanted = points((-60, 60, 3), (-60, 60, 3), (0, 100, 2))
    assert sent == pytest.approx(true_heights(wanted), abs=2e-5)
    assert "X = q1, Y = q2, Z = q3" in Path("out.txt").read_text()


@pytest.mark.parametrize(
    ("keyword", "wait", "dwell"),
    [("gcode", "G4 P1.5", "1.5"), ("gcode-drives", "G4 P0.25", "0.25"), ("gcode-printer", "G4 P1500", "1.5")],
)
def test_a_dwell_in_the_dialect_of_the_control(keyword: str, wait: str, dwell: str) -> None:
    """Seconds in RS274/NGC, milliseconds in the firmware of printers, at every target."""
    export(keyword, DELTA, "--grid", GRID, "--dwell", dwell, "--feed", "750")
    lines = Path("out.txt").read_text().splitlines()
    assert lines.count(wait) == 18 and all(line.endswith("F750") for line in lines if line.startswith("G1"))
    assert ("M400" in lines) == (keyword == "gcode-printer") and ("M2" in lines) == (keyword != "gcode-printer")
    assert lines.index("G21") < lines.index("G90") < next(k for k, n in enumerate(lines) if n.startswith("G1"))


def test_names_of_targets_cannot_write_commands() -> None:
    Path("t.csv").write_text("id,x,y,z\na\u2028G1 X999,0,0,10\nb) (c;,0,10,10\n", encoding="utf-8")
    done = run("correct", DELTA, "t.csv", "-p", "p.yaml", "--as", "gcode", "-o", "out.txt", "--force")
    assert done.code == 0, done.err
    found = moves(Path("out.txt").read_text())
    assert len(found) == 2 and all(abs(m["X"]) < 1 for m in found)


@pytest.mark.parametrize("name", ["a" * 300, "\u20ac" * 300, "word " * 90])
def test_no_line_is_too_long_for_linuxcnc(name: str) -> None:
    """It refuses programs with a line of more than 252 bytes; a name, a note or an argument may be longer."""
    Path("t.csv").write_text(f"id,x,y,z\n{name},0,0,50\nb,10,0,50\n", encoding="utf-8")
    export("gcode", DELTA, "t.csv")
    text = Path("out.txt").read_text(encoding="utf-8")
    assert max(len(line.encode()) for line in text.splitlines()) <= 252 and len(moves(text)) == 2
    remarks = "".join(line[2:] for line in text.splitlines() if line.startswith(";"))
    assert name.strip() in remarks and all(line[:1] in ";GM" for line in text.splitlines())


def test_nor_is_one_of_a_plan() -> None:
    session = "monday " * 60
    Path("t.csv").write_text(f"id,x [mm],y [mm],session\na,300,250,{session}\nb,350,260,{session}\n")
    planned = run("plan", TRIGLIDE, "t.csv", "--as", "gcode", "-o", "plan.ngc", "-q")
    assert planned.code == 0, planned.err
    text = Path("plan.ngc").read_text()
    assert max(len(line.encode()) for line in text.splitlines()) <= 252 and len(moves(text)) >= 4


@pytest.mark.parametrize(
    "name", ["py, import os", " LogOpen,x.txt", "abort, no", "a" * 233 + "msg,hello", "\u20ac" * 53 + "print,1"]
)
def test_names_are_no_remarks_that_linuxcnc_carries_out(name: str) -> None:
    """It does so in remarks of both kinds, behind any blanks: a table of targets could open files, or run Python."""
    Path("t.csv").write_text(f'id,x,y,z\n"{name}",0,0,50\nb,10,0,50\n', encoding="utf-8")
    export("gcode", DELTA, "t.csv")
    text = Path("out.txt").read_text(encoding="utf-8")
    remarks = [line.partition(";")[2].strip().lower() for line in text.splitlines() if ";" in line]
    words = ("msg,", "debug,", "print,", "log,", "logopen,", "logappend,", "logclose", "py,", "pyrun,", "abort,")
    assert [line for line in remarks if line.startswith(words)] == [] and len(remarks) > 10


def test_an_angle_of_a_planar_machine_is_c() -> None:
    """A turntable on a slide whose zeros are off: words X and C, the corrected ones."""
    Path("m.yaml").write_text(
        "units: {length: mm, angle: deg}\nspace: planar\nranges: {length: 1, angle: 1}\n"
        "parameters: {zx: 0, za: {nominal: 0, unit: deg}}\nguides: {rail: {along: x}}\n"
        "bodies:\n  slide: {guide: rail, at: 100, points: {P: [0, 0]}}\n  table: {at: [100, 0], turn: 0}\n"
        "joints: {bearing: {between: [P, table], type: revolute}}\n"
        "actuators: {q: {moves: slide, zero: zx}, a: {turns: table, zero: za}}\ntool_point: table\n"
    )
    Path("p.yaml").write_text("parameters: {zx: 0.25, za: 0.5}\n")
    for keyword, rotary in (("gcode", "C"), ("gcode-drives", "A")):
        export(keyword, "m.yaml", "--grid", "x=0:200:3,rz=-20:20:3")
        found = moves(Path("out.txt").read_text())
        assert [m["X"] for m in found[:3]] == pytest.approx([-0.25] * 3, abs=1e-5)
        assert [m[rotary] for m in found[:3]] == pytest.approx([-20.5, -0.5, 19.5], abs=1e-5)


# --- shims and screws --------------------------------------------------------------------------------
def adjusted(adjustable: str, planted: str) -> Any:
    text = STACKED.replace("square: {nominal: 0, unit: deg}", f"square: {{nominal: 0, unit: deg, {adjustable}}}")
    Path("m.yaml").write_text(text)
    Path("p.yaml").write_text(f"parameters: {planted}\n")
    return export("adjust", "m.yaml", "--grid", "x=0:200:5,y=0:200:5").json["export"]


def test_what_is_adjusted_is_nominal_less_identified() -> None:
    """A column out of square by 0.05 deg is turned back by so much; the scale, which no screw changes, remains."""
    made = adjusted('adjustable: "column, upper screw"', "{square: 0.05, sy: 1.001}")
    (entry,) = made["entries"]
    assert entry["change"] == pytest.approx(-0.05) and entry["unit"] == "deg"
    assert "column, upper screw (square): -0.05" in Path("out.txt").read_text()
    of_scale = np.sqrt(((1e3 * 0.001 * np.linspace(0, 200, 5)) ** 2).mean())
    left = made["remaining"]["position"]
    assert left["export"]["rms"] == pytest.approx(of_scale, rel=0.01) and left["before"]["rms"] > 1.2 * of_scale


def test_true_means_the_parameter_itself() -> None:
    made = adjusted("adjustable: true", "{square: -0.02}")
    assert made["entries"][0]["what"] == "square" and made["remaining"]["position"]["export"]["rms"] < 0.1


def test_how_sure_an_adjustment_is() -> None:
    """The standard uncertainty of the calibration, in the unit of the parameter."""
    adjusted("adjustable: true", "{square: 0.05}")
    noise = ("--noise", "declared", "--seed", "1", "-o", "meas.csv", "-q")
    done = run("simulate", "m.yaml", "--grid", "x=0:200:5,y=0:200:5", "-p", "p.yaml", *noise)
    assert done.code == 0
    assert run("calibrate", "m.yaml", "meas.csv", "-q", "--holdout", "none", "-o", "p.yaml", "--force").code == 0
    (entry,) = export("adjust", "m.yaml", "--grid", "x=0:200:5,y=0:200:5").json["export"]["entries"]
    assert abs(entry["change"] + 0.05) < 4 * entry["std"] and 1e-5 < entry["std"] < 1e-3
    assert re.search(r"square: -0\.0\d+ deg \(u 0\.000\d+ deg\)", Path("out.txt").read_text())


@pytest.mark.parametrize("value", [r'"a\nG0 X999"', '"  "', r'"\e[31m"'])
def test_what_is_adjusted_is_one_line(value: str) -> None:
    """It stands in written lists and tables as it is."""
    text = STACKED.replace("square: {nominal: 0, unit: deg}", f"square: {{nominal: 0, unit: deg, adjustable: {value}}}")
    Path("m.yaml").write_text(text)
    done = run("check", "m.yaml")
    assert done.code == 1 and "does not say in one line what is adjusted" in done.err


@pytest.mark.parametrize("value", ["false", '""'])
def test_nothing_to_adjust(value: str) -> None:
    text = STACKED.replace("square: {nominal: 0, unit: deg}", f"square: {{nominal: 0, unit: deg, adjustable: {value}}}")
    Path("m.yaml").write_text(text)
    done = run("correct", "m.yaml", "--grid", "x=0:200:2", "--as", "adjust")
    assert done.code == 3 and "no parameter of the machine file is `adjustable`" in done.err and done.out == ""


def test_nothing_is_adjusted_by_values_that_nobody_identified() -> None:
    """Without parameters, or with those of a calibration that held it: a list of changes by 0 is no list."""
    text = STACKED.replace("square: {nominal: 0, unit: deg}", "square: {nominal: 0, unit: deg, adjustable: true}")
    Path("m.yaml").write_text(text)
    Path("p.yaml").write_text("parameters: {sy: 1.001}\n")
    for parameters in ((), ("-p", "p.yaml")):
        done = run("correct", "m.yaml", "--grid", "x=0:200:2", "--as", "adjust", *parameters)
        assert done.code == 2 and "nothing to adjust" in done.err and "-p PARAMS.yaml" in done.err and done.out == ""


def test_an_adjusted_parameter_has_one_value() -> None:
    entry = "sy: {nominal: 1}\n  z0: {nominal: 0, per: session, adjustable: true}"
    text = STACKED.replace("sy: {nominal: 1}", entry)
    Path("m.yaml").write_text(text.replace("moves: ram, scale: sy}", "moves: ram, scale: sy, zero: z0}"))
    done = run("check", "m.yaml")
    assert done.code == 1 and "is the same in all sessions" in done.err
    Path("m.yaml").write_text(STACKED.replace("sy: {nominal: 1}", "sy: {nominal: 1, adjustable: [1]}"))
    assert run("check", "m.yaml").code == 1
