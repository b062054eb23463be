"""The workspace: what it holds, what plans and commands without poses choose in it, what is wrong with one."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from scipy.optimize import fsolve

from pkmcal_cli.base.listener import Record
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.loading.load_machine import load_machine
from pkmcal_cli.loading.workspace_poses import workspace_poses
from pkmcal_cli.model.workspace import Cylinder, Workspace
from pkmcal_cli.prediction import rigid_pose
from tests.command import MACHINES, Done, run, timeless
from tests.support import SHIPPED, compiled, model, truth
from tests.tool_machines import CRANK, HEAD, head_poses

START = np.array([0.58, 0.0, 0.1])
UNSIZED = patch("pkmcal_cli.diagnosis.detection.Detection.size", lambda *_: np.inf)
"""Effects that a plan would detect, which it says beside its points."""
ROUND = "cylinder: {at: [0, 0, -540], radius: 100, height: 200}"


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("head.yaml").write_text(HEAD)
    Path("crank.yaml").write_text(CRANK)


def with_workspace(machine: str, workspace: str, more: str = "") -> str:
    """A file of a machine with another workspace, and its name."""
    base = f"{MACHINES / machine}.yaml" if machine in SHIPPED else f"{machine}.yaml"
    Path("w.yaml").write_text(f"extends: {base}\nworkspace: {{{workspace}}}\n{more}")
    return "w.yaml"


def test_a_cylinder_holds_what_is_near_its_axis_and_between_its_ends() -> None:
    """Any direction of the axis, against points made from distance and height; the bounds are those of its rim."""
    rng = np.random.default_rng(0)
    for height in (0.3, np.inf):
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        across = np.linalg.svd(axis[None])[2][1:]
        cylinder = Cylinder(rng.normal(size=3), axis, 0.2, height)
        turn, far, high = rng.uniform(0, 2 * np.pi, 4000), rng.uniform(0, 0.4, 4000), rng.uniform(-0.2, 0.6, 4000)
        ring = np.cos(turn)[:, None] * across[0] + np.sin(turn)[:, None] * across[1]
        places = cylinder.base + far[:, None] * ring + high[:, None] * axis
        expected = (far <= 0.2) & ((high >= 0) & (high <= height) if np.isfinite(height) else True)
        assert (cylinder.holds(places) == expected).all() and 0.1 < expected.mean() < 0.6
        low, top = cylinder.bounds
        if np.isfinite(height):
            rim = np.concatenate([cylinder.base + 0.2 * ring, cylinder.base + 0.2 * ring + height * axis])
            assert np.abs(low - rim.min(axis=0)).max() < 1e-5 and np.abs(top - rim.max(axis=0)).max() < 1e-5
        else:
            assert np.isinf(low).all() and np.isinf(top).all()
    upright = Cylinder(np.zeros(3), np.array([0, 0, 1.0]), 0.2, np.inf).bounds
    assert upright[0] == pytest.approx([-0.2, -0.2, -np.inf]) and upright[1] == pytest.approx([0.2, 0.2, np.inf])
    assert not cylinder.holds(np.full((1, 3), np.nan)).any()


def proposed(machine: str, *more: str, points: int = 40) -> Array:
    """Drive positions (n, A), mm or deg, of the points that a plan proposes."""
    with UNSIZED:
        done = run("plan", machine, "--points", str(points), *more, "--json", "-q")
    assert done.code == 0, done.err
    drives = [name for name in done.json["points"][0] if not name.startswith("dir.")]
    return np.array([[point[name] for name in drives] for point in done.json["points"]])


MIDDLE = ("--grid", "x=-10:10:2,y=-10:10:2,z=-450:-430:2", "--aim", "l1a,l2a,l1b,l2b")


def test_what_a_plan_proposes_is_in_the_workspace_and_fills_it() -> None:
    """A small grid in the middle; points for the arms of the delta lie on the rim of the cylinder, none beyond."""
    q = proposed(with_workspace("delta4", ROUND), *MIDDLE, points=12)
    x, y, z = truth("delta4").forward(q * 1e-3).tcp[:, :3].T  # type: ignore[attr-defined]
    assert np.hypot(x, y).max() < 0.1 + 1e-6 and z.min() > -0.54 - 1e-6 and z.max() < -0.34 + 1e-6
    assert np.hypot(x, y).max() > 0.09 and np.ptp(z) > 0.18


@pytest.mark.slow
def test_a_box_of_a_workspace_holds_what_a_plan_proposes() -> None:
    box = "box: {x: [0, 50], z: [-500, -480]}"
    q = proposed(with_workspace("delta4", box + ", cylinder: null"), *MIDDLE)
    x, _, z = truth("delta4").forward(q * 1e-3).tcp[:, :3].T  # type: ignore[attr-defined]
    assert x.min() > -1e-6 and x.max() < 0.05 + 1e-6 and z.min() > -0.5 - 1e-6 and z.max() < -0.48 + 1e-6


@pytest.mark.slow
def test_limits_of_drives_bound_what_a_plan_proposes() -> None:
    file = with_workspace("delta4", "drives: {q1: [-20, 30 mm], q3: [0, 0.05 m]}, cylinder: null, box: {x: [-80, 80]}")
    q = proposed(file, "--grid", "x=-10:10:2,y=-60:60:2,z=-450:-430:2", "--aim", "l1a,l2a", points=20)
    assert q[:, 0].min() >= -20 and q[:, 0].max() <= 30 and q[:, 2].min() >= 0 and q[:, 2].max() <= 50


@pytest.mark.slow
def test_a_head_is_planned_in_the_coordinates_that_its_workspace_limits() -> None:
    """z, rx and ry: its tip's x and y follow, as its legs have it."""
    file = with_workspace("head", "box: {z: [550, 620], rx: [-15, 15], ry: [0, 15 deg]}")
    q = proposed(file, "--aim", "r")
    poses = np.array([fsolve(lambda p, row=row: head_poses(*p[:, None])[1][0] - row, START) for row in q * 1e-3])
    low, high = np.array([0.55, *np.radians([-15, 0])]), np.array([0.62, *np.radians([15, 15])])
    assert (poses > low - 1e-9).all() and (poses < high + 1e-9).all()
    assert (np.ptp(poses, axis=0) > 0.3 * (high - low)).all()
    done = run("observability", file, "--json")
    assert done.json["n_rows"] == 50 and "note: tool point: tool, of sensor tracker" in done.err


@pytest.mark.slow
def test_a_plan_along_one_line_is_widened_in_the_coordinates_of_the_workspace() -> None:
    """Tilts of 10 to 15 deg about y, though the plan has none; held by its tip's place, the head would not tilt."""
    file = with_workspace("head", "box: {z: [550, 620], rx: [-15, 15], ry: [10, 15]}")
    q = proposed(file, "--grid", "z=560:600:3,rx=0:0:1,ry=0:0:1", "--aim", "r", points=10)
    poses = np.array([fsolve(lambda p, row=row: head_poses(*p[:, None])[1][0] - row, START) for row in q * 1e-3])
    assert (np.degrees(poses[:, 2]) > 10 - 1e-6).all() and (np.degrees(poses[:, 2]) < 15 + 1e-6).all()


def used_poses(machine: str, monkeypatch: pytest.MonkeyPatch) -> tuple[Done, Array]:
    """Drive readings of the poses that `sensitivity` chooses."""
    import pkmcal_cli.workflow.analysis as analysis

    seen: list[Any] = []
    real = analysis.sensitivity
    monkeypatch.setattr(analysis, "sensitivity", lambda m, v, rows, *s: seen.append(rows) or real(m, v, rows, *s))
    done = run("sensitivity", machine, "--json")
    assert done.code == 0, done.err
    return done, seen[0].readings


def test_commands_without_poses_choose_them_in_the_workspace(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fifty, evenly: in a box of two coordinates the mean is its middle to 4 %, and each quarter has about as many."""
    done, q = used_poses(with_workspace("scissors", "box: {x: [-200, 100], y: [-50, 150]}"), monkeypatch)
    assert done.json["n_rows"] == 50 and "note: no poses given: 50 poses spread over the workspace\n" in done.err
    x, y = truth("scissors").forward(q).tcp[:, :2].T  # type: ignore[attr-defined]
    assert x.min() > -0.2 and x.max() < 0.1 and y.min() > -0.05 and y.max() < 0.15
    assert abs(x.mean() + 0.05) < 0.04 * 0.3 and abs(y.mean() - 0.05) < 0.04 * 0.2
    quarters = np.histogram2d(x, y, bins=2, range=[[-0.2, 0.1], [-0.05, 0.15]])[0]
    assert quarters.min() >= 10 and quarters.max() <= 15
    again = run("sensitivity", "w.yaml", "--json")
    assert timeless(again.out) == timeless(done.out)
    assert run("observability", "w.yaml", "--json").json["n_rows"] == 50
    planned = run("plan", "w.yaml", "--json")
    assert planned.code == 0 and planned.json["n_rows"] == 50 and "spread over the workspace" in planned.err


def test_coordinates_that_no_limit_has_are_kept_and_it_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    done, q = used_poses(with_workspace("crank", "box: {x: [0, 100]}"), monkeypatch)
    assert "note: `y` kept as in the reference configuration" in done.err
    assert np.ptp(q[:, 1]) < 1e-9 and np.ptp(q[:, 0]) > 0.09
    done, q = used_poses(with_workspace("crank", "box: {rz: [0, 60]}"), monkeypatch)
    assert "note: `x` kept as in the reference configuration" in done.err
    assert np.degrees(q[:, 1]).min() > 30 - 1e-9 and np.degrees(q[:, 1]).max() < 90 + 1e-9


def test_a_workspace_of_drives_alone_is_spread_over_their_travel(monkeypatch: pytest.MonkeyPatch) -> None:
    file = with_workspace("crank", "drives: {q: [0, 300], a: [-60 deg, 60 deg]}")
    done, q = used_poses(file, monkeypatch)
    assert done.json["n_rows"] == 50
    assert q[:, 0].min() > 0 and q[:, 0].max() < 0.3 and np.ptp(q[:, 0]) > 0.28
    assert abs(np.degrees(q[:, 1])).max() < 60 and np.ptp(np.degrees(q[:, 1])) > 110
    part = run("sensitivity", with_workspace("crank", "drives: {q: [0, 300]}"))
    assert part.code == 3 and "limits neither coordinates of the tool point nor all drives" in part.err
    limits = "actuators: {a: {limits: [-60, 60]}}\n"
    assert run("sensitivity", with_workspace("crank", "drives: {q: [0, 300]}", limits)).code == 0


def test_a_circle_in_the_plane_and_other_units(monkeypatch: pytest.MonkeyPatch) -> None:
    _, q = used_poses(with_workspace("crank", "cylinder: {at: [20 cm, 120], radius: 0.05 m}"), monkeypatch)
    x = q[:, 0] + 0.2 * np.cos(q[:, 1]) - 0.04 * np.sin(q[:, 1])
    y = 0.2 * np.sin(q[:, 1]) + 0.04 * np.cos(q[:, 1])
    far = np.hypot(x - 0.2, y - 0.12)
    assert far.max() < 0.05 + 1e-9 and far.max() > 0.045 and len(q) == 50


@pytest.mark.parametrize(
    "command",
    [
        ("plan", "--grid", "x=0:9:3", "--aim", "r"),
        *(pytest.param((name,), marks=pytest.mark.slow) for name in ("sensitivity", "observability", "plan")),
    ],
    ids=" ".join,
)
def test_a_workspace_that_nothing_reaches_is_an_error_where_it_is_needed(command: tuple[str, ...]) -> None:
    file = with_workspace("crank", "box: {y: [300, 400]}")
    shown = run("check", file)
    assert shown.code == 0 and "warning[workspace]: the reference configuration is outside the workspace" in shown.err
    done = run(command[0], file, *command[1:])
    assert done.code == 3 and "error[workspace]: the machine reaches no pose of its workspace" in done.err
    assert run("simulate", file, "--grid", "x=0:9:3").code == 0  # grids are the user's


def test_check_shows_the_workspace() -> None:
    done = run("check", with_workspace("delta4", ROUND + ", drives: {q2: [-100, 50]}"), "--json")
    shown = {w["name"]: (w["low"], w["high"], w["unit"]) for w in done.json["workspace"]}
    assert shown == {"x": (-100, 100, "mm"), "y": (-100, 100, "mm"), "z": (-540, -340, "mm"), "q2": (-100, 50, "mm")}
    assert "Workspace, within its cylinder" in done.err
    assert run("check", "crank.yaml", "--json").json["workspace"] == []


@pytest.mark.parametrize(
    ("workspace", "told"),
    [
        ("box: {x: [100, 0]}", "the lower limit must be below the upper limit"),
        ("box: {x: [5, 5]}", "the lower limit must be below the upper limit"),
        ("box: {x: [0, 1], rx: [0, 1]}", "`rx` does not exist in a planar machine"),
        ("box: {x: [0, .nan]}", "`.nan` is not a finite number"),
        ("box: {x: 5}", "expected a list, found `5`"),
        ("box: {x: [1, 2, 3]}", "expected 2 entries"),
        ("box: {x: [0, 1 deg]}", "`1 deg` is an angle; expected a length"),
        ("drives: {q: [0, 1], a: [0, 5 mm]}", "`5 mm` is a length; expected an angle"),
        ("cylinder: {radius: 0}", "`0` must be positive"),
        ("cylinder: {radius: 1, height: 3}", "`height` does not exist in a planar machine: the cylinder is a circle"),
        ("cylinder: {at: [0, 0]}", "missing key `radius`"),
        ("box: {x: [0, 10]}, cylinder: {radius: 5, at: [100, 0]}", "box and cylinder have nothing in common in `x`"),
        ("box: {}", "`box` limits no coordinate"),
        ("", "the workspace limits nothing"),
    ],
)
def test_workspaces_that_cannot_be(workspace: str, told: str) -> None:
    done = run("check", with_workspace("crank", workspace))
    assert done.code == 1 and told in done.err


def test_a_workspace_needs_a_tool_point_that_has_its_coordinates() -> None:
    lone = run("check", with_workspace("crank", "box: {x: [0, 10]}", "sensors: {camera: null}\n"))
    assert lone.code == 1 and "the workspace is in coordinates of the tool point, but the machine has none" in lone.err
    node = run("check", with_workspace("five-bar", "box: {rz: [0, 10]}"))
    assert node.code == 1 and "tool point `tip` is a node without rotation: it has no `rz`" in node.err
    apart = run("check", with_workspace("crank", "drives: {q: [0, 9]}", "actuators: {q: {limits: [20, 400]}}\n"))
    assert apart.code == 1 and "limits outside the actuator's own, 20 mm to 400 mm" in apart.err


def test_shipped_workspaces_hold_their_reference_configuration() -> None:
    some = [name for name in SHIPPED if compiled(name).model.workspace is not None]
    assert len(some) >= 6
    for name in some:
        machine = model(name)
        assert machine.workspace is not None
        assert machine.workspace.holds(machine.tool.reference[None], machine.reference_readings[None]).all()


@pytest.mark.parametrize(("box", "lost"), [("[130, 350]", False), ("[60, 350]", True), ("[60, 90]", True)])
def test_the_substructure_is_looked_at_in_the_workspace(box: str, lost: bool) -> None:
    """Rods 1 and 2 of the Triglide are in line where the TCP is as high as their joints, 100 mm above the guide."""
    done = run("check", with_workspace("triglide", f"box: {{x: [300, 420], y: {box}}}"))
    place = re.search(r"not held in part of the workspace, e.g. at x = ([\d.]+) mm, y = ([\d.]+) mm", done.err)
    assert done.code == 0 and (place is not None) is lost
    if place is not None:
        assert 300 <= float(place[1]) <= 420 and 60 <= float(place[2]) < 105  # from where it is hardly held


def test_poses_spread_over_drives_are_on_the_branch_of_the_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    """Closed form of the independent simulator; redundant drives follow from the pose, and are not asked before."""
    monkeypatch.setattr(rigid_pose, "common_pose", lambda *_: pytest.fail("what redundant drives read plays no part"))
    loaded, whole = load_machine(str(MACHINES / "triglide.yaml")), np.full(6, np.inf)
    travel = np.array([[-0.3, 0.5], [0.3, 1.1], [0.6, 1.4]])
    poses, _ = workspace_poses(loaded, Workspace(-whole, whole, None, travel), 40, Record())
    readings = poses.rows.readings
    place = truth("triglide").forward(readings).tcp[:, :2]
    assert len(readings) == 40 and np.ptp(readings[:, :2], axis=0).min() > 0.5
    assert np.allclose(truth("triglide").inverse(place), readings, atol=1e-9)
