"""Probes that just touch: the reading is known, what is measured is where the drives stand."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import root_scalar
from scipy.spatial.transform import Rotation

from pkmcal_cli.base.rotation import Array
from tests.command import Done, clean, column, run
from tests.support import truth
from tests.touch_machines import ALONE, DELTA, FLAT, GRID, PLANTED, UM, ok, rows_of, written

pytestmark = pytest.mark.usefixtures("unsized")


def deviation(tips: Array, plane: dict[str, float]) -> Array:
    """Height (N,) of points (N, 3) above a plane."""
    turn = Rotation.from_rotvec([plane["pa"], plane["pb"], 0.0])
    return np.asarray(turn.inv().apply(tips - [0.01, 0.02, plane["pz"]])[:, 2])


def tips(commands: Array) -> Array:
    """Places (N, 3) of the tip of the nominal Delta at commands (N, 4), by a minimum of energy."""
    machine = truth("delta4")
    found = machine.forward(commands, machine.nominal).tcp  # type: ignore[attr-defined]
    turn = Rotation.from_rotvec(found[:, 3:])
    return np.asarray(found[:, :3] + turn.apply(np.array([0.005, 0.006, -0.07])))


@cache
def touched() -> tuple[Array, Array]:
    """Commands (N, 4) at which the Delta touches the true plane but for noise of 8 um, and where its tip is."""
    rng = np.random.default_rng(11)
    commands = []
    for x, y in np.array(np.meshgrid(np.linspace(-0.1, 0.1, 5), np.linspace(-0.1, 0.1, 4))).reshape(2, -1).T:
        trigger = 8 * UM * rng.normal()

        def above(z: float, x: float = x, y: float = y, trigger: float = trigger) -> float:
            command = truth("delta4").inverse(np.array([[x, y, z]]))  # type: ignore[attr-defined]
            return float(deviation(tips(command), PLANTED)[0] - trigger)

        z = root_scalar(above, x0=-0.49, x1=-0.488, xtol=1e-13).root
        commands.append(truth("delta4").inverse(np.array([[x, y, z]]))[0])  # type: ignore[attr-defined]
    return np.array(commands), tips(np.array(commands))


def test_a_plane_by_touches_alone(tmp_path: Path) -> None:
    """Touches of an independent simulator: the plane of a linear regression, with its standard uncertainties."""
    commands, places = touched()
    table = tmp_path / "t.csv"
    lines = [",".join(repr(float(v) * 1e3) for v in row) for row in commands]
    table.write_text("\n".join(["q1 [mm],q2 [mm],q3 [mm],q4 [mm]", *lines]), encoding="utf-8")
    done = ok("calibrate", written(tmp_path, DELTA), table, "--select", "pz,pa,pb", "--json")
    note = "no column `probe`: it touches (reading 0) in all 20 rows; give it, with empty cells, if there are rows"
    assert note in done.err and "no columns for channels" not in done.err
    turn = Rotation.from_rotvec([PLANTED["pa"], PLANTED["pb"], 0.0])
    there = turn.inv().apply(places - [0.01, 0.02, PLANTED["pz"]])
    design = np.column_stack([np.full(len(there), turn.as_matrix()[2, 2]), there[:, 1], -there[:, 0]])
    std = 8 * UM * np.sqrt(np.diag(np.linalg.inv(design.T @ design)))
    estimate = np.linalg.lstsq(design, there[:, 2], rcond=None)[0]
    units = {"mm": 1e-3, "rad": 1.0}
    for p, s, off in zip(done.json["parameters"], std, estimate, strict=True):
        value = p["value"] * units[p["unit"]]
        assert p["std_by_data"] * units[p["unit"]] == pytest.approx(s, rel=0.25), p["name"]  # 10 and 17 degrees
        assert value - PLANTED[p["name"]] == pytest.approx(off, abs=0.05 * s), p["name"]
    assert done.json["heldout"]["kind"] == "touch" and done.json["after"]["touch"]["count"] == 20


@pytest.mark.parametrize("noise", ["none", "declared"])
def test_simulate_writes_commands_at_which_it_touches(noise: str, tmp_path: Path) -> None:
    """At them the tip of an independent simulator is on the true plane, but for the noise at which it triggers."""
    machine, planted, table = written(tmp_path, DELTA), tmp_path / "p.yaml", tmp_path / "t.csv"
    planted.write_text("parameters: {pz: -558.8, pa: 0.0226, pb: -0.0275}\n")
    grid = ("--grid", "x=-80:80:6,y=-80:80:6,z=-500:-420:3")
    done = ok("simulate", machine, *grid, "-p", planted, "--noise", noise, "-o", table)
    assert "108 of 108 poses are moved to where `probe` touches" in done.err
    assert (column(table, "probe") == 0).all()
    commands = np.column_stack([column(table, f"q{k}") for k in range(1, 5)]) * 1e-3
    places = tips(commands)
    off = deviation(places, PLANTED)
    if noise == "none":
        assert np.abs(off).max() < 1e-9
        across = places - np.array(list(np.ndindex(6, 6, 3))) * [0.032, 0.032, 0.04] - [-0.08, -0.08, -0.5]
        across -= [0.005, 0.006, -0.07]  # the tip from the platform, which has the grid's coordinates
        normal = Rotation.from_rotvec([PLANTED["pa"], PLANTED["pb"], 0.0]).as_matrix()[:, 2]
        across -= np.outer(across @ normal, normal)
        assert np.abs(across).max() < 2e-5  # the machine sags by some um; the way to the plane is up to 140 mm
    else:
        assert off.std() == pytest.approx(8 * UM, rel=0.2) and abs(off.mean()) < 3 * UM
        again = tmp_path / "again.csv"
        ok("simulate", machine, *grid, "-p", planted, "--noise", noise, "-o", again)
        assert rows_of(again) == rows_of(table)


def test_simulated_touches_are_calibrated(tmp_path: Path) -> None:
    """With the column and without it alike; drives with errors of their own."""
    text = ALONE + "actuators: {q1: {sigma: 30 um}, q2: {sigma: 30 um}}\n"
    machine, planted, table = written(tmp_path, text), tmp_path / "p.yaml", tmp_path / "t.csv"
    planted.write_text("parameters: {h: 150.7, t: 0.052}\n")
    ok("simulate", machine, *GRID, "-p", planted, "--noise", "declared", "--seed", "3", "-o", table)
    results = [ok("calibrate", machine, table, "--select", "h,t", "--json").json]
    bare = tmp_path / "bare.csv"
    bare.write_text("\n".join(",".join(line.split(",")[:3]) for line in rows_of(table)))
    results.append(ok("calibrate", machine, bare, "--select", "h,t", "--json").json)
    assert results[0]["parameters"] == results[1]["parameters"]
    for p, true in zip(results[0]["parameters"], (150.7, 0.052), strict=True):
        assert abs(p["value"] - true) < 4 * p["std"]
    assert 0.4 < results[0]["chi2_per_dof"] < 2


def table(folder: Path, name: str, header: str, *rows: str) -> Path:
    file = folder / f"{name}.csv"
    file.write_text("\n".join([header, *rows]), encoding="utf-8")
    return file


def counts(done: Done) -> dict[str, int]:
    return {kind: figures["count"] for kind, figures in done.json["after"].items()}


TRACKED = [f"{116.33 + k},{603.67 - 2 * k},{360 - 0.5 * k},275" for k in range(6)]
"""Positions of the drives and roughly of the point."""
DRIVES = [",".join(row.split(",")[:2]) for row in TRACKED]


def test_which_rows_touch(tmp_path: Path) -> None:
    """By its column; else in tables that no other instrument that sees the tool has a column in."""
    machine = written(tmp_path, FLAT.replace("h: {nominal: 150", "h: {nominal: 255"))
    tracker = table(tmp_path, "tracker", "q1,q2,tracker.x,tracker.y", *TRACKED)
    bed = table(tmp_path, "bed", "q1,q2", *DRIVES)
    options = ("--select", "h,t", "--holdout", "none", "--starts", "1", "--json")
    assert counts(ok("calibrate", machine, bed, *options)) == {"touch": 6}
    assert counts(ok("calibrate", machine, bed, tracker, *options, "--accept")) == {"position": 6, "touch": 6}
    some = [f"{row},{'' if k % 2 else 0}" for k, row in enumerate(TRACKED)]
    both = table(tmp_path, "both", "q1,q2,tracker.x,tracker.y,probe", *some)
    assert counts(ok("calibrate", machine, both, *options, "--accept")) == {"position": 6, "touch": 3}
    marked = table(tmp_path, "marked", "q1,q2,probe [um]", *(f"{row},{k}" for k, row in enumerate(DRIVES)))
    read = ok("calibrate", machine, marked, *options, "--accept")
    assert counts(read) == {"touch": 6} and "no column `probe`" not in read.err
    alone = ok("calibrate", machine, tracker, "--select", "l1", "--holdout", "none", "--starts", "1", "--accept")
    assert "sensor `probe` has no reading in any table" in alone.err
    typed = table(tmp_path, "typed", "q1,q2,traker.x,tracker.y", *TRACKED)
    assert "did you mean `tracker.x`" in ok("calibrate", machine, typed, code=3).err


def test_two_probes_need_columns(tmp_path: Path) -> None:
    """One of them may be without where the other has one: then it did not touch."""
    wall = "  wall: {kind: touch, at: tcp, surface: side, reading: 0, sigma: 5 um}\n"
    side = ALONE.replace("frames: {", "frames: {side: {at: [300, 0], turn: -90}, ")
    machine = written(tmp_path, side + wall)
    bed = table(tmp_path, "bed", "q1,q2", *DRIVES)
    refused = ok("calibrate", machine, bed, code=3)
    assert "nothing says which of `probe`, `wall` touches in a row" in refused.err
    assert "add a column for each" in refused.err
    grid = ok("simulate", machine, *GRID, code=2)
    assert "--grid: nothing says which of `probe`, `wall` touches" in grid.err and "table of poses" in grid.err
    poses = table(tmp_path, "poses", "x,y,probe,wall", "300,200,0,", "350,200,0,", "300,250,,0", "300,300,0,0")
    made = tmp_path / "made.csv"
    ok("simulate", machine, poses, "-o", made)
    cells = [line.split(",")[3:] for line in rows_of(made)[1:]]
    assert cells == [["0.0", ""], ["0.0", ""], ["", "0.0"], ["0.0", "0.0"]]
    done = ok("calibrate", machine, made, "--select", "h,t", "--holdout", "none", "--json")
    assert counts(done) == {"touch": 5} and done.json["after"]["touch"]["max"] < 1e-9
    one = table(tmp_path, "one", "q1,q2,wall", *(f"{row}," if k else f"{row},0" for k, row in enumerate(DRIVES)))
    options = ("--select", "l1", "--holdout", "none", "--json", "--accept")
    assert counts(ok("calibrate", machine, one, *options)) == {"touch": 1}


def test_a_grid_of_other_instruments_is_not_flattened(tmp_path: Path) -> None:
    """With a tracker the grid is the tracker's; a table of poses with a column of the probe says where it touches."""
    machine, made = written(tmp_path, FLAT), tmp_path / "made.csv"
    ok("simulate", machine, *GRID, "-o", made)
    assert np.isnan(column(made, "probe")).all() and np.ptp(column(made, "tracker.y")) > 139
    poses = table(tmp_path, "poses", "x,y,probe", "300,200,0", "350,250,")
    ok("simulate", machine, poses, "-o", made, "--force")
    heights = (column(made, "tracker.y") - 150) * np.cos(0.05) - column(made, "tracker.x") * np.sin(0.05)
    assert heights[0] == pytest.approx(0, abs=1e-6) and heights[1] > 50
    seen = ok("observability", machine, poses, "--select", "h")
    assert "1 of 2 poses are moved to where `probe` touches" in seen.err


@pytest.mark.slow
def test_what_a_plan_of_touches_determines(tmp_path: Path) -> None:
    """Nine poses on a line: the uncertainties of a regression at the touched points, wherever the grid is."""
    machine = written(tmp_path, ALONE)
    grid = ("--grid", "x=250:650:9,y=300:300:1")
    found = ok("observability", machine, *grid, "--select", "h,t", "--json").json["parameters"]
    turn = np.array([[np.cos(0.05), -np.sin(0.05)], [np.sin(0.05), np.cos(0.05)]])
    along = (np.column_stack([np.linspace(0.25, 0.65, 9), np.full(9, 0.15)]) @ turn)[:, 0]
    design = np.column_stack([np.full(9, np.cos(0.05)), along])
    std = 5 * UM * np.sqrt(np.diag(np.linalg.inv(design.T @ design)))
    assert [p["std"] * (1e-3 if p["name"] == "h" else 1) for p in found] == pytest.approx(std, rel=1e-6)
    plan = tmp_path / "plan.csv"
    ok("plan", machine, *grid, "--aim", "h", "--select", "h,t", "-o", plan)
    check = tmp_path / "check.yaml"
    check.write_text(f"extends: {machine}\nsensors: {{probe: {{reading: null}}}}\n")
    ok("simulate", check, plan, "-o", tmp_path / "s.csv")
    assert len(column(tmp_path / "s.csv", "probe")) > 9
    assert np.abs(column(tmp_path / "s.csv", "probe")).max() < 1e-5  # mm: the table has nine digits


def test_repeated_touches_tell_the_noise_and_are_no_copies(tmp_path: Path) -> None:
    """Commands of coarse encoders repeat to the last digit; the scatter of fine ones is the noise of the probe."""
    machine, made = written(tmp_path, ALONE), tmp_path / "made.csv"
    poses = table(tmp_path, "poses", "x,y", *(f"{300 + 50 * (k % 5)},200" for k in range(40)))
    ok("simulate", machine, poses, "--noise", "declared", "-o", made)
    done = ok("calibrate", machine, made, "--select", "h,t", "--json")
    (noise,) = done.json["replicates"]
    assert noise["channel"] == "probe" and noise["degrees_of_freedom"] == 35 and noise["p_value"] > 0.01
    assert noise["std"] == pytest.approx(5e-3, rel=0.4)
    both = written(tmp_path, FLAT.replace("h: {nominal: 150", "h: {nominal: 255"), "both")
    tracked = [f"{row}.{k}23{k},0" for k, row in enumerate(TRACKED)]
    touches = [f"{row},,,0" for row in DRIVES]
    same = table(tmp_path, "same", "q1,q2,tracker.x,tracker.y,probe", *tracked, *touches, *touches)
    options = ("--select", "h", "--holdout", "none", "--json", "--accept")
    assert counts(ok("calibrate", both, same, *options))["touch"] == 18


def test_diagnosis_of_touches(tmp_path: Path) -> None:
    """A bed that drifts down by 60 um is found; without it nothing is."""
    machine, faulty = written(tmp_path, ALONE), written(tmp_path, "", "faulty")
    faulty.write_text(f"extends: {machine}\neffects: {{drift@probe: {{y1: 30 um}}}}\n")
    rng = np.random.default_rng(2)
    xs = rng.permutation(np.linspace(240, 680, 60))
    warm = 20 + np.cumsum(rng.normal(0, 0.1, 60))
    rows = [f"{60 * k},{warm[k]:.3f},{x},200" for k, x in enumerate(xs)]
    poses = table(tmp_path, "poses", "time [s],T [degC],x [mm],y [mm]", *rows)
    verdicts = []
    for source in (machine, faulty):
        made = tmp_path / "made.csv"
        ok("simulate", source, poses, "--noise", "declared", "--seed", "4", "-o", made, "--force")
        done = clean(run("diagnose", machine, made, "--select", "h,t", "--json", "-q"))
        verdicts.append((done.json["verdict"], [f"{e['effect']}@{e['at']}" for e in done.json["effects"]]))
    assert verdicts == [("clean", []), ("ambiguous", ["drift@probe"])]
    rivals = done.json["effects"][0]["credible_set"]
    assert {f"{e['effect']}@{e['at']}" for e in rivals} == {"drift@probe", "zero_drift@q1", "zero_drift@q2"}
    assert rivals[0]["effect"] == "drift" and rivals[0]["weight"] > 0.7


def test_a_plane_out_of_reach(tmp_path: Path) -> None:
    machine = written(tmp_path, ALONE.replace("h: {nominal: 150", "h: {nominal: -3000"))
    why, rows = "`probe` cannot be brought to touch from this pose", table(tmp_path, "poses", "x,y", "300,200")
    for command in ("simulate", "observability", "plan"):
        assert f"none of 27 grid points can be used: {why} (27)" in ok(command, machine, *GRID, code=3).err
        assert why in ok(command, machine, rows, code=1 if command == "simulate" else 3).err
