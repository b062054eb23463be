"""The tool point: whose pose grids, tables, sensitivities and error maps mean; what of a grid is out of reach."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.measured_pose import measured_poses
from pkmcal_cli.calibration.measured_problem import problem_of
from pkmcal_cli.compiler import compile_machine
from pkmcal_cli.language.machine_yaml import read_machine
from pkmcal_cli.tables.measurements import read_measurements
from tests.command import MACHINES, column, run
from tests.support import SHIPPED, compiled
from tests.tool_machines import CRANK, HEAD, drawn_head_poses

OF = "of the tool point"


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("head.yaml").write_text(HEAD)
    Path("crank.yaml").write_text(CRANK)


def test_poses_are_those_of_the_named_point() -> None:
    """The crank's hub instead of its tip: x = q, rz = a - 30 deg, and y does not move."""
    Path("hub.yaml").write_text("extends: crank.yaml\ntool_point: arm\n")
    Path("poses.csv").write_text("x [mm],rz [deg]\n150,20\n")
    for given in (("poses.csv",), ("--grid", "x=150:150:1,rz=20:20:1")):
        done = run("simulate", "hub.yaml", *given, "-o", "out.csv", "--force", "--json")
        assert done.json["tool_point"] == "arm" and "note: tool point: arm\n" in done.err
        assert column("out.csv", "q") == pytest.approx([150], abs=1e-10)
        assert column("out.csv", "a") == pytest.approx([50], abs=1e-10)
        tip = 150 + 200 * np.cos(np.radians(50)) - 40 * np.sin(np.radians(50))
        assert column("out.csv", "x") == pytest.approx([tip], abs=1e-10)  # the sensor still reads the tip
    refused = run("simulate", "hub.yaml", "--grid", "y=0:1:2")
    assert refused.code == 2 and "no degree of freedom moves `y` of tool point `arm`" in refused.err


def test_sensitivity_is_that_of_the_tool_point() -> None:
    """r moves the tip by its range, the hub not at all."""
    Path("hub.yaml").write_text("extends: crank.yaml\ntool_point: arm\n")
    shifts = {}
    for file in ("crank.yaml", "hub.yaml"):
        done = run("sensitivity", file, "--select", "r", "--json")
        shifts[done.json["tool_point"]] = done.json["parameters"][0]["position"]
    assert shifts["tip"] == pytest.approx(0.1, rel=1e-9) and shifts["arm"] == 0


def test_the_error_map_is_that_of_the_tool_point() -> None:
    """An error of the crank's length: at the tip its uncertainty, at the hub nothing."""
    Path("poses.csv").write_text("q,a\n100,30\n120,50\n90,70\n")
    Path("p.yaml").write_text(
        "parameters: {r: {value: 200, std: 0.01}}\ncorrelations: {names: [r], std: [0.01], matrix: [[1]]}\n"
    )
    Path("hub.yaml").write_text("extends: crank.yaml\ntool_point: arm\n")
    for file, size in (("crank.yaml", 10.0), ("hub.yaml", 0.0)):
        done = run("simulate", file, "poses.csv", "-p", "p.yaml", "--uncertainty", "-o", "out.csv", "--force")
        assert done.code == 0 and "note: tool point:" in done.err
        assert np.hypot(column("out.csv", "u.x"), column("out.csv", "u.y")) == pytest.approx([size] * 3, rel=1e-9)


@pytest.mark.parametrize(
    ("more", "told"),
    [
        ("tool_point: tpi", "error[unknown-name]: unknown point `tpi`"),
        ("tool_point: camera", "help: `camera` is a sensor, not a point"),
        ("tool_point: G\nground: {G: [0, 0]}", "`G` is a ground point: it does not move\ntool_point: G"),
        ("tool_point: [tip]", "expected a name or text, found a list"),
        ("tool_point: 3", "expected a name or text, found `3`"),
    ],
)
def test_tool_points_that_cannot_be(more: str, told: str) -> None:
    Path("bad.yaml").write_text(f"extends: crank.yaml\n{more}\n")
    done = run("check", "bad.yaml")
    assert done.code == 1 and told in done.err and "1 fault\n" in done.err


def test_without_a_tool_point_grids_and_sensitivities_say_what_to_add() -> None:
    Path("gauge.yaml").write_text(
        "extends: crank.yaml\nground: {G: [0, 0]}\n"
        "sensors: {camera: null, gauge: {kind: distance, at: tip, to: G, sigma: 1 um}}\n"
    )
    shown = run("check", "gauge.yaml", "--json")
    assert shown.json["tool_point"] is None and "tool point: none" in shown.err
    for command in (["simulate"], ["sensitivity"], ["observability"], ["plan"]):
        done = run(*command, "gauge.yaml", "--grid", "x=0:1:2")
        assert done.code == 3 and "error[tool-point]: the machine has no tool point" in done.err
        assert "add `tool_point: NAME`" in done.err
    Path("drives.csv").write_text("q,a\n100,30\n120,50\n")
    assert run("simulate", "gauge.yaml", "drives.csv").code == 0  # drive readings need none
    assert run("observability", "gauge.yaml", "drives.csv").code == 0
    assert run("sensitivity", "gauge.yaml", "drives.csv").code == 3
    Path("named.yaml").write_text("extends: gauge.yaml\ntool_point: tip\n")
    assert "tool point: tip, of sensor gauge" in run("check", "named.yaml").err
    assert run("simulate", "named.yaml", "--grid", "x=0:1:2").code == 0


def test_a_tool_point_that_does_not_show_the_mechanism_is_refused_for_poses() -> None:
    """The slide of the crank shows one of two degrees of freedom; its sensitivity is one all the same."""
    Path("slide.yaml").write_text("extends: crank.yaml\ntool_point: slide\n")
    done = run("simulate", "slide.yaml", "--grid", "x=0:1:2")
    told = "the pose of tool point `slide` shows 1 of the mechanism's 2 degrees of freedom"
    assert done.code == 3 and told in done.err and "name another `tool_point`" in done.err
    assert run("sensitivity", "slide.yaml").code == 0


def drives_at_measured_poses(machine: str, table: str) -> tuple[Array, Array]:
    """What the drives should read at the poses of a table (n, A), and what they read there."""
    read = read_machine(machine)
    problem = problem_of(compile_machine(read).model, read_measurements([table], read))
    found = measured_poses(problem, problem.model.nominal)
    assert len(found.rows) == len(problem)
    return found.drive_readings(problem.model.nominal), problem.rows.readings


def test_poses_are_measured_in_whatever_independent_coordinates_an_instrument_reads() -> None:
    """A height gauge with a level reads z, rx, ry: they say where the head is, and so what its drives should read."""
    poses, drives = drawn_head_poses(5)
    sensor = "level: {at: tool, reads: [z, rx, ry], sigma: {position: 10 um, orientation: 0.01}, frame: machine}"
    Path("level.yaml").write_text("extends: head.yaml\nsensors: {tracker: null, " + sensor + "}\n")
    table = np.column_stack([drives * 1e3, poses[:, 2] * 1e3, np.degrees(poses[:, 3:5])])
    np.savetxt("t.csv", table, "%.17g", ",", header="q1,q2,q3,z,rx,ry", comments="")
    expected, read = drives_at_measured_poses("level.yaml", "t.csv")
    assert np.abs(expected - drives).max() < 1e-12 and np.abs(read - drives).max() < 1e-12


def test_poses_are_measured_where_the_instrument_is_whatever_point_grids_mean() -> None:
    text = (MACHINES / "hexapod7.yaml").read_text()
    moved = text.replace("points: {", "points: {nose: [0, 0, 30], ", 1).replace("tool_point: platform\n", "")
    Path("nose.yaml").write_text(moved + "tool_point: nose\n")
    table = str(MACHINES / "hexapod7.csv")
    plain, _ = drives_at_measured_poses(str(MACHINES / "hexapod7.yaml"), table)
    other, read = drives_at_measured_poses("nose.yaml", table)
    assert np.abs(other - plain).max() < 1e-12 and np.abs(other - read).max() < 1e-3
    assert "tool point: nose\n" in run("check", "nose.yaml").err


def test_points_out_of_reach_are_skipped_and_counted_by_every_command_that_takes_a_grid() -> None:
    """The crank's tip reaches sqrt(r^2 + e^2) = 203.96 mm across: five of seven rows of points."""
    grid = ("--grid", "x=0:100:2,y=-300:300:7")
    Path("crank.yaml").write_text(CRANK.replace("position: 10 um", "position: 1 um"))
    for command in ("simulate", "sensitivity", "observability", "plan"):
        out = ("-o", "out.csv") if command == "simulate" else ()
        done = run(command, "crank.yaml", *grid, *out, "--json")
        assert done.code == 0, done.err
        assert "skipped: 4 of 14 grid points: out of reach: no actuator positions for this pose" in done.err
        assert (done.json["n_rows"], done.json["n_failed"]) == (10, 4)
        assert [f["line"] for f in done.json["failed"]] == [1, 7, 8, 14]
        assert {f["reason"] for f in done.json["failed"]} == {f"out of reach: no actuator positions for this pose {OF}"}
        none = run(command, "crank.yaml", "--grid", "y=300:400:3")
        assert none.code == 3 and "none of 3 grid points can be used: out of reach" in none.err
        assert none.err.count("help: ") == 1
    numbers = [line.split(",")[0] for line in Path("out.csv").read_text().splitlines() if line[0].isdigit()]
    assert numbers == ["2", "3", "4", "5", "6", "9", "10", "11", "12", "13"]


def test_points_that_the_machine_as_calibrated_does_not_reach_are_skipped_too() -> None:
    """Set values are those of the nominal machine; with rods of 240 mm they are too far apart but near y = 380 mm."""
    Path("p.yaml").write_text("parameters: {l1: 240, l2: 240}\n")
    machine = MACHINES / "triglide-nonredundant.yaml"
    for command in ("simulate", "sensitivity", "observability", "plan"):
        out = ("-o", "out.csv") if command == "simulate" else ("--select", "l1,l2")
        done = run(command, machine, "--grid", "x=300:400:2,y=275:380:2", "-p", "p.yaml", *out, "--json")
        assert done.code == 0, done.err
        assert (done.json["n_rows"], done.json["n_failed"]) == (2, 2), command
        assert [f["line"] for f in done.json["failed"]] == [1, 3]
        assert "skipped: 2 of 4 grid points: out of reach: the mechanism cannot be assembled" in done.err
        if command == "observability":
            assert done.json["n_values"] == 4


def test_an_offset_of_the_sensor_counts_where_its_point_is_the_tool_point_by_default() -> None:
    """10 mm beside the tip, in the axes of the arm."""
    text = CRANK.replace("at: tip, reads", "at: tip, offset: [0, 10], reads")
    Path("beside.yaml").write_text(text)
    Path("tip.yaml").write_text(text + "tool_point: tip\n")
    without = "tip, without the `offset` of sensor camera\n"
    for file, radius, told in (("beside.yaml", [200, 50], "tip, of sensor camera\n"), ("tip.yaml", [200, 40], without)):
        done = run("simulate", file, "--grid", "x=200:200:1,rz=20:20:1", "-o", "out.csv", "--force")
        assert f"note: tool point: {told}" in done.err
        q, a = column("out.csv", "q"), np.radians(50)
        assert q == pytest.approx([200 - radius[0] * np.cos(a) + radius[1] * np.sin(a)], abs=1e-9)


def test_skipped_points_do_not_change_the_figures_of_the_others() -> None:
    whole = run("observability", "crank.yaml", "--grid", "x=0:100:2,y=-200:200:5", "--json").json
    wider = run("observability", "crank.yaml", "--grid", "x=0:100:2,y=-300:300:7", "--json").json
    assert wider["n_rows"] == 10 and wider["n_failed"] == 4 and whole["n_failed"] == 0
    for one, other in zip(whole["parameters"], wider["parameters"], strict=True):
        assert one["std"] == pytest.approx(other["std"], rel=1e-9)


def test_shipped_machines_have_a_tool_point() -> None:
    for file in (MACHINES / f"{name}.yaml" for name in SHIPPED):
        assert compiled(file.stem).model.tool_motion.shown == compiled(file.stem).mobility.degrees_of_freedom
        assert run("check", file, "--json").json["tool_point"]
