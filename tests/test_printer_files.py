"""`pkmcal new --from`: how files are written: indents, saved blocks, conditions, commands of other firmware."""

from __future__ import annotations

import configparser
from pathlib import Path

import pytest
import yaml

from tests.command import run

KLIPPER = """[printer]
kinematics: delta
delta_radius: 100.5
[stepper_a]
position_endstop: 300.5
arm_length: 200.25
[gcode_macro X]
variable-x: 3
  [printer]
gcode:
\tdelta_radius: 3
[stepper_b] at the back

  # of the tower
  position_endstop = 301.75
  angle: 329.5 ; measured
[stepper_c]
    position_endstop: 302
    arm_length: 200.5
"""
SAVED = """
#*# <---------------------- SAVE_CONFIG ---------------------->
#*# DO NOT EDIT THIS BLOCK OR BELOW. The contents are auto-generated.
#*#
"""
DELTA_G = "M665 L361.7 R180.7 H470\nM666 X-0.748 Y-0.006 Z0.755\n"
SLIDEPRINTER_G = "M669 K6 N3\nM669 A0:-1900:0 B1645:950:0 C-1645:950:0\nM666 Q0 R30:30:30 U1:1:1 L20:20:20 H20:20:20\n"
HANGPRINTER_G = """M669 K6 A0.00:-1604.54:-114.08 B1312.51:1270.88:-162.19 C-1440.27:741.63:-161.23 D0:0:2345.00 P2000
M666 Q0.0356 R65.24:65.14:65.30:64.67 U2:2:2:4 O1:1:1:1 L20:20:20:20 H255:255:255:255 J25:25:25:25
"""


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def constants(text: str, name: str) -> dict[str, float]:
    Path(name).write_text(text)
    done = run("new", "--from", name, "-o", "m.yaml", "--force", "-q")
    assert done.code == 0, done.err
    parameters = yaml.safe_load(Path("m.yaml").read_text())["parameters"]
    return {name: about["nominal"] for name, about in parameters.items()}


def told(text: str, name: str = "config.g") -> str:
    Path(name).write_text(text)
    done = run("new", "--from", name, "-o", "m.yaml", "--force")
    assert done.code == 3, done.err
    return done.err


def test_indented_options_are_those_of_the_parser_of_klipper() -> None:
    """What stands further in than an option goes on with its value; else an option may be indented."""
    truth = configparser.RawConfigParser(strict=False, inline_comment_prefixes=(";", "#"))
    truth.read_string(KLIPPER)
    defaults = {"arm_b": 200.25, "angle_a": 210, "angle_b": 330, "angle_c": 90}
    wanted = {"delta_radius": truth.getfloat("printer", "delta_radius")}
    for tower in "abc":
        for option, name in (("position_endstop", "endstop"), ("arm_length", "arm"), ("angle", "angle")):
            default = defaults.get(f"{name}_{tower}")
            wanted[f"{name}_{tower}"] = truth.getfloat(f"stepper_{tower}", option, fallback=default)
    assert constants(KLIPPER, "printer.cfg") == wanted


def test_only_the_first_file_has_a_block_of_save_config() -> None:
    """In a file that is included, and above its beginning, the block is a remark."""
    Path("old.cfg").write_text(f"[mcu]\nserial: x\n{SAVED}#*# [stepper_c]\n#*# angle = 89\n")
    remarks = "#*#\n#*#[printer]\n#*#delta_radius = 3\n#*# [stepper_a]\n#*# angle = 3\n"
    saved = f"{SAVED}#*# [stepper_b]\n#*# arm_length = 200.125\n#*# x = \n#*# \tangle = 4\n\n"
    found = constants(f"[include old.cfg]\n{remarks}{KLIPPER}{saved}", "printer.cfg")
    assert [found[n] for n in ("angle_c", "angle_a", "delta_radius", "arm_b")] == [90, 210, 100.5, 200.125]
    assert found["angle_b"] == 329.5


@pytest.mark.parametrize("added", ["angle: 89", "", "[stepper_c]", "#*#angle = 89"])
def test_a_block_that_klipper_ignores_is_refused(added: str) -> None:
    """One line that it did not write, and it takes none of them."""
    error = told(f"{KLIPPER}{SAVED}#*# [stepper_b]\n{added}\n#*# arm_length = 200.125\n", "printer.cfg")
    assert "a line in the block of SAVE_CONFIG" in error and "printer.cfg:25:1" in error and "move it above" in error


def test_commands_in_conditions_are_refused() -> None:
    """Nobody knows which of them holds; behind the condition they hold again."""
    condition = "if global.effector == 1\n  M665 R100\n\n; remark\n\tM666 X1\nelse\n    while true\n        M665 R105\n"
    error = told(f"{DELTA_G}{condition}")
    assert [f"config.g:{line}" in error for line in (4, 7, 10)] == [True] * 3
    assert error.count("stands in a condition") == 3 and "write the values that hold" in error
    found = constants(f"if true\n  M550 P1\n{DELTA_G}  M666 Y0.5\n", "config.g")
    assert (found["radius"], found["stop_y"]) == (180.7, 0.5)


@pytest.mark.parametrize("letter", ["S80", "A0.1", "C-0.3", "D3"])
def test_commands_of_other_firmware_are_refused(letter: str) -> None:
    """Marlin's M666 counts stops the other way: read as that of RepRapFirmware, every height would be wrong."""
    error = told(DELTA_G.replace("H470", f"H470 {letter}"))
    assert f"M665 {letter[0]} is none of RepRapFirmware" in error and "other sign" in error and "config.g:1:25" in error


def test_a_parameter_that_a_command_has_twice_is_refused() -> None:
    error = told(DELTA_G.replace("H470", "H470 r181"))
    assert "M665 has R twice" in error and "config.g:1:25" in error and "takes the first" in error
    assert constants(f"{DELTA_G}M665 R181\nM665 R182 M665 R183\n", "config.g")["radius"] == 183


def test_three_anchors_are_one_fault() -> None:
    error = told(SLIDEPRINTER_G)
    assert "3 anchors cannot be read" in error and error.count("error[") == 1


@pytest.mark.parametrize(("more", "noted"), [("W2.375", True), ("W0.0", False), ("W2 F0", False), ("W2 F1", True)])
def test_compensation_of_flex_is_noted(more: str, noted: bool) -> None:
    Path("config.g").write_text(f"{HANGPRINTER_G}M666 {more}\n")
    done = run("new", "--from", "config.g", "-o", "m.yaml")
    assert done.code == 0 and ("has no compensation of flex" in done.err) is noted


def test_a_hangprinter_with_buildup_comes_back() -> None:
    """new, correct --as, new: anchors and radii of the true machine; they were a millimetre off beside the build-up."""
    before = constants(HANGPRINTER_G, "config.g")
    true = {"Ax": 5.0, "Ay": -1610.25, "Dz": 2350.5, "radius_A": 65.4, "radius_D": 64.9}
    Path("p.yaml").write_text(f"parameters: {{{', '.join(f'{n}: {v}' for n, v in true.items())}}}\n")
    grid = "x=-300:300:3,y=-300:300:3,z=100:900:3"
    done = run("correct", "m.yaml", "--grid", grid, "-p", "p.yaml", "--as", "reprapfirmware", "-o", "out.g", "-q")
    assert done.code == 0, done.err
    assert "M666 Q0.0356 " in Path("out.g").read_text()
    assert constants(Path("out.g").read_text(), "again.g") == pytest.approx(before | true, abs=5e-3)
