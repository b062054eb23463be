"""A base of which an instrument that stands anywhere sees neither place nor height: what is held, and what is known."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.command import run
from tests.support import compiled

# a head of three vertical drives; their rails stand in frames, their places and zeros are parameters
HEAD = """units: {length: mm, angle: deg, force: N}
space: spatial
ranges: {length: 0.1 mm}
parameters:
  "br{i}": {each: {i: [1, 2, 3]}, nominal: 250}
  "bt{i}": {each: {i: [1, 2, 3]}, nominal: 0}
  "pr{i}": {each: {i: [1, 2, 3]}, nominal: 150}
  "L{i}": {each: {i: [1, 2, 3]}, nominal: 400, range: 0.2}
  "z{i}": {each: {i: [1, 2, 3]}, nominal: 0, range: 0.5}
frames: {"column{i}": {each: {i: [1, 2, 3], a: [0, 120, 240]}, turn: [0, 0, "{a}"]}}
guides: {"rail{i}": {each: {i: [1, 2, 3]}, frame: "column{i}", at: ["br{i}", "bt{i}", 0], along: z}}
bodies:
  "carriage{i}": {each: {i: [1, 2, 3]}, guide: "rail{i}", at: 150}
  "leg{i}":
    each: {i: [1, 2, 3], a: [0, 120, 240]}
    at: ["250*cos({a}*pi/180)", "250*sin({a}*pi/180)", 150]
    turn: [0, 0, "{a}"]
    points: {"E{i}": [0, 0, "-L{i}"]}
  platform:
    at: [0, 0, -237]
    points:
      "P{i}": {each: {i: [1, 2, 3], a: [0, 120, 240]}, at: ["pr{i}*cos({a}*pi/180)", "pr{i}*sin({a}*pi/180)", 0]}
      tip: [0, 0, -120]
joints:
  "hinge{i}":
    each: {i: [1, 2, 3], a: [0, 120, 240]}
    between: ["carriage{i}", "leg{i}"]
    type: revolute
    axis: ["-sin({a}*pi/180)", "cos({a}*pi/180)", 0]
  "ball{i}": {each: {i: [1, 2, 3]}, between: ["E{i}", "P{i}"], type: spherical}
actuators: {"q{i}": {each: {i: [1, 2, 3]}, moves: "carriage{i}", zero: "z{i}", limits: [0, 300]}}
sensors: {tracker: {at: tip, reads: [x, y, z], sigma: 10 um, frame: fitted}}
tool_point: tip
"""
TRUE = """parameters:
  br1: 250.04
  br2: 249.97
  bt2: 0.05
  bt3: -0.03
  pr1: 150.06
  pr3: 149.95
  L1: 400.08
  L3: 399.9
  z1: 0.21
  z2: -0.17
  z3: 0.3
  frame@tracker.tx: 1500
  frame@tracker.ty: -800
  frame@tracker.tz: 300
  frame@tracker.rz: 30
"""


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("head")
    machine, true, out = folder / "head.yaml", folder / "true.yaml", folder / "meas.csv"
    machine.write_text(HEAD)
    true.write_text(TRUE)
    grid = ("--grid", "z=-450:-300:3,rx=-12:12:4,ry=-12:12:4", "--noise", "declared", "--seed", "3", "-q")
    assert run("simulate", machine, *grid, "-p", true, "-o", out).code == 0
    return out


def calibrated(table: Path, datum: str) -> dict[str, Any]:
    machine = table.with_name("with_datum.yaml")
    machine.write_text(f"{HEAD}datum: [{datum}]\n")
    done = run("calibrate", machine, table, "--holdout", "none", "--json")
    assert done.code == 0, done.err
    return dict(done.json)


def test_shifts_are_found_and_what_would_fix_them_is_proposed(table: Path) -> None:
    """Also along the drives: a base that stands higher is drives whose zeros are higher."""
    machine = table.with_name("head.yaml")
    refused = run("calibrate", machine, table)
    assert refused.code == 3 and "(shift along x, shift along y, shift along z)" in refused.err
    proposed = refused.err.split("`datum: [")[1].split("]")[0].split(", ")
    assert len(proposed) == 3 and sum(name.startswith("z") for name in proposed) == 1
    assert calibrated(table, ", ".join(proposed))["datum"] == proposed


def test_what_is_known_does_not_depend_on_the_datum(table: Path) -> None:
    """Radii of the platform, distances between rails, differences of zeros; within what noise makes of each."""
    first, other = calibrated(table, "br1, bt1, z1"), calibrated(table, "br2, bt3, z2")
    assert first["datum"] == ["br1", "bt1", "z1"] and other["datum"] == ["br2", "bt3", "z2"]
    stds = {p["name"]: p["std"] for p in first["parameters"]}
    for name in ("pr1", "pr2", "pr3"):
        assert values(first)[name] == pytest.approx(values(other)[name], abs=0.5 * stds[name])
    chi2 = [result["chi2"] for result in (first, other)]
    assert chi2[0] == pytest.approx(chi2[1], abs=0.5)


def test_ranges_of_a_frame_are_nobodys_statement(table: Path) -> None:
    """Its range is the size of the machine many times over; that it lies well within tells nothing of ranges."""
    ranges = calibrated(table, "br1, bt1, z1")["uncertainty"]["ranges"]
    assert ranges["p_value"] > 0.01 and ranges["factors"]["frame"] == 1.0


def test_a_place_along_a_rail_and_the_zero_of_its_drive_are_no_gauge(tmp_path: Path) -> None:
    """They cannot be separated, but moving one back by the other moves no base: nothing needs a datum."""
    machine, out = tmp_path / "m.yaml", tmp_path / "meas.csv"
    text = HEAD.replace('["br{i}", "bt{i}", 0], along', '["br{i}", "bt{i}", "h{i}"], along').replace(
        "frame: fitted", "frame: machine"
    )
    machine.write_text(text.replace("frames:", '  "h{i}": {each: {i: [1, 2, 3]}, nominal: 0}\nframes:', 1))
    grid = ("--grid", "z=-450:-300:3,rx=-12:12:4,ry=-12:12:4", "--noise", "declared", "--seed", "3", "-q")
    assert run("simulate", machine, *grid, "-o", out).code == 0
    result = run("calibrate", machine, out, "--holdout", "none", "--json").json
    assert result["datum"] is None and result["gauge"] == []
    told = {p["name"]: p["reason"] for p in result["parameters"]}
    assert "cannot be separated from" in told["h1"] and "z1" in told["h1"]


def test_a_turn_of_frames_and_rails_is_found() -> None:
    """Places in frames that turn: their derivatives by finite differences of the places themselves."""
    text = HEAD.replace('turn: [0, 0, "{a}"]', 'at: ["u{i}", 0, 10], turn: [0.1, "t{i}", "{a}"]', 1).replace(
        "along: z", 'along: ["s{i}", 0, 1]'
    )
    more = "".join(
        f'  "{name}{{i}}": {{each: {{i: [1, 2, 3]}}, nominal: {nominal}, range: 1}}\n'
        for name, nominal in (("u", 3), ("t", "2 deg"), ("s", 0.1))
    )
    model = compiled(text.replace("frames:", more + "frames:", 1)).model
    coefficients, rng = model.topology.coefficients, np.random.default_rng(0)
    values = dict(model.by_name(model.nominal))
    values |= {n: v + rng.normal(scale=1e-3) for n, v in values.items()}
    chain = coefficients.jacobian(values, model.names)
    exact = model.base.motion(coefficients.values(values), chain)[: 3 * len(model.base.places)]
    for k, name in enumerate(model.names):
        ends = [places(model, {**values, name: values[name] + step}) for step in (-1e-6, 1e-6)]
        assert exact[:, k] == pytest.approx((ends[1] - ends[0]) / 2e-6, abs=1e-8)


def places(model: Any, values: Mapping[str, float]) -> Any:
    return model.base.positions(model.topology.coefficients.values(values)).ravel()


def values(result: Mapping[str, Any]) -> dict[str, float]:
    return {p["name"]: p["value"] for p in result["parameters"]}
