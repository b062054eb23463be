"""A probe that touches a ball at an unknown place, against a tripod of legs that is simulated here in closed form."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import fsolve

from pkmcal_cli.base.rotation import Array
from tests.command import run
from tests.test_limits_as_workspace import SLIDERS

NAMES = ("r", "o1", "o2", "o3", "bx", "by", "bz", "R")
NOMINAL = np.array([500, 600, 600, 600, 20, -10, 700, 15.7])
SPREAD = np.array([0.1, 0.1, 0.1, 0.1, 1.5, 1.5, 1.5, 0.025])  # half the ranges
TRIPOD = """
units: {length: mm, angle: deg, force: N}
space: spatial
ranges: {length: 0.2}
parameters:
  r: 500
  "o{i}": {each: {i: [1, 2, 3]}, nominal: 600}
  bx: {nominal: 20, range: 3}
  by: {nominal: -10, range: 3}
  bz: {nominal: 700, range: 3}
  R: {nominal: 15.7, range: 0.05, note: radii of ball and tip together}
ground:
  "B{i}": {each: {i: [1, 2, 3], a: [0, 120, 240]}, at: ["r*cos({a}*pi/180)", "r*sin({a}*pi/180)", 0]}
  ball: [bx, by, bz]
nodes: {tip: {at: [0, 0, 800]}}
bars:
  "leg{i}": {each: {i: [1, 2, 3]}, between: ["B{i}", tip]}
actuators:
  "q{i}": {each: {i: [1, 2, 3]}, drives: "leg{i}", offset: "o{i}", limits: [0, 600]}
sensors:
  probe: {kind: distance, at: tip, to: ball, zero: R, reading: 0, sigma: 3 um}
tool_point: tip
"""


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("tripod.yaml").write_text(TRIPOD)


def feet(r: float) -> Array:
    """Places (3, 3) of the feet of the legs, mm."""
    turn = np.radians([0, 120, 240])
    return r * np.stack([np.cos(turn), np.sin(turn), np.zeros(3)], axis=1)


def upwards(rng: np.random.Generator, count: int) -> Array:
    """Directions (n, 3) from the centre of the ball, none below its equator, where its stem is."""
    n = rng.normal(size=(count, 3))
    n[:, 2] = abs(n[:, 2])
    return np.asarray(n / np.linalg.norm(n, axis=1, keepdims=True))


def touches(values: Array, normals: Array, noise: Array) -> Array:
    """Readings (n, 3) of the drives where the tip touches, mm: noise (n,) of the trigger is along the normal."""
    tip = values[4:7] + (values[7] + noise)[:, None] * normals
    return np.asarray(np.linalg.norm(tip[:, None] - feet(values[0]), axis=2) - values[1:4])


def table(name: str, readings: Array) -> str:
    """A file of touches: commands alone."""
    rows = [",".join(f"{x:.7f}" for x in row) for row in readings]
    Path(name).write_text("\n".join(["q1 [mm],q2 [mm],q3 [mm]", *rows]) + "\n")
    return name


def tip_of(q: Array, values: Array = NOMINAL) -> Array:
    """Where a machine is (3,), mm."""
    legs, at = values[1:4] + q, feet(values[0])
    return np.asarray(fsolve(lambda p: np.linalg.norm(p - at, axis=1) - legs, [0, 0, 750], xtol=1e-13))


def deviation(q: Array, values: Array = NOMINAL) -> float:
    """Distance of the tip from where it touches, mm."""
    return float(np.linalg.norm(tip_of(q, values) - values[4:7]) - values[7])


def known() -> str:
    """A file of the machine with exact dimensions, and its name."""
    exact = ", ".join(f"{n}: {{fixed: true}}" for n in NAMES[:4])
    Path("known.yaml").write_text(f"extends: tripod.yaml\nparameters: {{{exact}}}\n")
    return "known.yaml"


def approached(plan: str, drives: tuple[int, ...] = (1, 2, 3)) -> tuple[Array, Array]:
    """Commands and beginnings of approaches (n, A) that a plan has, mm."""
    rows = list(csv.DictReader(io.StringIO("".join(x for x in plan.splitlines(True) if not x.startswith("#")))))
    columns = ([f"q{i} [mm]" for i in drives], [f"approach.q{i} [mm]" for i in drives])
    there, begin = (np.array([[float(row[c]) for c in names] for row in rows]) for names in columns)
    return there, begin


def test_intervals_of_centre_and_radius_hold_the_truth() -> None:
    """320 intervals of 95 %: a known machine, a ball anywhere within 3 mm."""
    machine, off = known(), []
    for seed in range(80):
        rng = np.random.default_rng(seed)
        true = np.concatenate([NOMINAL[:4], NOMINAL[4:] + SPREAD[4:] * rng.normal(size=4)])
        file = table("m.csv", touches(true, upwards(rng, 20), rng.normal(0, 0.003, 20)))
        done = run("calibrate", machine, file, "--holdout", "none", "--json", "-q")
        assert done.code == 0, done.err
        found = {p["name"]: p["interval"] for p in done.json["parameters"]}
        off += [not found[n][0] < v < found[n][1] for n, v in zip(NAMES[4:], true[4:], strict=True)]
    assert len(off) == 320 and np.mean(off) == pytest.approx(0.05, abs=0.03)


def test_uncertainties_are_those_of_the_own_jacobian() -> None:
    """Of a known machine: derivatives of the distance by differences of the own model, at the nominal touches."""
    readings = touches(NOMINAL, upwards(np.random.default_rng(2), 30), np.zeros(30))
    done = run("observability", known(), table("m.csv", readings), "--json")
    steps = 1e-3 * np.eye(8)[4:]
    deviations = [[deviation(q, NOMINAL + sign * e) for q in readings] for e in steps for sign in (-1, 1)]
    jacobian = np.diff(np.array(deviations).reshape(4, 2, 30), axis=1)[:, 0].T / 2e-3 / 0.003
    std = np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian + np.diag(1 / SPREAD[4:] ** 2))))
    shown = {p["name"]: p["std"] for p in done.json["parameters"]}
    assert shown == pytest.approx(dict(zip(NAMES[4:], std, strict=True)), rel=0.01)


def test_a_plan_approaches_the_ball_from_outside() -> None:
    """No approach begins within the ball, and each comes within 45 deg of the normal; sides follow from the move."""
    done = run("plan", "tripod.yaml", "--grid", "x=5:35:5,y=-25:5:5,z=702:720:3", "-q", "-o", "-")
    there, begin = approached(done.out)
    assert len(there) > 75
    for q, far in zip(there, begin, strict=True):
        tip, way = tip_of(q) - NOMINAL[4:7], tip_of(far) - tip_of(q)
        assert np.linalg.norm(tip) == pytest.approx(15.7, abs=1e-5)
        assert way @ tip / np.linalg.norm(way) / 15.7 > np.cos(np.radians(46))


def test_points_that_a_plan_adds_are_approached_from_outside() -> None:
    line = ("plan", "tripod.yaml", "--grid", "x=5:35:3,y=-25:5:3,z=705:720:2", "--aim", "bx", "--points", "6")
    there, begin = approached(run(*line, "-q", "-o", "-").out)
    assert len(there) >= 24
    for q, far in zip(there, begin, strict=True):
        assert deviation(far) > 0.3 and deviation(q) == pytest.approx(0, abs=1e-5)


def test_a_forgotten_radius_of_the_tip_is_named() -> None:
    """3 mm less than the radii of ball and tip: the constant of the probe, not the machine."""
    Path("forgot.yaml").write_text("extends: tripod.yaml\nparameters: {R: null}\nsensors: {probe: {zero: 12.7}}\n")
    rng = np.random.default_rng(5)
    true = np.concatenate([NOMINAL[:7] + SPREAD[:7] * rng.normal(size=7), [15.7]])
    file = table("m.csv", touches(true, upwards(rng, 60), rng.normal(0, 0.003, 60)))
    (found,) = run("diagnose", "forgot.yaml", file, "--json").json["effects"]
    assert (found["effect"], found["at"]) == ("meas_zero", "probe")
    assert found["parameters"][0]["value"] == pytest.approx(-3000, abs=15)


BED = """
extends: sliders.yaml
tool_point: tcp
frames: {bed: {at: [0, 300]}}
sensors: {tracker: null, probe: {kind: touch, at: tcp, surface: bed, reading: 0, sigma: 5 um}}
"""


def test_a_plan_approaches_a_plane_from_its_free_side() -> None:
    """Two carriages on a rail hold the tip with rods of 400 mm, drawn above it: it comes down to 300 mm."""
    Path("sliders.yaml").write_text(SLIDERS)
    Path("bed.yaml").write_text(BED)
    done = run("plan", "bed.yaml", "--grid", "x=400:600:9,y=320:320:1", "-q", "-o", "-")
    for q1, q2 in zip(*approached(done.out, (1, 2)), strict=True):
        (x1, y1), (x2, y2) = (((a + b) / 2, 50 + np.sqrt(400**2 - (b - a) ** 2 / 4)) for a, b in (q1, q2))
        assert y1 == pytest.approx(300, abs=1e-5) and y2 - y1 > abs(x2 - x1) * 0.98
