"""Constants of firmware: the firmware's own formula, written anew, reads them and leaves the error that is told."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import fsolve

from tests.command import HANGPRINTER, MACHINES, Done, run, table
from tests.export_readers import Array, carriage, hangprinter, klipper_delta, klipper_winch, reprap_delta

DELTA = f"""
extends: {MACHINES}/delta-printer.yaml
actuators: {{q1: {{limits: [0, 650]}}, q2: {{limits: [0, 650]}}, q3: {{limits: [0, 650]}}}}
"""
TRUE = {"rod": 288.31, "radius": 136.2, "turn1": 0.21, "turn2": -0.13, "stop1": 0.1, "stop2": -0.2, "stop3": 0.15}
GRID = "x=-60:60:5,y=-60:60:5,z=0:100:3"
RULES = {"klipper": klipper_delta, "reprapfirmware": reprap_delta}


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("m.yaml").write_text(DELTA)
    write_parameters(TRUE)


def write_parameters(values: dict[str, float]) -> None:
    inner = ", ".join(f"{name}: {value}" for name, value in values.items())
    Path("p.yaml").write_text(f"parameters: {{{inner}}}\n")


def export(keyword: str, grid: str = GRID) -> Done:
    options = ("-p", "p.yaml", "--as", keyword, "-o", "out.txt", "--json", "--force")
    return run("correct", "m.yaml", "--grid", grid, *options)


def remaining(done: Done) -> dict[str, Any]:
    assert done.code == 0, done.err
    position: dict[str, Any] = done.json["export"]["remaining"]["position"]
    return position


def points(x: tuple[float, float, int], y: tuple[float, float, int], z: tuple[float, float, int]) -> Array:
    axes = [np.linspace(*each) for each in (x, y, z)]
    return np.stack([a.ravel() for a in np.meshgrid(*axes, indexing="ij")], axis=1)


def true_heights(positions: Array, lean: float = 0.0) -> Array:
    """Readings (N, 3) of the true printer: joints of the carriages above the bed, less their zeros; mm."""
    turns = np.radians([210 + TRUE["turn1"], 330 + TRUE["turn2"], 90])
    out = []
    for k, turn in enumerate(turns):
        out.append(
            carriage(positions, TRUE["radius"], turn, TRUE["rod"], 0.0, (lean, 0.0))
            + np.sqrt(TRUE["rod"] ** 2 - TRUE["radius"] ** 2)
            - TRUE[f"stop{k + 1}"]
        )
    return np.stack(out, axis=1)


def true_position(reading: Array, start: Array) -> Array:
    """Where the true printer is at readings (3,), mm."""
    return np.asarray(fsolve(lambda p: true_heights(p[None])[0] - reading, start, xtol=1e-13))


@pytest.mark.parametrize("keyword", RULES)
def test_the_firmware_brings_the_true_printer_there(keyword: str) -> None:
    """Switches at reading 650 stay where they are; the firmware counts from them. Before: 0.5 mm; after: digits."""
    told = remaining(export(keyword))
    wanted = points((-60, 60, 5), (-60, 60, 5), (0, 100, 3))
    sent = 650.0 + RULES[keyword](Path("out.txt"), wanted)
    there = np.array([true_position(q, p) for q, p in zip(sent, wanted, strict=True)])
    error = 1e3 * np.sqrt(((there - wanted) ** 2).sum(axis=1))
    assert told["before"]["rms"] > 400 and told["export"]["max"] < 0.2
    assert error.max() == pytest.approx(told["export"]["max"], abs=0.01)


def test_constants_of_klipper_are_the_planted_ones() -> None:
    export("klipper")
    text = Path("out.txt").read_text()
    for line in ("delta_radius: 136.200000", "arm_length: 288.310000", "angle: 210.210000", "angle: 329.870000"):
        assert line in text
    assert "position, rms" in text and "with corrected set values" in text and "www.klipper3d.org" in text


def test_what_firmware_cannot_hold_remains() -> None:
    """A tower farther out than the others: its angle and stop hold that in part."""
    Path("m.yaml").write_text(
        DELTA + "parameters: {far: {nominal: 136, range: 1}}\nbodies: {c1: {points: {C1: [far, 0, 0]}}}\n"
    )
    write_parameters({**TRUE, "far": 137.0})
    told = remaining(export("klipper"))
    wanted = points((-60, 60, 5), (-60, 60, 5), (0, 100, 3))
    sent = 650.0 + klipper_delta(Path("out.txt"), wanted)

    def heights(p: Array) -> Array:
        out = true_heights(p)
        turn = np.radians(210 + TRUE["turn1"])
        out[:, 0] = carriage(p, 137.0, turn, TRUE["rod"], 0.0, (0.0, 0.0)) - TRUE["stop1"]
        out[:, 0] += np.sqrt(TRUE["rod"] ** 2 - 137.0**2)
        return out

    there = np.array(
        [fsolve(lambda p, q=q: heights(p[None])[0] - q, w, xtol=1e-13) for q, w in zip(sent, wanted, strict=True)]
    )
    error = 1e3 * np.sqrt(((there - wanted) ** 2).sum(axis=1))
    assert 1 < told["export"]["rms"] < told["before"]["rms"] / 5
    assert np.sqrt((error**2).mean()) == pytest.approx(told["export"]["rms"], rel=1e-3)


def test_drives_that_count_down() -> None:
    """A guide that points down: the switch is at the lower limit."""
    Path("m.yaml").write_text(
        DELTA
        + "guides: {rail1: {along: -z}}\nbodies: {c1: {at: -253.866, points: {C1: [radius, 0, 0]}}}\n"
    )
    text = Path("m.yaml").read_text().replace("q1: {limits: [0, 650]}", "q1: {limits: [-650, 0]}")
    Path("m.yaml").write_text(text)
    write_parameters({**TRUE, "stop1": -0.1})
    told = remaining(export("klipper"))
    wanted = points((-60, 60, 5), (-60, 60, 5), (0, 100, 3))
    sent = 650.0 + klipper_delta(Path("out.txt"), wanted)
    assert sent == pytest.approx(true_heights(wanted), abs=1e-4) and told["export"]["max"] < 0.2


# --- lines -----------------------------------------------------------------------------------------------
WINCH = """
units: {length: mm, angle: deg, force: N}
space: spatial
gravity: [0, 0, -9.81]
ranges: {length: 20}
parameters: {ax: 0, ay: -2000, bx: 2000, by: 1000, cx: -2000, cy: 1000, dz: 3000}
ground: {A: [ax, ay, 2800], B: [bx, by, 2800], C: [cx, cy, dz]}
nodes: {tool: {at: [0, 0, 0], mass: 5}}
ropes: {"line{i}": {each: {i: [A, B, C]}, between: ["{i}", tool]}}
actuators: {"m{i}": {each: {i: [A, B, C]}, winds: "line{i}", zero: home}}
sensors: {camera: {at: tool, reads: [x, y, z], sigma: 1 mm, frame: machine}}
"""


def test_a_winch_of_klipper() -> None:
    """Rigid lines: the firmware's ways are those of the true anchors."""
    Path("m.yaml").write_text(WINCH)
    write_parameters({"ax": 11, "ay": -2007, "bx": 1995, "by": 1004, "cx": -2003, "cy": 990, "dz": 3010})
    told = remaining(export("klipper", "x=-300:300:3,y=-300:300:3,z=0:600:3"))
    wanted = points((-300, 300, 3), (-300, 300, 3), (0, 600, 3))
    anchors = np.array([[11, -2007, 2800], [1995, 1004, 2800], [-2003, 990, 3010.0]])
    true = np.linalg.norm(wanted[:, None] - anchors, axis=2) - np.linalg.norm(anchors, axis=1)
    assert told["before"]["rms"] > 1000 and told["export"]["max"] < 1
    assert klipper_winch(Path("out.txt"), wanted)[0] == pytest.approx(true, abs=2e-3)
    assert "x = y = z = 0" in Path("out.txt").read_text()


HANG = {"Ax": 12, "Ay": -1611, "Bz": -155, "R_low": 75.2, "R_high": 74.9}
HANG_GRID = "x=-300:300:3,y=-300:300:3,z=0:400:2"


def home() -> Array:
    """Readings (4,) of the motors with the nozzle at the origin, where the machine is homed; 0 of the last."""
    origin = "x=0:0:1,y=0:0:1,z=0:0:1"
    assert run("correct", "m.yaml", "--grid", origin, "-p", "p.yaml", "-o", "home.csv", "--force", "-q").code == 0
    found = table("home.csv").numbers
    return np.array([found[f"motor_{m}_deg"][0] for m in "abc"] + [0.0])


def simulated(turns: Array) -> Array:
    """Where `simulate` has the Hangprinter when its motors turn from home, mm."""
    names = ["motor_a_deg", "motor_b_deg", "motor_c_deg", "motor_d_deg"]
    np.savetxt("turns.csv", home() + 360 * turns, fmt="%.12g", delimiter=",", header=",".join(names), comments="")
    done = run("simulate", "m.yaml", "turns.csv", "-p", "p.yaml", "-o", "there.csv", "--force", "-q")
    assert done.code == 0, done.err
    found = table("there.csv").numbers
    return np.stack([np.asarray(found[f"{c}_mm"]) for c in "xyz"], axis=1)


@pytest.mark.parametrize("keyword", ["klipper", "reprapfirmware"])
def test_a_hangprinter(keyword: str) -> None:
    """Line on spools, with build-up, elastic lines, the upper one with constant force."""
    effects = ", ".join(f'"buildup@{d}": {{b: -47 um/m}}' for d in "ABCD")
    Path("m.yaml").write_text(f"extends: {HANGPRINTER}\neffects: {{{effects}}}\n")
    write_parameters(HANG)
    told = remaining(export(keyword, HANG_GRID))
    wanted = points((-300, 300, 3), (-300, 300, 3), (0, 400, 2))
    turns = klipper_winch(Path("out.txt"), wanted)[1] if keyword == "klipper" else hangprinter(Path("out.txt"), wanted)
    error = 1e3 * np.sqrt(((simulated(turns) - wanted) ** 2).sum(axis=1))
    assert told["before"]["rms"] > 3000 and told["export"]["rms"] < 300
    if keyword == "klipper":
        assert np.sqrt((error**2).mean()) == pytest.approx(told["export"]["rms"], rel=0.02)
    else:  # what is told holds the firmware's 32 bit; in double precision it is better
        assert np.sqrt((error**2).mean()) < told["export"]["rms"] + 10


def test_towers_that_lean_together_are_a_tilt_of_the_bed() -> None:
    """RepRapFirmware has constants for that; near the bed little remains, and so much as is told."""
    rails = "".join(
        f'  rail{k + 1}: {{along: ["lean*cos({w}*pi/180)", "-lean*sin({w}*pi/180)", 1]}}\n'
        for k, w in enumerate((210, 330, 90))
    )
    Path("m.yaml").write_text(f'{DELTA}parameters: {{lean: {{nominal: 0, range: 0.01, unit: "1"}}}}\nguides:\n{rails}')
    write_parameters({"lean": 0.003})
    flat = "x=-60:60:5,y=-60:60:5,z=0:4:2"
    told = {keyword: remaining(export(keyword, flat)) for keyword in ("klipper", "reprapfirmware")}
    assert told["reprapfirmware"]["export"]["rms"] < told["klipper"]["export"]["rms"] / 2
    wanted = points((-60, 60, 5), (-60, 60, 5), (0, 4, 2))
    sent = 650.0 + reprap_delta(Path("out.txt"), wanted)
    np.savetxt("q.csv", sent, fmt="%.12g", delimiter=",", header="q1,q2,q3", comments="")
    tracker = "sensors: {t: {at: nozzle, reads: [x, y, z], sigma: 1, frame: machine}}\n"
    Path("grid.yaml").write_text(f"extends: m.yaml\n{tracker}")
    assert run("simulate", "grid.yaml", "q.csv", "-p", "p.yaml", "-o", "there.csv", "-q").code == 0
    found = table("there.csv").numbers
    there = np.stack([np.asarray(found[f"t.{c}"]) for c in "xyz"], axis=1)
    error = 1e3 * np.sqrt(((there - wanted) ** 2).sum(axis=1))
    assert np.sqrt((error**2).mean()) == pytest.approx(told["reprapfirmware"]["export"]["rms"], rel=1e-3)


def test_how_sure_constants_are() -> None:
    """The radius is a parameter of the file and a constant of the firmware, with one standard uncertainty."""
    Path("m.yaml").write_text(DELTA + "parameters: {radius: {adjustable: true}, turn1: {adjustable: true}}\n")
    data = str(MACHINES / "delta-printer.csv")
    assert run("calibrate", "m.yaml", data, "-q", "--holdout", "none", "-o", "p.yaml", "--force").code == 0
    done = export("adjust")
    std = {entry["parameter"]: entry["std"] for entry in done.json["export"]["entries"]}
    export("klipper")
    lines = [line for line in Path("out.txt").read_text().splitlines() if "# u " in line]
    assert len(lines) == 10
    (radius,) = (line for line in lines if line.startswith("delta_radius"))
    angle = next(line for line in lines if line.startswith("angle"))
    assert radius.endswith(f"# u {std['radius']:.2g} mm") and angle.endswith(f"# u {std['turn1']:.2g} deg")
    export("reprapfirmware")
    assert f" R{std['radius']:.2g} X{std['turn1']:.2g} " in Path("out.txt").read_text()
