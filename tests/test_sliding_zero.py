"""Zeros and offsets of drives of sliding joints: a tripod of telescopic legs (3-RPS), by distances of its joints."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.command import column, run

HEAD = """
units: {length: mm, angle: deg, force: N}
space: spatial
ranges: {length: 0.1, scale: 1e-3}
parameters:
  R: 300
  r: 150
  "o{i}": {each: {i: [1, 2, 3]}, nominal: 400}
  s: 1
ground: {"B{i}": {each: {i: [1, 2, 3], a: [0, 120, 240]}, at: ["R*cos({a}*pi/180)", "R*sin({a}*pi/180)", 0]}}
bodies:
  "tube{i}":
    each: {i: [1, 2, 3], a: [0, 120, 240]}
    at: ["R*cos({a}*pi/180)", "R*sin({a}*pi/180)", 0]
    turn: [0, 0, "{a}"]
    points: {"T{i}": [0, 0, 0]}
  "rod{i}":
    each: {i: [1, 2, 3], a: [0, 120, 240]}
    at: ["R*cos({a}*pi/180)", "R*sin({a}*pi/180)", 500]
    turn: [0, 0, "{a}"]
  platform: {at: [0, 0, 500], points: {P1: [r, 0, 0], P2: [-r/2, r*sqrt(3)/2, 0], P3: [-r/2, -r*sqrt(3)/2, 0]}}
joints:
  "hinge{i}":
    each: {i: [1, 2, 3], a: [0, 120, 240]}
    between: ["B{i}", "tube{i}"]
    type: revolute
    axis: ["-sin({a}*pi/180)", "cos({a}*pi/180)", 0]
  "slide{i}": {each: {i: [1, 2, 3]}, between: ["T{i}", "rod{i}"], type: prismatic, axis: z}
  "ball{i}": {each: {i: [1, 2, 3]}, between: ["rod{i}", "P{i}"], type: spherical}
actuators: {"q{i}": {each: {i: [1, 2, 3]}, drives: "slide{i}", ZERO}}
sensors:
  tracker: {at: platform, reads: [x, y, z, rx, ry, rz], sigma: {position: 10 um, orientation: 20 urad}, frame: machine}
"""
VALUES = {"R": 300.3, "r": 149.8, "o1": 401.0, "o2": 398.5, "o3": 403.2, "s": 1.002}


def lengths(file: str, p: dict[str, float]) -> np.ndarray:
    """Distances (N, 3) of the joints of each leg at the poses of a table, mm."""
    at = np.stack([column(file, c) for c in ("x", "y", "z")], axis=1)
    turn = Rotation.from_rotvec(np.radians(np.stack([column(file, c) for c in ("rx", "ry", "rz")], axis=1)))
    round_ = [np.array([np.cos(a), np.sin(a), 0.0]) for a in np.radians([0, 120, 240])]
    ends = [at + turn.apply(p["r"] * u) - p["R"] * u for u in round_]
    return np.stack([np.linalg.norm(end, axis=1) for end in ends], axis=1)


@pytest.mark.parametrize(
    ("zero", "extra"),
    [
        ('zero: "o{i}", scale: s', 0.0),
        ('zero: "o{i}", scale: s, offset: 25', 25.0),
        ('zero: "o{i}", scale: s, stiffness: 50 kN/mm', 0.0),
    ],
)
def test_a_leg_is_as_long_as_its_zero_and_reading_say(
    zero: str, extra: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("m.yaml").write_text(HEAD.replace("ZERO", zero))
    Path("p.yaml").write_text(f"parameters: {VALUES}\n")
    q = np.array([[100, 110, 105], [60, 150, 90], [140, 120, 160], [80, 80, 80]]) - extra
    Path("q.csv").write_text("\n".join(["q1,q2,q3", *(",".join(map(str, row)) for row in q), ""]))
    done = run("simulate", "m.yaml", "q.csv", "-p", "p.yaml", "-o", "out.csv", "-q")
    assert done.code == 0, done.err
    wanted = np.array([VALUES["o1"], VALUES["o2"], VALUES["o3"]]) + extra + VALUES["s"] * q
    assert lengths("out.csv", VALUES) == pytest.approx(wanted, abs=1e-6)
    done = run("check", "m.yaml", "--json", "-q")
    assert done.code == 0 and done.json["faults"] == []  # no zero is idle


@pytest.mark.parametrize(("zero", "readings"), [("zero: home", 0.0), ("zero: home, offset: 10", -10.0)])
def test_a_leg_that_is_homed_as_drawn(
    zero: str, readings: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    text = HEAD.replace("ZERO", zero).replace('  "o{i}": {each: {i: [1, 2, 3]}, nominal: 400}\n  s: 1\n', "")
    Path("m.yaml").write_text(text)
    done = run("check", "m.yaml")
    assert done.code == 0, done.err
    for name in ("q1", "q2", "q3"):
        row = next(line for line in done.err.splitlines() if line.startswith(f"{name} "))
        assert float(row.split()[1]) == pytest.approx(readings, abs=1e-6)
