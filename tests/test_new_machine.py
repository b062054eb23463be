"""`pkmcal new --from`: constants digit by digit, set values as the firmware's own formula, written anew, has them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from tests.command import MACHINES, run, table
from tests.export_readers import Array, hangprinter, klipper_delta, klipper_winch, reprap_delta

CFG = """# a printer
[mcu]
serial: /dev/serial/by-id/usb
[stepper_a]
endstop_pin: ^ar2   ; at the top
#position_endstop: 5
arm_length: 329.300000
[stepper_b]
arm_length = 329.4
[stepper_c]
angle: 90.125
[printer]
Kinematics: delta
delta_radius: 140.50
[gcode_macro X]
gcode:
    G1 X0
    delta_radius: 3

#*# <---------------------- SAVE_CONFIG ---------------------->
#*# DO NOT EDIT THIS BLOCK OR BELOW. The contents are auto-generated.
#*#
#*# [printer]
#*# delta_radius = 138.101933
#*#
#*# [stepper_a]
#*# angle = 209.670000
#*# position_endstop = 431.834563
#*#
#*# [stepper_b]
#*# position_endstop = 429.509
"""
PLAIN = """[printer]
kinematics: delta
delta_radius: 140.50
[stepper_a]
angle: 209.67
arm_length: 329.3
position_endstop: 431.834563
[stepper_b]
angle: 330
arm_length: 329.4
position_endstop: 429.509
[stepper_c]
angle: 90.125
arm_length: 329.3
position_endstop: 431.834563
"""
WINCH = """[printer]
kinematics: winch
[stepper_a]
rotation_distance: 40
anchor_x: 0
anchor_y: -2000.25
anchor_z: -100
[stepper_b]
anchor_x: 2000
anchor_y: 1000
anchor_z: -100
[stepper_c]
anchor_x: -2000
anchor_y: 1000
anchor_z: -100
[stepper_d]
anchor_x: 0
anchor_y: 0
anchor_z: 3000.125
"""
DELTA_G = """; config.g
M550 P"Kossel"
M665 L361.676:361.576:361.676 R180.679 H470.070 B150.0 X-0.105 Y0.161 Z0.000 ; from M500
M666 X-0.748 Y-0.006 Z0.755 A0.00 B0.00
"""
HANGPRINTER_G = """M669 K6 A0.00:-1604.54:-114.08 B1312.51:1270.88:-162.19 C-1440.27:741.63:-161.23 D0:0:2345.00 P2000
M666 Q0.0356 R65.24:65.14:65.30:64.67 U2:2:2:4 O1:1:1:1 L20:20:20:20 H255:255:255:255 J25:25:25:25
"""
GRID = "x=-60:60:3,y=-60:60:3,z=0:100:2"


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def new(text: str, name: str = "in.cfg") -> None:
    Path(name).write_text(text)
    done = run("new", "--from", name, "-o", "m.yaml", "--force")
    assert done.code == 0, done.err
    checked = run("check", "m.yaml")
    assert checked.code == 0 and "no faults" in checked.err, checked.err


def positions() -> Array:
    return np.array([[x, y, z] for x in (-60, 0, 60) for y in (-60, 0, 60) for z in (0, 100)], dtype=float)


def set_values(command: str = "simulate") -> Array:
    """Set values (N, A) of the machine, mm or deg."""
    done = run(command, "m.yaml", "--grid", GRID, "-o", "q.csv", "--force", "-q")
    assert done.code == 0, done.err
    names = list(yaml.safe_load(Path("m.yaml").read_text())["actuators"])
    return np.stack([np.asarray(table("q.csv").numbers[n]) for n in names], axis=1)


def test_a_delta_of_klipper() -> None:
    """A file counts before the block of SAVE_CONFIG, which fills what it leaves out; then defaults of Klipper."""
    new(CFG)
    Path("plain.cfg").write_text(PLAIN)
    assert set_values() == pytest.approx(klipper_delta(Path("plain.cfg"), positions()), abs=1e-9)


def test_a_winch_of_klipper() -> None:
    new(WINCH)
    assert set_values() == pytest.approx(klipper_winch(Path("in.cfg"), positions())[0], abs=1e-9)


def test_a_delta_of_reprapfirmware() -> None:
    new(DELTA_G, "config.g")
    assert set_values() == pytest.approx(reprap_delta(Path("config.g"), positions()), abs=1e-9)


def test_a_hangprinter() -> None:
    """With its build-up, which `correct` knows as an effect."""
    new(HANGPRINTER_G, "config.g")
    assert set_values("correct") == pytest.approx(360 * hangprinter(Path("config.g"), positions()), abs=1e-5)
    straight = HANGPRINTER_G.replace("Q0.0356", "Q0")
    new(straight, "straight.g")
    Path("almost.g").write_text(HANGPRINTER_G.replace("Q0.0356", "Q1e-7"))
    assert set_values() == pytest.approx(360 * hangprinter(Path("almost.g"), positions()), abs=1e-2)


def test_an_old_hangprinter_states_the_height_of_its_upper_anchor() -> None:
    new(HANGPRINTER_G.replace("D0:0:2345.00", "D2345.00"), "config.g")
    assert yaml.safe_load(Path("m.yaml").read_text())["parameters"]["Dz"]["nominal"] == 2345


@pytest.mark.parametrize(
    ("text", "digits"),
    [
        (CFG, ("140.50", "329.300000", "431.834563", "209.670000", "90.125")),
        (DELTA_G, ("361.676", "180.679", "470.070", "-0.105", "0.000", "-0.748")),
        (HANGPRINTER_G, ("-1604.54", "65.30", "2345.00", "20/255")),
    ],
)
def test_constants_keep_their_digits(text: str, digits: tuple[str, ...]) -> None:
    new(text)
    written = Path("m.yaml").read_text()
    assert [d for d in digits if d not in written] == []


def test_odd_digits_are_the_same_number() -> None:
    new(PLAIN.replace("140.50", "+1.405e2").replace("429.509", ".429509e3").replace("330", "0330."))
    parameters = yaml.safe_load(Path("m.yaml").read_text())["parameters"]
    assert [parameters[n]["nominal"] for n in ("delta_radius", "endstop_b", "angle_b")] == [140.5, 429.509, 330.0]


def test_what_is_exported_is_read_again() -> None:
    """new, correct --as, new: the constants with which the true machine was made."""
    for keyword, text, name, changed in (
        ("klipper", PLAIN, "in.cfg", {"delta_radius": 140.9, "angle_a": 209.9, "endstop_b": 429.1, "arm_c": 329.6}),
        ("reprapfirmware", DELTA_G, "config.g", {"radius": 181.1, "corner_x": 0.2, "stop_y": 0.3, "rod_z": 361.9}),
    ):
        new(text, name)
        Path("p.yaml").write_text(f"parameters: {{{', '.join(f'{n}: {v}' for n, v in changed.items())}}}\n")
        done = run("correct", "m.yaml", "--grid", GRID, "-p", "p.yaml", "--as", keyword, "-o", "out.txt", "--force")
        assert done.code == 0, done.err
        before = yaml.safe_load(Path("m.yaml").read_text())["parameters"]
        new(Path("out.txt").read_text(), f"again-{name}")
        after = yaml.safe_load(Path("m.yaml").read_text())["parameters"]
        value = lambda p, n: p[n]["nominal"]  # noqa: E731
        height = (value(before, "height") - value(after, "height")) if "height" in before else 0.0
        for parameter in set(before) - {"height"}:
            wanted = changed.get(parameter, value(before, parameter))
            wanted += height if parameter.startswith("stop_") else 0.0
            assert value(after, parameter) == pytest.approx(wanted, abs=2e-3), parameter


def test_files_that_a_file_includes() -> None:
    """Klipper reads them at their places, patterns in order; the last one counts. A circle is read once."""
    main, _, rest = PLAIN.partition("[stepper_a]")
    Path("cfg").mkdir()
    Path("cfg/1.cfg").write_text(f"[stepper_a]{rest}[include ../in.cfg]\n")
    Path("cfg/2.cfg").write_text("[stepper_b]\nposition_endstop: 400.25\n")
    new(f"{main}[include cfg/*.cfg]\n")
    parameters = yaml.safe_load(Path("m.yaml").read_text())["parameters"]
    assert [parameters[f"endstop_{t}"]["nominal"] for t in "abc"] == [431.834563, 400.25, 431.834563]
    done = run("new", "--from", "-", "-o", "-", stdin=f"{PLAIN}[include cfg/*.cfg]\n")
    assert done.code == 0 and "not read: [include cfg/*.cfg]" in done.err


def test_what_reprapfirmware_has_calibrated() -> None:
    """M501 reads config-override.g, where M500 puts the calibrated constants."""
    Path("config-override.g").write_text("; generated\nM665 R181.25\nM666 X0.5 A0.00\n")
    new(f"{DELTA_G}M501\n", "config.g")
    parameters = yaml.safe_load(Path("m.yaml").read_text())["parameters"]
    assert [parameters[n]["nominal"] for n in ("radius", "stop_x", "stop_y")] == [181.25, 0.5, -0.006]
    assert "config-override.g (sha256" in Path("m.yaml").read_text()
    assert run("new", "--from", "-", "-o", "-", "-q", stdin=DELTA_G).out.count("180.679") == 1


def test_remarks_and_several_commands_of_a_line() -> None:
    """As the firmware reads them: a G or M outside of quotes begins a command, brackets and quotes hold none."""
    text = (
        'M550 P"Delta (M665 R1)" ; M665 R2\nN10 m665 R181.5 (four rods) L361.7 G90 M566 X900 M666 X0.25 Y0.5 (Z9)\n'
        "M665 H470 X0.1 ; X7\nM208 S1 Z-0.2\nif global.m665 == 1\nset global.m666 = 3\n"
    )
    new(text, "config.g")
    parameters = yaml.safe_load(Path("m.yaml").read_text())["parameters"]
    names = ("radius", "rod_y", "height", "stop_x", "stop_y", "stop_z", "corner_x")
    assert [parameters[n]["nominal"] for n in names] == [181.5, 361.7, 470, 0.25, 0.5, 0, 0.1]


def test_macros_of_reprapfirmware_are_read_at_their_places() -> None:
    Path("sys").mkdir()
    Path("macros").mkdir()
    Path("sys/towers.g").write_text("M665 R181.5\n")
    Path("macros/stops").write_text("M666 X0.5\n")
    macros = 'M98 P"/sys/towers.g"\nM98 P"0:/macros/stops" ; by hand\nM98 P"fans.g"\n'
    Path("sys/config.g").write_text(f"{DELTA_G}{macros}M666 Y0.75\n")
    done = run("new", "--from", "sys/config.g", "-o", "m.yaml")
    parameters = yaml.safe_load(Path("m.yaml").read_text())["parameters"]
    assert [parameters[n]["nominal"] for n in ("radius", "stop_x", "stop_y")] == [181.5, 0.5, 0.75]
    assert done.code == 0 and 'not read: M98 P"fans.g"' in done.err


# --- what cannot be read -----------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("text", "told"),
    [
        (PLAIN.replace("delta\n", "corexy\n", 1), ["in.cfg:2:1", "`corexy` cannot be read", "`delta` and `winch`"]),
        (PLAIN.replace("arm_length: 329.3\nposition_endstop: 431.834563\n[stepper_b]", "[stepper_b]"),
         ["no `arm_length` in section [stepper_a] (also `position_endstop`)", "SAVE_CONFIG"]),
        (PLAIN.replace("140.50", "abc"), ["in.cfg:3:1", "`delta_radius` is no number: `abc`"]),
        (PLAIN.replace("140.50", "nan"), ["`delta_radius` is no number"]),
        (PLAIN.replace("140.50", "1e9"), ["`delta_radius` cannot be 1e9"]),
        (PLAIN.replace("140.50", "-140.5"), ["`delta_radius` cannot be -140.5"]),
        (PLAIN.replace("329.4", "120"), ["`arm_b` (120) is not longer than the radius (140.50)"]),
        ("[include a.cfg]\n[printer]\nmax_velocity: 3\n", ["no `kinematics`", "[include a.cfg]"]),
        (WINCH.replace("anchor_z: -100\n[stepper_b]", "[stepper_b]"), ["no `anchor_z` in section [stepper_a]"]),
        ("M669 K9 X0 P200\n", ["in.cfg:1:6", "M669 K9 cannot be read", "by hand (docs/my-machine.md)"]),
        (DELTA_G.replace("H470.070 ", ""), ["in.cfg:3:", "M665 has no H"]),
        (DELTA_G.replace("L361.676:361.576:361.676", "L361.676:361.576"), ["M665 L has 2 numbers, not 1 or 3"]),
        (DELTA_G.replace("A0.00", "A0.11"), ["in.cfg:4:", "a tilt of the bed"]),
        (DELTA_G.replace("R180.679", "R{global.r}"), ["`M665 R` is no number"]),
        (HANGPRINTER_G.replace("U2:2:2:4 ", "").replace("L20:20:20:20", "L20:20:20"),
         ["M666 has no U", "M666 L has 3"]),
        (HANGPRINTER_G.replace("H255", "H2.5"), ["`M666 H` is a whole number"]),
        ("hello\n", ["no configuration of a printer"]),
        ("", ["no configuration of a printer"]),
    ],
)  # fmt: skip
def test_what_cannot_be_read_is_told_with_its_line(text: str, told: list[str]) -> None:
    Path("in.cfg").write_text(text)
    done = run("new", "--from", "in.cfg", "-o", "m.yaml")
    assert done.code == 3 and [t for t in told if t not in done.err] == [], done.err
    assert not Path("m.yaml").exists()


def test_odd_files_end_in_words(tmp_path: Path) -> None:
    Path("b.cfg").write_bytes(b"\xff\xfe[printer]\x00kinematics: delta\n[\n]]\n[[x]]\n=:=\nM665 L\nM666 X:::\n")
    assert run("new", "--from", "b.cfg").code == 3
    Path("g.g").write_text("M665 L R H\nM666\nM669 K\n")
    assert run("new", "--from", "g.g").code == 3
    assert run("new", "--from", "missing.cfg").code == 3
    assert run("new").code == 2
    assert run("new", "--from", str(tmp_path)).code == 3


def test_a_file_is_not_replaced_unasked() -> None:
    Path("in.cfg").write_text(PLAIN)
    assert run("new", "--from", "in.cfg", "-o", "in.cfg", "--force").code == 4
    Path("m.yaml").write_text("mine")
    assert run("new", "--from", "in.cfg", "-o", "m.yaml").code == 4 and Path("m.yaml").read_text() == "mine"
    assert run("new", "--from", "-", "-o", "-", "-q", stdin=PLAIN).out.startswith("# yaml-language-server")


def test_constants_for_programs() -> None:
    Path("in.cfg").write_text(CFG)
    done = run("new", "--from", "in.cfg", "-o", "m.yaml", "--json", "-q")
    assert done.json["constants"]["delta_radius"] == {"value": "140.50", "file": "in.cfg", "line": 14}
    assert run("new", "--from", "in.cfg", "--json").code == 2


def test_the_shipped_configuration() -> None:
    done = run("new", "--from", str(MACHINES / "printer.cfg"), "-q")
    assert done.code == 0 and "395.693250" in done.out and "288.0" in done.out
