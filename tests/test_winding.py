"""Drives that change a length, with nothing of it left at reading 0: legs and ropes that begin at length 0.

The truth is the force balance of one point, solved here by itself: legs with stiffness EA / L, a weight, and a rope
whose tension is given.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import root

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.prediction import Request, Rows, predict
from pkmcal_cli.prediction.influence import idle_parameters
from tests.command import clean, run
from tests.measured import jacobian_check
from tests.support import at, model

EA_LEG, EA_ROPE, WEIGHT, FORCE = 2e5, 3e4, 5 * 9.81, 40.0
BASE = 0.5 * np.array([[np.cos(a), np.sin(a), 0.0] for a in np.deg2rad([0.0, 120.0, 240.0])])
TOP = np.array([0.0, 0.0, 2.0])

MACHINE = """
    units: {length: mm, angle: deg, force: N}
    space: spatial
    gravity: [0, 0, -9.81]
    ranges: {length: 1, force: 2000}
    parameters: {r: 500, top: 2000, EAleg: 200 kN, EArope: 30 kN}
    ground:
      "B{i}": {each: {i: [1, 2, 3], a: [0, 120, 240]}, at: ["r*cos({a}*pi/180)", "r*sin({a}*pi/180)", 0]}
      top: [0, 0, top]
    nodes: {tcp: {at: [0, 0, 800], mass: 5}}
    bars: {"leg{i}": {each: {i: [1, 2, 3]}, between: ["B{i}", tcp], EA: EAleg}}
    ropes: {rope: {between: [tcp, top], EA: EArope}}
    actuators:
      "q{i}": {each: {i: [1, 2, 3]}, drives: "leg{i}"}
      q4: {winds: rope, redundant: true, ROPE}
    sensors: {tracker: {at: tcp, reads: [x, y, z], sigma: 10 um, frame: machine}}
"""
FORCED = "control: force, force: 40, sigma: 1 mm"
READINGS = np.array([[0.95, 0.93, 0.94], [1.0, 0.9, 0.97]])


def machine(rope: str) -> str:
    return MACHINE.replace("ROPE", rope)


def pull(end: Array, other: Array, tension: float) -> Array:
    """Force on `end` of a member under tension that leads to `other`."""
    way = other - end
    return np.asarray(tension * way / np.sqrt(way @ way))


def distance(a: Array, b: Array) -> float:
    return float(np.sqrt(((a - b) ** 2).sum()))


def balanced(legs: Array, rope: float | None) -> Array:
    """Place of the point with natural lengths of legs, and of the rope (None: its tension is FORCE), m."""

    def residual(place: Array) -> Array:
        total = np.array([0.0, 0.0, -WEIGHT])
        for foot, natural in zip(BASE, legs, strict=True):
            total += pull(place, foot, EA_LEG * (distance(place, foot) / natural - 1))
        tension = FORCE if rope is None else EA_ROPE * (distance(place, TOP) / rope - 1)
        return total + pull(place, TOP, tension)

    found = root(residual, [0.0, 0.0, 0.8], method="hybr", options={"xtol": 1e-14})
    assert np.abs(residual(found.x)).max() < 1e-7
    return np.asarray(found.x)


@pytest.mark.parametrize(("zero", "at_zero"), [("", 0.0), ("zero: 0, ", 0.0), ("zero: 250, ", 0.25)])
def test_a_rope_that_a_force_winds_from_length_zero(zero: str, at_zero: float) -> None:
    """The point stands where forces balance; the reading is the rope's unstressed length beyond that at reading 0."""
    found = at(model(machine(zero + FORCED)), np.column_stack([READINGS, [0.0, 0.0]]))
    for row, legs in enumerate(READINGS):
        place = balanced(legs, None)
        assert np.abs(found.values[row, :3] - place).max() < 1e-10
        assert found.values[row, 3] == pytest.approx(distance(place, TOP) / (1 + FORCE / EA_ROPE) - at_zero, abs=1e-10)


def test_a_rope_that_a_position_winds_from_length_zero() -> None:
    given = np.column_stack([READINGS, [1.1, 1.05]])
    found = at(model(machine("")), given)
    for row, readings in enumerate(given):
        assert np.abs(found.values[row] - balanced(readings[:3], readings[3])).max() < 1e-10


def test_a_warm_rope_has_grown_by_its_length_as_drawn() -> None:
    """Not by the length that is left of it at reading 0; 10 K on 1.2 m."""
    warm = model(machine("") + "    effects: {thermal_strut@rope: {a: 500 um/(m*K)}}\n")
    given = np.column_stack([READINGS, [1.1, 1.05]])
    rows = Rows(given, np.full(given.shape, np.nan), {"T": np.full(len(given), 303.15)})
    found = predict(warm, warm.nominal, rows)
    for row, readings in enumerate(given):
        assert np.abs(found.values[row] - balanced(readings[:3], readings[3] + 6e-3)).max() < 1e-10


@pytest.mark.parametrize("rope", [FORCED, "zero: 0", "radius: 30, ratio: 1/5, unit: deg, " + FORCED])
def test_nothing_is_told_to_act_nowhere(rope: str) -> None:
    assert idle_parameters(model(machine(rope))) == ()


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize("rope", [FORCED, "zero: z, " + FORCED, "sigma: 1 mm"])
def test_derivatives(rope: str) -> None:
    last = np.array([0.0, 0.0]) if "force" in rope else np.array([1.1, 1.05])
    text = machine(rope).replace("EArope: 30 kN", "EArope: 30 kN, z: 0" if "z," in rope else "EArope: 30 kN")
    found = jacobian_check(text, np.column_stack([READINGS, last]), model(text).nominal)
    assert found.deviation < 1e-6, found.worst
    assert found.null == (("q4",) if "force" in rope else ())


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_a_row_that_leaves_no_length_is_out_of_reach_and_the_others_are_not() -> None:
    """A leg of length 0 or less: no stiffness EA / L, no number; the next row is computed all the same."""
    built = model(machine(FORCED))
    readings = np.array([[0.95, 0.93, 0.94, 0.0], [0.0, 0.93, 0.94, 0.0], [-0.3, 0.93, 0.94, 0.0]])
    found = predict(built, built.nominal, Rows.at(readings), Request())
    assert found.solved.tolist() == [True, False, False]
    assert np.isfinite(found.values[0]).all() and np.isnan(found.values[1:]).all()


def test_all_commands_on_such_a_machine(tmp_path: Path) -> None:
    file, table = tmp_path / "m.yaml", tmp_path / "t.csv"
    file.write_text(machine(FORCED))
    assert clean(run("check", file)).code == 0
    grid = ("--grid", "x=-150:150:3,y=-150:150:3,z=700:900:3")
    assert run("simulate", file, *grid, "--noise", "declared", "-o", table).code == 0
    assert clean(run("calibrate", file, table, "--select", "r,top", "--holdout", "none")).code == 0
    assert clean(run("observability", file, *grid)).code == 0
