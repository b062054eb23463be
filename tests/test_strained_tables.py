"""Redundant drives that read with errors, to the last digit: each command ends with 0, 1 or a fault that says what."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from tests.command import MACHINES, Done, run
from tests.in_ci import in_ci

pytestmark = pytest.mark.usefixtures("unsized")

FOUR_LEGS = """
units: {length: mm, angle: deg, force: N}
space: planar
ranges: {length: 0.5}
parameters:
  "o{i}": {each: {i: [1, 2, 3, 4]}, nominal: 100}
  "bx{i}": {each: {i: [1, 2, 3, 4], x: [-500, 500, 500, -500]}, nominal: "{x}"}
  "by{i}": {each: {i: [1, 2, 3, 4], y: [-400, -400, 400, 400]}, nominal: "{y}"}
ground: {"B{i}": {each: {i: [1, 2, 3, 4]}, at: ["bx{i}", "by{i}"]}}
bodies:
  plate: {at: [0, 0], points: {P1: [-100, -60], P2: [100, -60], P3: [100, 60], P4: [-100, 60], tool: [0, 0]}}
bars: {"leg{i}": {each: {i: [1, 2, 3, 4]}, between: ["B{i}", "P{i}"], EA: 20 MN}}
actuators:
  "q{i}": {each: {i: [1, 2, 3]}, drives: "leg{i}", offset: "o{i}", sigma: 10 um}
  q4: {drives: leg4, offset: o4, redundant: true, sigma: 10 um}
sensors: {tracker: {at: tool, reads: [x, y, rz], sigma: {position: 10 um, orientation: 10 urad}, frame: machine}}
"""
FOUR_BELTS = """
units: {length: mm, angle: deg, force: N}
space: planar
gravity: [0, -9.81]
ranges: {length: 20}
parameters:
  "A{i}x": {each: {i: [1, 2, 3, 4], x: [0, 3000, 0, 3000]}, nominal: "{x}"}
  "A{i}y": {each: {i: [1, 2, 3, 4], y: [2200, 2200, 0, 0]}, nominal: "{y}"}
ground: {"A{i}": {each: {i: [1, 2, 3, 4]}, at: ["A{i}x", "A{i}y"]}}
nodes: {tcp: {at: [1500, 1000], mass: 8 kg}}
ropes: {"belt{i}": {each: {i: [1, 2, 3, 4]}, between: ["A{i}", tcp], EA: 100 kN}}
actuators:
  "b{i}": {each: {i: [1, 2]}, winds: "belt{i}", sigma: 0.3 mm}
  "b{j}": {each: {j: [3, 4]}, winds: "belt{j}", redundant: true, sigma: 0.3 mm}
sensors: {tracker: {at: tcp, reads: [x, y], sigma: 0.2 mm, frame: machine}}
"""
CORNERS = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])


def legs(rng: np.random.Generator, rows: int, turned: float) -> Array:
    """Table (N, 7) in mm and deg: strain-free lengths of the legs at random poses, `turned` by up to so many degrees,
    bases 0.25 mm off, and noise."""
    base = CORNERS * [500, 400] + rng.normal(0, 0.25, (4, 2))
    offset = 100 + rng.normal(0, 0.25, 4)
    pose = rng.uniform([-200, -200, -turned], [200, 200, turned], (rows, 3))
    turn = np.radians(pose[:, 2])
    axes = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])  # (2, 2, N)
    joints = np.einsum("ijn,kj->nki", axes, CORNERS * [100, 60]) + pose[:, None, :2]
    length = np.linalg.norm(joints - base, axis=2) - offset + rng.normal(0, 0.01, (rows, 4))
    return np.hstack([length, pose + rng.normal(0, 1, (rows, 3)) * [0.01, 0.01, np.degrees(1e-5)]])


def belts(rng: np.random.Generator, rows: int) -> Array:
    """Table (N, 6) in mm: lengths of stiff belts at random positions, anchors 10 mm off, and noise."""
    anchors = np.array([[0, 2200], [3000, 2200], [0, 0], [3000, 0]]) + rng.normal(0, 10, (4, 2))
    place = rng.uniform([400, 400], [2600, 1800], (rows, 2))
    length = np.linalg.norm(place[:, None] - anchors, axis=2) + rng.normal(0, 0.3, (rows, 4))
    return np.hstack([length, place + rng.normal(0, 0.2, (rows, 2))])


def ended(command: str, machine: str, table: str) -> Done:
    done = run(command, machine, table, "--json")
    words = done.err.lower()
    assert done.code in (0, 1) or (done.code == 3 and "error[" in words), done.err
    assert not any(w in words for w in ("svd", "lapack", "linalg", "converge;", "singular matrix")), done.err
    assert "NaN" not in done.out
    return done


def platform(folder: Path, seed: int, turned: float) -> tuple[str, str]:
    """Files of the machine on four legs and of a table."""
    machine, table = folder / "legs.yaml", folder / "legs.csv"
    machine.write_text(FOUR_LEGS)
    rows = legs(np.random.default_rng(seed), 25, turned)
    header = "q1 [mm],q2 [mm],q3 [mm],q4 [mm],x [mm],y [mm],rz [deg]"
    np.savetxt(table, rows, delimiter=",", header=header, comments="", fmt="%.17g")
    return str(machine), str(table)


@pytest.mark.parametrize(
    ("seed", "command"),
    in_ci(["2-observability"], product([2, 3], ["calibrate", "diagnose", "observability"])),
)
def test_platforms_on_four_legs(command: str, seed: int, tmp_path: Path) -> None:
    done = ended(command, *platform(tmp_path, seed, 8.0))
    assert command != "calibrate" or done.json["chi2_per_dof"] < 2
    assert command != "diagnose" or done.json["verdict"] == "clean"


@pytest.mark.slow
@pytest.mark.parametrize("command", ["calibrate", "diagnose", "observability", "plan"])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_platforms_turned_far(command: str, seed: int, tmp_path: Path) -> None:
    """Some rows close in another way, or not at all: nothing is explained, and it is said so."""
    ended(command, *platform(tmp_path, seed, 25.0))


@pytest.mark.parametrize(
    ("seed", "command"),
    in_ci(["2-observability", "4-observability"], product([1, 2, 4], ["diagnose", "observability"])),
)
def test_points_on_four_belts(command: str, seed: int, tmp_path: Path) -> None:
    """The weight stretches the belts, which the table does not know; 4 has most rows slack at the drawing."""
    machine, table = str(tmp_path / "belts.yaml"), str(tmp_path / "belts.csv")
    Path(machine).write_text(FOUR_BELTS)
    header = "b1 [mm],b2 [mm],b3 [mm],b4 [mm],x [mm],y [mm]"
    np.savetxt(table, belts(np.random.default_rng(seed), 20), delimiter=",", header=header, comments="", fmt="%.17g")
    ended(command, machine, table)


@pytest.mark.slow
def test_the_hangprinter_as_it_was_read() -> None:
    """With all digits of its encoders; three rows were never seen by the camera."""
    done = ended("diagnose", str(MACHINES / "hangprinter.yaml"), str(MACHINES / "hangprinter_2022-04-12.csv"))
    assert done.code == 1 and done.json["verdict"] in ("found", "ambiguous", "unknown")
