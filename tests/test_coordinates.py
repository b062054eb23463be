"""Coordinates of the tool point: any independent set of them is held exactly, the others follow."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.base.rotation import exp
from pkmcal_cli.model.tool_channels import tcp_model
from pkmcal_cli.prediction import Rows, predict
from pkmcal_cli.prediction.inverse_kinematics import drive_positions
from tests.command import TRIGLIDE, column, run
from tests.support import model, poses_of, truth
from tests.tool_machines import CRANK, GIMBAL, HEAD, ROCKER, drawn_head_poses, head_poses


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("head.yaml").write_text(HEAD)
    Path("crank.yaml").write_text(CRANK)


def test_a_head_is_moved_in_its_own_coordinates_and_the_others_follow() -> None:
    """z, rx, ry up to 20 deg; parasitic x, y of some cm by the constraints of the legs (and rz 0, known of 3-PRS)."""
    poses, drives = drawn_head_poses()
    given = poses.copy()
    given[:, [0, 1, 5]] = np.nan
    found = drive_positions(model(HEAD), given, held=("z", "rx", "ry"))
    assert found.reached.all()
    assert np.abs(found.readings - drives).max() < 1e-12
    assert np.abs(found.poses - poses).max() < 1e-12
    assert np.abs(poses[:, 0]).max() > 0.01 and np.abs(poses[:, 1]).max() > 0.01  # there is something to follow


def test_every_independent_set_of_a_head_gives_the_same_drives() -> None:
    """Whatever is held: the drives of a pose are the same, and refused sets are those whose motions depend."""
    machine, (poses, drives) = model(HEAD), drawn_head_poses(6)
    motion = machine.tool_motion
    assert set(motion.sets) == {("x", "y", "z"), ("x", "z", "rx"), ("y", "z", "ry"), ("z", "rx", "ry")}
    for held in motion.sets:
        found = drive_positions(machine, poses, held=held)
        assert found.reached.all(), held
        assert np.abs(found.readings - drives).max() < 1e-10, held


def test_independent_sets_are_those_whose_determinant_is_not_zero() -> None:
    """Of the four-bar linkage any coordinate, of the crank those by the closed form's Jacobian."""
    a = np.radians(30)
    by_drives = np.array([[1, -0.2 * np.sin(a) - 0.04 * np.cos(a)], [0, 0.2 * np.cos(a) - 0.04 * np.sin(a)], [0, 1.0]])
    motion = model(CRANK).tool_motion
    for pair in combinations(range(3), 2):
        names = tuple(motion.names[k] for k in pair)
        assert motion.independent(names) == (abs(np.linalg.det(by_drives[list(pair)])) > 1e-9)
    assert model(ROCKER).tool_motion.sets == (("x",), ("rz",), ("y",))  # y hardly moves


def test_the_coordinates_of_a_crank_on_a_carriage() -> None:
    """Place across and angle, also over whole turns, against the closed form."""
    done = run("simulate", "crank.yaml", "--grid", "x=-100:300:3,rz=-200:200:9", "-o", "out.csv")
    assert done.code == 0 and "note: tool point: tip, of sensor camera" in done.err
    x, a = column("out.csv", "x"), np.radians(column("out.csv", "a"))
    assert np.allclose(x, np.repeat([-100, 100, 300], 9), atol=1e-9)
    turned = np.radians(np.tile(np.linspace(-200, 200, 9), 3) + 30)
    assert np.allclose(np.exp(1j * a), np.exp(1j * turned), atol=1e-12)
    assert np.allclose(column("out.csv", "q"), x - 200 * np.cos(turned) + 40 * np.sin(turned), atol=1e-9)
    assert np.allclose(column("out.csv", "y"), 200 * np.sin(turned) + 40 * np.cos(turned), atol=1e-9)


def test_a_machine_with_one_degree_of_freedom() -> None:
    """The rocker's angle is held; the crank's follows from the closure of the loop."""
    Path("rocker.yaml").write_text(ROCKER)
    home = run("simulate", "rocker.yaml", "--grid", "rz=0:0:1", "--forces", "-o", "home.csv")
    assert home.code == 0, home.err
    done = run("simulate", "rocker.yaml", "--grid", "rz=-20:25:10", "-o", "out.csv")
    assert done.code == 0 and "10 rows simulated" in done.err, done.err
    crank = np.radians(column("out.csv", "q"))
    angle = np.radians(95 + np.linspace(-20, 25, 10))
    ends = 100 * np.exp(1j * crank), 240 + 180 * np.exp(1j * angle)
    assert np.allclose(np.abs(ends[0] - ends[1]), 250, atol=1e-9)
    assert run("simulate", "rocker.yaml", "--grid", "y=90:100:3").code == 0
    refused = run("simulate", "rocker.yaml", "--grid", "x=0:1:2,y=0:1:2")
    assert refused.code == 2 and "2 coordinates (x, y), but the mechanism has 1 degree of freedom" in refused.err
    assert "use `x` or `rz` or `y`" in refused.err


@pytest.mark.parametrize("name", ["hexapod7", "delta4", "scissors"])
def test_whole_poses_of_shipped_machines_are_as_before(name: str) -> None:
    poses = poses_of(name, 8)
    given = np.full((8, 6), np.nan)
    given[:, : poses.shape[1]] = poses
    found = drive_positions(model(name), given)
    assert np.abs(found.readings - truth(name).inverse(poses)).max() < 1e-10  # type: ignore[attr-defined]


def test_large_turns_in_space_are_held_to_the_last_digit() -> None:
    """A body on three crossed hinges: rotation vectors up to 126 deg, and turns of more than half a revolution."""
    machine = model(GIMBAL)
    rng = np.random.default_rng(3)
    way = rng.normal(size=(12, 3))
    vectors = way / np.linalg.norm(way, axis=1, keepdims=True) * np.linspace(0.1, 2.2, 12)[:, None]
    poses = np.full((12, 6), np.nan)
    poses[:, 3:] = vectors
    found = drive_positions(machine, poses, held=("rx", "ry", "rz"))
    assert found.reached.all()
    assert np.abs(found.poses[:, 3:] - vectors).max() < 1e-12
    far = np.full((9, 6), np.nan)
    far[:, 3:] = np.array([0, 0, 1]) * np.radians(np.linspace(-260, 260, 9))[:, None]
    turned = drive_positions(machine, far, held=("rx", "ry", "rz"))
    assert turned.reached.all()
    assert np.abs(exp(turned.poses[:, 3:]) - exp(far[:, 3:])).max() < 1e-12


@pytest.mark.parametrize(
    ("machine", "grid", "told", "sets"),
    [
        ("head", "rz=0:1:2", "no degree of freedom moves `rz` of tool point `tool`", "`z, rx, ry`"),
        ("head", "x=0:1:2,ry=0:1:2", "`x`, `ry` of tool point `tool` do not move independently", "`x, z, rx`"),
        ("head", "x=0:1:2,y=0:1:2,z=5:6:2,rx=0:1:2", "4 coordinates (x, y, z, rx), but", "`x, y, z`"),
        ("crank", "y=0:1:2,rz=0:1:2", "`y`, `rz` of tool point `tip` do not move independently", "`x, y` or `x, rz`"),
        ("crank", "x=0:1:2,y=0:1:2,rz=0:1:2", "the mechanism has 2 degrees of freedom", "`x, y` or `x, rz`"),
    ],
)
def test_sets_that_are_not_independent_are_refused_with_those_that_are(
    machine: str, grid: str, told: str, sets: str
) -> None:
    for command in ("simulate", "sensitivity", "observability", "plan"):
        done = run(command, f"{machine}.yaml", "--grid", grid)
        assert done.code == 2 and told in done.err and sets in done.err.splitlines()[-1]


def test_a_part_of_a_set_keeps_the_rest_as_in_the_reference_configuration_and_it_is_said() -> None:
    """Who tilts a head keeps its other tilt and its height, not where its tip goes."""
    done = run("simulate", "head.yaml", "--grid", "rx=-10:10:3", "-o", "out.csv")
    assert "note: `z`, `ry` kept as in the reference configuration" in done.err
    assert np.abs(column("out.csv", "ry")).max() < 1e-9 and np.ptp(column("out.csv", "z")) < 1e-9
    done = run("simulate", TRIGLIDE, "--grid", "x=300:400:2", "-o", "plain.csv")
    assert "note: `y` kept as in the reference configuration" in done.err


def test_a_table_of_poses_in_any_coordinates_says_how_far_the_others_are() -> None:
    """All six coordinates of a pose; and a turn of 5 deg that the head does not have there."""
    poses, drives = head_poses(np.array([0.6]), np.array([0.1]), np.array([0.2]))
    cells = [float(c) for c in (*poses[0, :3] * 1e3, *np.degrees(poses[0, 3:]))]
    Path("six.csv").write_text("x,y,z,rx,ry,rz\n" + ",".join(map(repr, cells)) + "\n")
    done = run("simulate", "head.yaml", "six.csv", "-o", "out.csv")
    assert [column("out.csv", f"q{k}")[0] for k in (1, 2, 3)] == pytest.approx(drives[0] * 1e3, abs=1e-8)
    assert "not used: `rz`, which the mechanism does not move independently" in done.err
    assert "from the value that follows" not in done.err
    Path("turned.csv").write_text(f"z,rx,ry,rz\n600,{cells[3]!r},{cells[4]!r},5\n")
    done = run("simulate", "head.yaml", "turned.csv", "-o", "out.csv", "--force")
    assert "not used: `rz`" in done.err and "the table differs by up to 5 deg from the value that follows" in done.err
    assert [column("out.csv", f"q{k}")[0] for k in (1, 2, 3)] == pytest.approx(drives[0] * 1e3, abs=1e-8)


def test_drive_readings_are_those_of_the_forward_model() -> None:
    """The coordinates that follow are what the solved machine has there."""
    machine = model(HEAD)
    given = np.full((3, 6), np.nan)
    given[:, 2:5] = [[0.55, 0.1, -0.2], [0.6, -0.3, 0.0], [0.65, 0.2, 0.3]]
    found = drive_positions(machine, given, held=("z", "rx", "ry"))
    solved = predict(tcp_model(machine), machine.nominal, Rows.at(found.readings))
    assert np.abs(solved.values - found.poses).max() < 1e-12
