"""Springs that hold nothing in place: of a driven hinge, between points, and what no drive holds, which hangs on them.

The truth is the balance of moments of one arm about its hinge, solved for its angle.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

from tests.command import clean, run

MASS, WEIGHT = 2.0, 2.0 * 9.81
ARM, LEVER, CENTRE, HIGH = 0.25, 0.12, 0.1, 0.3  # m
DRIVE, TORSION, DRAWN = 1000.0, 40.0, np.radians(10)  # N m/rad, rad
READINGS = (0.0, 10.0, 30.0)  # deg
MACHINE = f"""units: {{length: mm, angle: deg, force: N}}
space: planar
gravity: [0, -9.81]
ranges: {{length: 0.2 mm}}
ground: {{O: [0, 0], S: [0, {1e3 * HIGH}]}}
parameters: {{r: {1e3 * ARM}, k: {{nominal: 1.2, unit: N/mm, range: 0.1}}}}
bodies: {{arm: {{at: [0, 0], turn: 10, mass: {MASS}, centre: [{1e3 * CENTRE}, 0], points: {{B: [r, 0], P: [120, 0]}}}}}}
joints: {{j: {{between: [O, arm], type: revolute HINGE}}}}
bars: {{sp: {{between: [S, P], LENGTH k: kSPRING}}}}
actuators: {{q: {{turns: arm, stiffness: {DRIVE} Nm/rad}}}}
sensors: {{cam: {{at: B, reads: [x, y], sigma: 5 um, frame: machine}}}}
"""


def described(hinge: str = "", length: str = "length: 120,", spring: str = ", spring: true") -> str:
    """The arm."""
    return MACHINE.replace("HINGE", hinge).replace("LENGTH", length).replace("SPRING", spring)


def balanced(reading: float, torsion: float, stiffness: float, length: float, rest: float = DRAWN) -> float:
    """Angle (rad) of the arm at a reading (deg), with a torsion spring and one between points of a length (m); rest: of
    the torsion spring.
    """
    commanded = np.radians(reading)

    def moment(angle: float) -> float:
        along = np.array([np.cos(angle), np.sin(angle)])
        chord = LEVER * along - [0.0, HIGH]
        long = float(np.hypot(*chord))
        pull = stiffness * (long - length) * chord / long @ (LEVER * np.array([-along[1], along[0]]))
        weight = WEIGHT * CENTRE * along[0]
        return float(DRIVE * (angle - commanded) + torsion * (angle - rest) + pull + weight)

    return float(brentq(moment, commanded - 0.3, commanded + 0.3, xtol=1e-14))


CASES = {
    "stretched by half its length": (described(), 0.0, 1200.0, 0.12),
    "with a torsion spring": (described(f", stiffness: {{rz: {TORSION} Nm/rad}}"), TORSION, 1200.0, 0.12),
    "pushing": (described(length="length: 400,"), 0.0, 1200.0, 0.4),
    "torsion alone": (
        described(f", stiffness: {{rz: {TORSION} Nm/rad}}").replace("{nominal: 1.2,", "{nominal: 1e-9,"),
        TORSION, 1e-6, 0.12,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_a_driven_arm_balances_with_its_springs(name: str, tmp_path: Path) -> None:
    text, torsion, stiffness, length = CASES[name]
    file, table = tmp_path / "m.yaml", tmp_path / "t.csv"
    file.write_text(text)
    table.write_text("q [deg]\n" + "\n".join(map(str, READINGS)) + "\n")
    seen = clean(run("check", file, "--json")).json
    assert (seen["degrees_of_freedom"], seen["degree_of_redundancy"], seen["n_faults"]) == (1, 0, 0)
    lines = clean(run("simulate", file, table, "-q")).out.splitlines()
    rows = np.array([[float(cell) for cell in line.split(",")] for line in lines[-len(READINGS) :]])
    for row, reading in zip(rows, READINGS, strict=True):
        angle = balanced(reading, torsion, stiffness, length)
        assert row[2:4] == pytest.approx([1e3 * ARM * np.cos(angle), 1e3 * ARM * np.sin(angle)], abs=1e-8)


def test_a_torsion_spring_that_is_wound_as_drawn_is_a_moment_too(tmp_path: Path) -> None:
    """At rest 15 deg above the drawing: it turns the arm there by stiffness times this angle, whatever both are."""
    file, table = tmp_path / "m.yaml", tmp_path / "t.csv"
    own = "parameters: {kt: {nominal: 40 Nm/rad, range: 4 Nm/rad}, rest: {nominal: 15 deg, range: 1 deg}, "
    text = described(", stiffness: {rz: kt}").replace("parameters: {", own)
    file.write_text(text + "loads: {wound: {at: arm, moment: kt*rest}}\n")
    table.write_text("q [deg]\n" + "\n".join(map(str, READINGS)) + "\n")
    lines = clean(run("simulate", file, table, "-q")).out.splitlines()[-len(READINGS) :]
    for line, reading in zip(lines, READINGS, strict=True):
        angle = balanced(reading, TORSION, 1200.0, 0.12, DRAWN + np.radians(15))
        at = [float(cell) for cell in line.split(",")[2:4]]
        assert at == pytest.approx([1e3 * ARM * np.cos(angle), 1e3 * ARM * np.sin(angle)], abs=1e-8)


def test_the_stiffness_of_a_balancing_spring_is_identified(tmp_path: Path) -> None:
    file, table = tmp_path / "m.yaml", tmp_path / "t.csv"
    file.write_text(described())
    lines = ["q [deg],x [mm],y [mm]"]
    for reading in np.linspace(-60, 60, 25):
        angle = balanced(float(reading), 0.0, 1257.0, 0.12)
        x, y = 250.13 * np.cos(angle), 250.13 * np.sin(angle)
        lines.append(f"{reading:.12g},{x:.12g},{y:.12g}")
    table.write_text("\n".join(lines) + "\n")
    found = clean(run("calibrate", file, table, "--holdout", "none", "--json")).json
    values = {p["name"]: p["value"] for p in found["parameters"]}
    assert values == pytest.approx({"r": 250.13, "k": 1.257}, rel=1e-7)


def test_what_holds_an_arm_that_a_redundant_drive_turns(tmp_path: Path) -> None:
    file, table = tmp_path / "m.yaml", tmp_path / "t.csv"
    text = described(length="length: 290,", spring="").replace("{turns: arm,", "{turns: arm, redundant: true,")
    file.write_text(text)
    table.write_text("q [deg]\n10\n")
    assert clean(run("check", file, "--json")).json["degrees_of_freedom"] == 0
    row = clean(run("simulate", file, table, "-q")).out.splitlines()[-1].split(",")
    angle = balanced(10.0, 0.0, 1200.0, 0.29)
    assert [float(c) for c in row[2:4]] == pytest.approx([250 * np.cos(angle), 250 * np.sin(angle)], abs=1e-8)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (described(length=""), "a spring needs `length`"),
        (described().replace("k: k,", "").replace("{r: 250.0, k: {nominal: 1.2, unit: N/mm, range: 0.1}}", "{r: 250}"),
         "a spring needs `k`"),
        (described().replace("{turns: arm, ", "{drives: sp, "), "`q` drives a spring"),
        (described(spring=""), "if it is a spring, mark it `spring: true`"),
    ],
)  # fmt: skip
def test_a_spring_states_what_it_is(text: str, said: str, tmp_path: Path) -> None:
    file = tmp_path / "m.yaml"
    file.write_text(text)
    done = clean(run("check", file))
    assert done.code == 1 and said in done.err
