"""`pkmcal correct`: what goes in, what comes out, what is said, and that `simulate` returns the targets."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from pkmcal_cli.correction.strained_pose import LoadedTool
from pkmcal_cli.loading.load_machine import load_machine
from pkmcal_cli.prediction import Rows
from tests.command import MACHINES, SCISSORS, SHOPFLOOR, TRIGLIDE, TRIGLIDE_DATA, column, run, table

BIGLIDE = str(MACHINES / "biglide.yaml")
GRID = "x=250:450:3,y=220:320:3"


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def calibrated(machine: str = BIGLIDE, data: str = str(MACHINES / "biglide.csv")) -> str:
    assert run("calibrate", machine, data, "-q", "--holdout", "none", "-o", "p.yaml", "--force").code == 0
    return "p.yaml"


def returned(machine: str, parameters: str, *coordinates: str) -> None:
    """`simulate` of the commands reads the targets."""
    done = run("simulate", machine, "c.csv", "-p", parameters, "-o", "s.csv", "--force")
    assert done.code == 0, done.err
    for name in coordinates:
        assert column("s.csv", name) == pytest.approx(column("c.csv", f"target.{name}"), abs=1e-9)


@pytest.mark.parametrize("choice", ["min-force", "min-energy", "preload", "nominal"])
def test_simulate_returns_the_targets(choice: str) -> None:
    p = calibrated()
    done = run("correct", BIGLIDE, "--grid", GRID, "-p", p, "--redundant", choice, "-o", "c.csv")
    assert done.code == 0 and "9 of 9 targets corrected" in done.err
    assert abs(column("c.csv", "before.x")).max() > 10  # um
    assert abs(column("c.csv", "after.x")).max() < 1e-6
    returned(BIGLIDE, p, "x", "y")


@pytest.mark.parametrize(
    ("name", "grid", "coordinates"),
    [
        ("hexapod7", "x=-40:40:2,y=-40:40:2,rx=-0.1:0.1:2", "x y z rx ry rz"),
        ("gantry", "x=300:1100:3,y=400:1200:2", "x y"),
        ("delta4", "x=-60:60:2,y=-60:60:2,z=-500:-400:2", "x y z"),
        ("five-bar", "x=50:200:3,y=300:450:3", ""),
        ("belt-router", "x=1000:2000:3,y=700:1300:2", ""),
    ],
)
def test_shipped_machines_return_their_targets(name: str, grid: str, coordinates: str) -> None:
    """Of machines without a tracker the errors of the table say the same."""
    machine, model = (
        str(MACHINES / f"{name}.yaml"),
        yaml.safe_load(run("check", str(MACHINES / f"{name}.yaml"), "--json").out),
    )
    off = {p["name"]: f"{p['nominal'] + 0.3 * p['range']} {p['unit']}" for p in model.get("parameters", [])[:5]}
    Path("p.yaml").write_text(yaml.safe_dump({"parameters": {k: v.replace(" 1", "") for k, v in off.items()}}))
    done = run("correct", machine, "--grid", grid, "-p", "p.yaml", "-o", "c.csv", "--json")
    assert done.code == 0, done.err
    assert done.json["errors"]["position"]["after"]["max"] < 1e-5  # um
    returned(machine, "p.yaml", *coordinates.split())


def test_effects_act_at_stated_circumstances_and_sides() -> None:
    """Temperature and backlash: warm commands differ from cold ones, commands from both sides by the backlash."""
    text = f"extends: {SCISSORS}\neffects:\n  thermal_strut@all: {{a: 9 um/(m*K)}}\n  backlash@q3: {{b: 12 um}}\n"
    Path("m.yaml").write_text(text)
    rows = "x,y,dir.q1,dir.q2,dir.q3,dir.q4\n" + "".join(f"50,50,1,1,{d},1\n" for d in (1, -1))
    Path("t.csv").write_text(rows)
    q3, q1 = {}, {}
    for t in ("17", "23 degC"):
        assert run("correct", "m.yaml", "t.csv", "--at", f"T={t}", "-o", "c.csv", "--force").code == 0
        returned("m.yaml", "n.yaml" if Path("n.yaml").exists() else _nothing(), "x", "y")
        q3[t], q1[t] = column("c.csv", "q3"), column("c.csv", "q1")
        assert q3[t][0] - q3[t][1] == pytest.approx(0.012, abs=1e-6) and q1[t][0] == pytest.approx(q1[t][1], abs=1e-9)
    assert abs(q1["17"] - q1["23 degC"]).min() > 0.02


def _nothing() -> str:
    Path("n.yaml").write_text("parameters: {}\n")
    return "n.yaml"


def test_sides_follow_the_commands_themselves() -> None:
    """Without columns of sides the order of the commands decides, as `simulate` derives it from the same table."""
    Path("m.yaml").write_text(f"extends: {SCISSORS}\neffects:\n  backlash@q3: {{b: 12 um}}\n")
    Path("p.yaml").write_text("parameters: {l3: 949.95}\n")
    assert run("correct", "m.yaml", "--grid", "x=-100:100:5,y=-100:100:5", "-p", "p.yaml", "-o", "c.csv").code == 0
    lines = [line for line in Path("c.csv").read_text().splitlines() if not line.startswith("#")]
    head = lines[0].split(",")
    kept = [k for k, name in enumerate(head) if not name.startswith("dir.")]
    Path("d.csv").write_text("\n".join(",".join(line.split(",")[k] for k in kept) for line in lines) + "\n")
    for name in ("c.csv", "d.csv"):
        assert run("simulate", "m.yaml", name, "-p", "p.yaml", "-o", "s.csv", "--force").code == 0
        assert column("s.csv", "x") == pytest.approx(column("c.csv", "target.x"), abs=1e-9)
    assert set(column("c.csv", "dir.q3")) >= {-1.0, 1.0}


def test_how_sure_a_circumstance_is_enters() -> None:
    """9 um/(m K) on rods of 950 mm: 1 K of doubt is some micrometres at the tool point."""
    Path("m.yaml").write_text(f"extends: {SCISSORS}\neffects: {{thermal_strut@all: {{a: 9 um/(m*K)}}}}\n")
    assert run("calibrate", "m.yaml", SHOPFLOOR, "-q", "--holdout", "none", "-o", "p.yaml").code == 0
    u = []
    for t in ("T=23", "T=23 +- 1", "T=23 +- 2 K"):
        assert (
            run(
                "correct",
                "m.yaml",
                "--grid",
                "x=100:100:1,y=150:150:1",
                "-p",
                "p.yaml",
                "--at",
                t,
                "-o",
                "c.csv",
                "--force",
            ).code
            == 0
        )
        u.append(column("c.csv", "u.y")[0])
    one, two = (np.sqrt(v**2 - u[0] ** 2) for v in u[1:])
    assert 1.0 < one < 20.0 and two == pytest.approx(2 * one, rel=1e-4)


def test_what_is_missing_is_said_and_counted() -> None:
    """The shop floor's effects are not declared: the calibration leaves 12 times the noise."""
    p = calibrated(SCISSORS, SHOPFLOOR)
    done = run("correct", SCISSORS, "--grid", "x=-100:100:3,y=-100:100:3", "-p", p, "-o", "c.csv", "--json")
    assert "warning: something is missing: the calibration left 12 times the noise" in done.err
    assert done.json["times_noise"] > 10 and done.json["unexplained"]["position"]["std"] > 3
    assert done.json["errors"]["position"]["u"]["rms"] > 5


def test_targets_outside_of_what_was_measured_are_told() -> None:
    p = calibrated(SCISSORS, SHOPFLOOR)
    seen = yaml.safe_load(Path(p).read_text())["measured"]
    q = column(SHOPFLOOR, "q1")
    assert (seen["q1"]["low"], seen["q1"]["high"]) == pytest.approx((q.min(), q.max()))
    done = run("correct", SCISSORS, "--grid", "x=0:0:1,y=0:320:2", "-p", p, "-o", "c.csv", "--json")
    assert done.json["outside"]["q1"] == 1 and "warning: outside the measured range of q1: 1 of 2 targets" in done.err
    beyond = done.json["outside_values"]["q1"]
    assert beyond["high"] == seen["q1"]["high"] and f"farthest {beyond['value']:.6g} mm" in done.err
    assert table("c.csv").texts["remarks"][0] == "" and "q1" in table("c.csv").texts["remarks"][1]


def test_a_weak_direction_is_told() -> None:
    """A stiffness that nobody identified, known to a tenth, decides where a load moves the tool point."""
    Path("m.yaml").write_text(f"extends: {BIGLIDE}\nloads: {{push: {{at: tcp, force: [0, -2000 N]}}}}\n")
    p = calibrated("m.yaml")
    done = run("correct", "m.yaml", "--grid", GRID, "-p", p, "-o", "c.csv", "--json")
    assert done.json["weak"] > 0 and "rest on a weak direction" in done.err
    assert "rests on a weak direction" in table("c.csv").texts["remarks"]


def test_forces_and_energy_fall() -> None:
    p = calibrated()
    done = run("correct", BIGLIDE, "--grid", GRID, "-p", p, "-o", "c.csv", "--json")
    for drive in done.json["drives"]:
        assert drive["before"] > 100 and drive["after"] < 1e-3 and drive["u"] > 10 and drive["unit"] == "N"
    assert done.json["strain_energy"]["after"] < 1e-6 * done.json["strain_energy"]["before"]


def test_nominal_keeps_the_redundant_set_values_and_preload_the_internal_force() -> None:
    p = calibrated()
    assert run("simulate", BIGLIDE, "--grid", GRID, "--forces", "-o", "n.csv").code == 0
    for choice in ("nominal", "preload"):
        assert run("correct", BIGLIDE, "--grid", GRID, "-p", p, "--redundant", choice, "-o", f"{choice}.csv").code == 0
    assert column("nominal.csv", "q3") == pytest.approx(column("n.csv", "q3"), abs=1e-12)
    assert abs(column("nominal.csv", "force.q3")).max() > 100
    assert column("preload.csv", "internal.q3") == pytest.approx(column("n.csv", "q3.force"), abs=1e-3)


def test_without_parameters_the_nominal_machine_is_meant() -> None:
    done = run("correct", TRIGLIDE, "--grid", "x=300:400:2,y=250:250:1", "-o", "c.csv")
    assert done.code == 0 and "uncertainty: not available" in done.err
    assert abs(column("c.csv", "before.x")).max() < 1e-6
    assert np.isnan(column("c.csv", "u.x")).all()


def test_a_pipe() -> None:
    p = calibrated()
    Path("t.csv").write_text("id,x,y\na,300,250\nb,400,300\n")
    done = run("correct", BIGLIDE, "t.csv", "-p", p, "-q")
    assert done.code == 0 and done.err == ""
    back = run("simulate", BIGLIDE, "-", "-p", p, "-q", stdin=done.out)
    last = [line.split(",") for line in back.out.splitlines() if not line.startswith("#")][1:]
    assert [row[0] for row in last] == ["a", "b"]
    assert [float(v) for row in last for v in row[-2:]] == pytest.approx([300, 250, 400, 300], abs=1e-9)


def test_travel_limits_are_kept() -> None:
    """A target that a drive can reach only beyond its limits has no set values, and it is said which limit."""
    Path("m.yaml").write_text(f"extends: {BIGLIDE}\nactuators: {{q1: {{limits: [0, 200]}}}}\n")
    Path("t.csv").write_text("id,x,y\na,300,250\nfar,500,250\n")
    for choice in ("min-force", "nominal"):
        done = run("correct", "m.yaml", "t.csv", "--redundant", choice, "-o", "c.csv", "--force")
        assert done.code == 1 and "t.csv:3 (far): " in done.err and "travel limit of `q1` (" in done.err
        assert "1 of 2 targets corrected" in done.err and column("c.csv", "q1")[0] < 200


def test_a_table_of_poses_with_drives_is_taken_by_its_coordinates() -> None:
    p = calibrated(TRIGLIDE, TRIGLIDE_DATA)
    Path("t.csv").write_text("q1,q2,q3,x,y\n0,0,0,300,250\n")
    done = run("correct", TRIGLIDE, "t.csv", "-p", p, "-o", "c.csv")
    assert done.code == 0 and "the actuator columns are not used" in done.err
    assert column("c.csv", "target.x") == pytest.approx([300])


def test_a_circumstance_that_changes_nothing_is_told() -> None:
    done = run("correct", BIGLIDE, "--grid", GRID, "--at", "T=25", "-o", "c.csv")
    assert done.code == 0 and "--at: `T` changes nothing" in done.err


def test_least_energy_is_not_least_force() -> None:
    """Under a load on legs of unlike stiffness; at the least energy it does not change with the internal force."""
    Path("m.yaml").write_text(f"extends: {BIGLIDE}\nloads: {{push: {{at: tcp, force: [600 N, -1500 N]}}}}\n")
    energies, forces = [], []
    for choice in ("min-force", "min-energy"):
        done = run("correct", "m.yaml", "--grid", GRID, "--redundant", choice, "-o", f"{choice}.csv")
        assert done.code == 0, done.err
        energies.append(column(f"{choice}.csv", "strain_energy_J"))
        forces.append(sum(column(f"{choice}.csv", f"force.q{i}") ** 2 for i in (1, 2, 3)))
    assert (energies[1] < 0.999 * energies[0]).all() and (forces[0] < 0.999 * forces[1]).all()
    tool = LoadedTool(load_machine("m.yaml").model, ("x", "y"))
    rows = Rows.at(1e-3 * np.stack([column("min-energy.csv", f"q{i}") for i in (1, 2, 3)], axis=1))
    found = tool.at(tool.machine.nominal, rows, np.zeros((9, 2)), "readings")
    free = np.linalg.svd(found.by_tool)[2][:, 2]  # (9, 3) the motion of the drives that keeps the tool point
    along = np.einsum("na,na->n", found.by_energy, free)
    assert abs(along).max() < 1e-6 * abs(found.force).max()  # both in N; forces settle to 1e-7


def test_a_correction_that_turns_a_drive_round_is_made_for_its_own_side() -> None:
    """Up and down along y the drive of x stands still by the nominal model; what moves it is squareness alone."""
    Path("m.yaml").write_text(
        "units: {length: mm, angle: deg, force: N}\nspace: planar\nranges: {angle: 0.1}\nparameters: {sq: 0}\n"
        "frames: {head: {body: slide, turn: sq}}\nguides: {cross: {along: x}, column: {frame: head, along: y}}\n"
        "bodies: {slide: {guide: cross, at: 500}, ram: {guide: column, at: 200, points: {tip: [0, 0]}}}\n"
        "actuators: {X: {moves: slide}, Y: {moves: ram}}\ntool_point: tip\neffects: {backlash@X: {b: 40 um}}\n"
    )
    Path("p.yaml").write_text("parameters: {sq: 0.02}\n")
    Path("t.csv").write_text("x,y\n" + "".join(f"500,{y}\n" for y in (100, 200, 300, 250, 150, 50)))
    assert run("correct", "m.yaml", "t.csv", "-p", "p.yaml", "-o", "c.csv").code == 0
    side = np.sign(np.diff(column("c.csv", "X")))
    assert set(side) == {-1, 1} and (column("c.csv", "dir.X")[1:] == side).all()
    assert abs(column("c.csv", "after.x")).max() < 1e-6


def test_what_is_unexplained_of_orientations_is_told_of_orientations() -> None:
    """100 urad beyond noise of an orientation, 20 um of a position: in quadrature with what the parameters make."""
    Path("m.yaml").write_text(
        "units: {length: mm, angle: deg, force: N}\nspace: planar\nranges: {length: 0.1}\nparameters: {r: 200}\n"
        "guides: {rail: {along: x}}\nbodies:\n  slide: {guide: rail, at: 100, points: {P: [0, 0]}}\n"
        "  table: {at: [100, 0], turn: 30, points: {mark: [r, 40]}}\n"
        "joints: {bearing: {between: [P, table], type: revolute}}\nactuators: {q: {moves: slide}, a: {turns: table}}\n"
        "tool_point: mark\n"
    )
    head = "parameters: {r: 200.1}\nmeasured: {q: {low: 0, high: 300, unit: mm}}\n"
    known = "correlations: {names: [r], std: [0.01], matrix: [[1]]}\n"
    Path("a.yaml").write_text(head + known)
    Path("b.yaml").write_text(
        head
        + "unexplained: {times_noise: 3, position: {std: 20, unit: um}, orientation: {std: 100, unit: urad}}\n"
        + known
    )
    for name in "ab":
        done = run("correct", "m.yaml", "--grid", "x=200:300:2,rz=20:40:2", "-p", f"{name}.yaml", "-o", f"{name}.csv")
        assert done.code == 0, done.err
        assert (
            abs(column(f"{name}.csv", "after.rz")).max() < 1e-6 and abs(column(f"{name}.csv", "after.x")).max() < 1e-6
        )
    assert "something is missing: the calibration left 3 times the noise" in done.err
    assert column("b.csv", "u.rz") == pytest.approx(np.hypot(column("a.csv", "u.rz"), 100))
    assert (
        column("b.csv", "u.x") == pytest.approx(np.hypot(column("a.csv", "u.x"), 20)) and column("a.csv", "u.x")[0] > 5
    )
