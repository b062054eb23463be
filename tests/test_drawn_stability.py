"""`check` of machines that balance as drawn, but do not stay there: on both sides of critical values in closed form."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.command import MACHINES, clean, run
from tests.test_tensioned_platform import DRUM, TEXT, natural_lengths

_HEAD = "units: {length: mm, angle: deg, force: N}\nspace: planar\nranges: {length: 1, force: 10}\n"
ARM, LOAD = 0.5, 50.0  # m, N
PENDULUM = (
    _HEAD
    + f"""parameters: {{z: 0}}
guides: {{rail: {{along: x}}}}
bodies:
  cart: {{guide: rail, at: 0, points: {{P: [0, 0]}}}}
  arm: {{at: [0, 0], points: {{tip: [0, {1e3 * ARM}]}}}}
joints: {{hinge: {{between: [P, arm], type: fixed, stiffness: {{rz: STIFFNESS Nm/rad}}}}}}
loads: {{weight: {{at: tip, force: [0, -{LOAD}]}}}}
actuators: {{q1: {{moves: cart, zero: z}}}}
sensors: {{t: {{at: tip, reads: [x, y], sigma: 0.01, frame: machine}}}}
"""
)
MAST = f"""units: {{length: mm, angle: deg, force: N}}
space: spatial
ranges: {{length: 1}}
parameters: {{z: 0}}
guides: {{rail: {{along: x}}}}
bodies:
  cart: {{guide: rail, at: 0, points: {{P: [0, 0, 0]}}}}
  mast: {{at: [0, 0, 0], points: {{tip: [0, 0, {1e3 * ARM}]}}}}
joints: {{foot: {{between: [P, mast], type: fixed, stiffness: {{rx: 90 Nm/rad, ry: STIFFNESS Nm/rad, rz: 9 Nm/rad}}}}}}
loads: {{weight: {{at: tip, force: [0, 0, -{LOAD}]}}}}
actuators: {{q1: {{moves: cart, zero: z}}}}
sensors: {{t: {{at: tip, reads: [x, y, z], sigma: 0.01, frame: machine}}}}
"""
HALF, PUSH, EA = 0.5, 250.0, 1e6  # m, N, N
TOGGLE = (
    _HEAD
    + f"""parameters: {{z: 0}}
guides: {{rail: {{along: x}}}}
bodies: {{slide: {{guide: rail, at: {2e3 * HALF}, points: {{B: [0, 0]}}}}}}
ground: {{A: [0, 0], S: [{1e3 * HALF}, -400]}}
nodes: {{M: [{1e3 * HALF}, 0]}}
bars:
  left: {{between: [A, M], EA: {EA}}}
  right: {{between: [M, B], EA: {EA}}}
  spring: {{between: [S, M], k: STIFFNESS N/m}}
actuators: {{push: {{moves: slide, control: force, force: -{PUSH}, sigma: 0.1, zero: z}}}}
sensors: {{t: {{at: M, reads: [x, y], sigma: 0.01, frame: machine}}}}
"""
)
STRUT, ROPE, FORCE = 0.4, 0.5, 100.0  # m, m, N
PROPPED = (
    _HEAD
    + f"""parameters: {{x1: 0}}
ground: {{A: [x1, 0], C: [0, {1e3 * (ROPE - STRUT)}], S: [-800, {1e3 * ROPE}]}}
nodes: {{P: [0, {1e3 * ROPE}]}}
ropes: {{r: {{between: [A, P], EA: 1 MN}}}}
bars: {{strut: {{between: [C, P], EA: 1 MN}}, spring: {{between: [S, P], k: STIFFNESS N/m}}}}
actuators:
  q1: {{winds: r, zero: home}}
  push: {{drives: strut, redundant: true, control: force, force: {FORCE}, sigma: 0.1}}
sensors: {{t: {{at: P, reads: [x, y], sigma: 0.01, frame: machine}}}}
"""
)
CRITICAL = {
    "an inverted pendulum on a spring": (PENDULUM, LOAD * ARM, "the rotation of arm", "arm"),
    "a mast in space": (MAST, LOAD * ARM, "the rotation of mast", "mast"),
    "a toggle under pressure": (TOGGLE, 2 * PUSH / HALF, "the travel of M.y", "M"),
    "a rope that a strut pushes tight": (PROPPED, FORCE * (1 / STRUT - 1 / ROPE), "the travel of P.x", "P"),
}
"""Machine, stiffness (Nm/rad or N/m) below which it falls, its motion, and the part that moves."""


@pytest.mark.parametrize("name", CRITICAL)
def test_what_is_drawn_falls_below_the_critical_stiffness(name: str, tmp_path: Path) -> None:
    text, critical, motion, part = CRITICAL[name]
    file = tmp_path / "m.yaml"
    for share, falls in ((0.5, True), (0.98, True), (1.02, False), (2.0, False)):
        file.write_text(text.replace("STIFFNESS", repr(share * critical)))
        done = clean(run("check", file, "--json"))
        faults = [f for f in done.json["faults"] if f["code"] == "unstable"]
        assert done.code == int(falls) and len(faults) == int(falls), (share, done.err)
        assert not falls or (motion in faults[0]["message"] and "stiffen" in faults[0]["help"])
        assert not falls or part in file.read_text().splitlines()[faults[0]["line"] - 1]
        drawn = run("draw", file, "-q", "--json")
        assert (drawn.code == 0) is not falls, "what check refuses no command can solve"


def test_a_table_of_such_a_machine_is_checked_too(tmp_path: Path) -> None:
    file, table = tmp_path / "m.yaml", tmp_path / "t.csv"
    file.write_text(PENDULUM.replace("STIFFNESS", "20"))
    table.write_text("q1,x,y\n1,1,500\n2,2,500\n3,oops,500\n")
    done = clean(run("check", file, table))
    assert done.code == 1 and "error[unstable]" in done.err and "error[csv-number]" in done.err


def test_shipped_machines_stay_as_they_are_drawn() -> None:
    for file in (f for f in MACHINES.glob("*.yaml") if "." not in f.stem):
        assert "unstable" not in run("check", file).err, file


def test_ropes_that_drives_can_tension_are_a_warning(tmp_path: Path) -> None:
    """The platform's weight lies above the upper ropes' ends: without tension, as drawn, it would turn over; with the
    lengths that statics gives for 200 N it stays."""
    (tmp_path / "m.yaml").write_text(TEXT)
    done = clean(run("check", tmp_path / "m.yaml", "--json"))
    (warning,) = (w for w in done.json["warnings"] if w["code"] == "unstable")
    assert done.code == 0 and "in the rotation of platform" in warning["message"] and "tension" in warning["help"]
    assert run("draw", tmp_path / "m.yaml", "-q", "--json").code == 3
    lengths = natural_lengths(np.array([0, 0, 1.2, 0, 0, 0]), 200.0)
    assert lengths is not None
    row = ",".join(repr(float(q)) for q in lengths / DRUM)
    (tmp_path / "t.csv").write_text(",".join(f"q{k}" for k in range(8)) + f"\n{row}\n")
    assert run("draw", tmp_path / "m.yaml", tmp_path / "t.csv", "-q", "--json").code == 0
