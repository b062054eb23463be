"""A base of which an instrument that stands anywhere sees neither place nor height: what is held, and what is known."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from pkmcal_cli.calibration.condensed import condensed
from pkmcal_cli.calibration.datum import gauge_of
from pkmcal_cli.calibration.identifiability import directions
from pkmcal_cli.calibration.measured_problem import problem_of
from pkmcal_cli.calibration.residual import evaluate
from pkmcal_cli.loading.load_machine import load_machine, load_measurements
from tests.command import run
from tests.computed_once import run_once
from tests.support import compiled

pytestmark = pytest.mark.usefixtures("unsized")

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
"""
STANDS = """  frame@tracker.tx: 1500
  frame@tracker.ty: -800
  frame@tracker.tz: 300
  frame@tracker.rz: 30
"""
STATED = {"br": (250, 0.1), "bt": (0, 0.1), "pr": (150, 0.1), "L": (400, 0.2), "z": (0, 0.5)}  # nominal, range, mm
GRID = ("--grid", "z=-450:-300:3,rx=-12:12:4,ry=-12:12:4", "--noise", "declared", "--seed", "3", "-q")


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("head")
    machine, true, out = folder / "head.yaml", folder / "true.yaml", folder / "meas.csv"
    machine.write_text(HEAD)
    true.write_text(TRUE + STANDS)
    assert run("simulate", machine, *GRID, "-p", true, "-o", out).code == 0
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
    """Radii of the platform, within half of what they are known to: ranges, in part of what is held, hold them too."""
    first, other = calibrated(table, "br1, bt1, z1"), calibrated(table, "br2, bt3, z2")
    assert first["datum"] == ["br1", "bt1", "z1"] and other["datum"] == ["br2", "bt3", "z2"]
    stds = {p["name"]: p["std"] for p in first["parameters"]}
    found, elsewhere = values(first), values(other)
    for name in ("pr1", "pr2", "pr3"):
        assert found[name] == pytest.approx(elsewhere[name], abs=0.5 * stds[name])
    chi2 = [result["chi2"] for result in (first, other)]
    assert chi2[0] == pytest.approx(chi2[1], abs=0.5)


@pytest.mark.slow
def test_the_loop_holds_the_same_and_writes_what_calibrate_finds(table: Path) -> None:
    """Each of `diagnose`, `improve` and `calibrate` of its machine; and without a datum all refuse.

    To a twentieth of what is known: `calibrate` estimates ranges, by which weak directions are held, once more.
    """
    machine = table.with_name("searched.yaml")
    machine.write_text(f"{HEAD}datum: [br1, bt1, z1]\n")
    held = "held fixed as datum: br1, bt1, z1"
    assert held in run_once("diagnose", machine, table).err
    made = run_once("improve", machine, table, "-o", table.with_name("improved.yaml"), "--force")
    assert made.code == 0 and held in made.err
    written = yaml.safe_load(table.with_name("improved.params.yaml").read_text(encoding="utf-8"))["parameters"]
    again = run("calibrate", table.with_name("improved.yaml"), table, "--holdout", "none", "--json").json
    for p in (p for p in again["parameters"] if p["std"]):
        assert written[p["name"]]["value"] == pytest.approx(p["value"], abs=0.05 * p["std"])
    assert [written[name]["value"] for name in ("br1", "bt1", "z1")] == [250, 0, 0]
    for command in ("diagnose", "improve"):
        refused = run(command, table.with_name("head.yaml"), table)
        assert refused.code == 3 and "declare what defines the base" in refused.err


@pytest.mark.parametrize("seed", [2, 10])
def test_ranges_of_a_frame_are_nobodys_statement(tmp_path: Path, seed: int) -> None:
    """Offsets as the ranges say; that a frame lies well within the size of the machine, many times over, tells nothing.

    Taken for a statement, it gave these draws p = 0.001 and 0.003.
    """
    rng = np.random.default_rng(seed)
    drawn = {f"{a}{i}": rng.normal(n, r / 2) for a, (n, r) in STATED.items() for i in (1, 2, 3)}
    machine, true, out = tmp_path / "head.yaml", tmp_path / "true.yaml", tmp_path / "meas.csv"
    machine.write_text(f"{HEAD}datum: [br1, bt1, z1]\n")
    true.write_text("parameters:\n" + "".join(f"  {n}: {v}\n" for n, v in drawn.items()) + STANDS)
    assert run("simulate", machine, *GRID, "-p", true, "-o", out).code == 0
    ranges = run("calibrate", machine, out, "--holdout", "none", "--json").json["uncertainty"]["ranges"]
    assert ranges["p_value"] > 0.01 and ranges["factors"]["frame"] == 1.0


def test_a_place_along_a_rail_and_the_zero_of_its_drive_are_no_gauge(tmp_path: Path) -> None:
    """They cannot be separated, but moving one back by the other moves no base: nothing needs a datum."""
    machine, out = tmp_path / "m.yaml", tmp_path / "meas.csv"
    text = HEAD.replace('["br{i}", "bt{i}", 0], along', '["br{i}", "bt{i}", "h{i}"], along').replace(
        "frame: fitted", "frame: machine"
    )
    machine.write_text(text.replace("frames:", '  "h{i}": {each: {i: [1, 2, 3]}, nominal: 0}\nframes:', 1))
    assert run("simulate", machine, *GRID, "-o", out).code == 0
    result = run("calibrate", machine, out, "--holdout", "none", "--json").json
    assert result["datum"] is None and result["gauge"] == []
    told = {p["name"]: p["reason"] for p in result["parameters"]}
    assert "cannot be separated from" in told["h1"] and "z1" in told["h1"]


TURNED = HEAD.replace('turn: [0, 0, "{a}"]', 'at: ["u{i}", 0, 10], turn: [0.1, "t{i}", "{a}"]', 1).replace(
    "along: z", 'along: ["s{i}", 0, 1]'
).replace(
    "frames:",
    "".join(
        f'  "{name}{{i}}": {{each: {{i: [1, 2, 3]}}, nominal: {nominal}, range: 1}}\n'
        for name, nominal in (("u", 3), ("t", "2 deg"), ("s", 0.1))
    )
    + "frames:",
    1,
)


@pytest.mark.parametrize("text", [TURNED, "triglide", "scissors", "delta4", "gantry"])
def test_places_move_as_their_derivatives_say(text: str) -> None:
    """In frames that turn, along rails that tilt, in the plane: by finite differences of the places themselves."""
    model = compiled(text).model
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


@pytest.mark.slow
def test_only_bench_measurements_that_tell_of_others_are_proposed(table: Path) -> None:
    machine = table.with_name("planned.yaml")
    machine.write_text(f"{HEAD}datum: [br1, bt1, z1]\n")
    proposals = run("plan", machine, table, "--json").json["bench"]
    assert proposals
    for proposal in proposals:
        assert len(proposal["std"]) > 1
        for known in proposal["std"]:
            assert known["after"] is not None and (known["before"] is None or known["after"] < known["before"])


def test_one_line_says_what_to_do_about_all_that_is_weak(table: Path) -> None:
    """With the option that it names, fewer combinations are weak, and what was undetermined is not any more."""
    machine = table.with_name("weak.yaml")
    machine.write_text(f"{HEAD}datum: [br1, bt1, z1]\n")
    lines = run("observability", machine, table).err.splitlines()
    weak = [line for line in lines if line.startswith("weak: ")]
    (option,) = [line.split("`")[1] for line in lines if line.startswith("help: their ranges hold them")]
    assert len(weak) > 2 and sum(line.startswith("help:") for line in lines) <= 2
    null = [n for line in lines if line.startswith("help: fix") for n in line.split("`")[1].split(",")[1:]]
    seen = run("observability", machine, table, "--select", ",".join([option.removeprefix("--select "), *null]))
    assert seen.code == 0 and "undetermined" not in seen.err
    assert sum(line.startswith("weak: ") for line in seen.err.splitlines()) < len(weak)


def test_what_is_free_moves_all_rails_alike(table: Path) -> None:
    """Each freedom is a shift of all places, and of the zeros of the drives where it is along them; no frame turns."""
    loaded = load_machine(table.with_name("head.yaml"))
    problem = problem_of(loaded.model, load_measurements(loaded, [table]))
    model, start = problem.model, problem.model.nominal
    selected = tuple(p.name for p in model.parameters)
    rows = evaluate(problem, start, selected)
    spectrum = directions(condensed(problem, rows).jacobian, selected, model.ranges)
    gauge = gauge_of(problem, start, spectrum)
    assert gauge.motions == ("shift along x", "shift along y", "shift along z")
    numbers = model.by_name(start)
    chain = model.topology.coefficients.jacobian(numbers, selected)
    motion = model.base.motion(model.topology.coefficients.values(numbers), chain * model.ranges)
    shifts = (motion @ gauge.directions.T).reshape(-1, 3, 3)  # (places and frames, xyz, freedoms)
    assert np.linalg.matrix_rank(shifts[0], tol=1e-6) == 3
    size = np.abs(shifts[0]).max()
    for place in shifts[1:3]:
        assert place == pytest.approx(shifts[0], abs=1e-4 * size)
    assert np.abs(shifts[3:]).max() <= 1e-4 * size


@pytest.mark.slow
def test_a_prior_holds_what_its_calibration_held_as_datum(table: Path) -> None:
    """After the repair of a joint, with the tracker elsewhere: what is known of the others is relative to the datum."""
    calibrated(table, "br1, bt1, z1")
    machine, old = table.with_name("with_datum.yaml"), table.with_name("old.params.yaml")
    assert run("calibrate", machine, table, "--holdout", "none", "-q", "-o", old).code == 0
    repaired, after = table.with_name("repaired.yaml"), table.with_name("repaired.csv")
    repaired.write_text(TRUE.replace("pr1: 150.06", "pr1: 149.53") + STANDS.replace("1500", "900"))
    few = ("--grid", "z=-440:-310:2,rx=-10:10:2,ry=-10:10:2", "--noise", "declared", "--seed", "5", "-q")
    assert run("simulate", table.with_name("head.yaml"), *few, "-p", repaired, "-o", after).code == 0
    again = ("--prior", old, "--loosen", "pr1", "--holdout", "none", "--json")
    done = run("calibrate", machine, after, *again)
    assert "held at the values there: br1, bt1, z1" in done.err and done.json["datum"] == ["br1", "bt1", "z1"]
    before = run("calibrate", machine, table, "--holdout", "none", "--json").json["parameters"]
    new = {p["name"]: p for p in done.json["parameters"]}
    assert not {"br1", "bt1", "z1"} & {n for n, p in new.items() if p["identified"]}
    first = next(p for p in before if p["name"] == "pr1")
    change, noise = new["pr1"]["value"] - first["value"], np.hypot(new["pr1"]["std"], first["std"])
    assert abs(change + 0.53) < 3 * noise and noise < 0.1, (change, noise)


@pytest.mark.slow
def test_a_frame_that_is_held_though_the_instrument_was_moved(table: Path) -> None:
    """By a parameter file of the set-up before; not where it stands as it did, nor where its frame is identified."""
    calibrated(table, "br1, bt1, z1")
    machine, old, moved, true = (table.with_name(n) for n in ("with_datum.yaml", "old.yaml", "moved.csv", "moved.yaml"))
    assert run("calibrate", machine, table, "--holdout", "none", "-q", "-o", old, "--force").code == 0
    true.write_text(TRUE + STANDS.replace("rz: 30", "rz: 33"))
    assert run("simulate", table.with_name("head.yaml"), *GRID, "-p", true, "-o", moved).code == 0
    told = "frame@tracker is held at the values of"
    for file, select, expected in ((moved, "pr1", True), (table, "pr1", False), (moved, "pr1,frame@tracker.*", False)):
        done = run("calibrate", machine, file, "-p", old, "--select", select, "--holdout", "none")
        assert (told in done.err) == expected, (file, select)
        assert not expected or "the readings place the instrument elsewhere" in done.err
