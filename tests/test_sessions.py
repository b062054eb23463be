"""Zeros of drives that every session has for itself: encoders without an index."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.errors_before_after import length_residuals
from pkmcal_cli.calibration.measured_problem import problem_of
from pkmcal_cli.compiler import compile_machine
from pkmcal_cli.language.machine_yaml import read_machine
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction.inverse_kinematics import drive_positions
from pkmcal_cli.tables.measurements import read_measurements
from tests.command import MACHINES, column, run
from tests.support import poses_of, truth

SIGMA = 1e-6
ZEROS = {"mon": (3e-3, -4e-3, 1.5e-3), "tue": (-5e-3, 2e-3, -2.5e-3), "wed": (0.5e-3, 4.5e-3, 4e-3)}
TRIGLIDE = f"""
extends: {MACHINES / "triglide.yaml"}
parameters: {{"z{{i}}": {{each: {{i: [1, 2, 3]}}, nominal: 0, range: 5, per: session}}}}
actuators: {{q1: {{zero: z1}}, q2: {{zero: z2}}, q3: {{zero: z3}}}}
sensors: {{tracker: {{sigma: 1 um}}}}
"""


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("m.yaml").write_text(TRIGLIDE)


def measured(seed: int = 0, rows: int = 20) -> Array:
    """Tables of each session, written as NAME.csv: readings are positions less the session's zeros (the simulator knows
    positions only), the point measured to 1 um. Returns all positions (3 * rows, 3) of the drives, m.
    """
    simulator, rng, every = truth("triglide"), np.random.default_rng(seed), []
    for k, (name, zeros) in enumerate(ZEROS.items()):
        commanded = simulator.inverse(poses_of("triglide", rows, seed=10 * seed + k))  # type: ignore[attr-defined]
        readings = np.round(commanded[:, :3], 9)
        positions = readings + zeros
        positions[:, 2] = simulator.inverse(simulator.forward(positions).tcp[:, :2])[:, 2]  # type: ignore[attr-defined]
        readings[:, 2] = positions[:, 2] - zeros[2]  # the redundant drive goes along, so that nothing breaks
        place = simulator.forward(positions).tcp[:, :2] + rng.normal(0, SIGMA, (rows, 2))  # type: ignore[attr-defined]
        table = np.column_stack([readings, place]) * 1e3
        np.savetxt(f"{name}.csv", table, "%.12f", ",", header="q1 [mm],q2 [mm],q3 [mm],x [mm],y [mm]", comments="")
        every.append(positions)
    return np.concatenate(every)


def test_zeros_of_every_session_are_found() -> None:
    """Against planted ones within four standard uncertainties, of a few um; one zero for all explains nothing."""
    measured()
    files = [f"{name}.csv" for name in ZEROS]
    done = run("calibrate", "m.yaml", *files, "--select", "z*", "--json", "--holdout", "none")
    assert done.code == 0 and done.json["chi2_per_dof"] == pytest.approx(1, abs=0.3)
    found = {p["name"]: p for p in done.json["parameters"]}
    assert set(found) == {f"z{k}[{name}]" for name in ZEROS for k in (1, 2, 3)}
    for name, zeros in ZEROS.items():
        for k, zero in enumerate(zeros, start=1):
            entry = found[f"z{k}[{name}]"]
            assert abs(entry["value"] - 1e3 * zero) < 4 * entry["std_by_data"] < 0.01
    Path("one.yaml").write_text(TRIGLIDE.replace(", per: session", ""))
    common = run("calibrate", "one.yaml", *files, "--select", "z*", "--starts", "1", "--json", "--holdout", "none").json
    assert common["after"]["position"]["rms"] > 1


def test_a_held_out_session_has_its_zeros_fitted_to_its_own_rows_and_that_is_said() -> None:
    """Else its rows would be off by millimetres."""
    measured()
    files = [f"{name}.csv" for name in ZEROS]
    done = run("calibrate", "m.yaml", *files, "--select", "auto,z*", "--json", "--holdout", "session")
    held = done.json["heldout"]
    assert held["after"]["position"]["rms"] < 3e-3 and held["unit"] == "mm"
    for name in ZEROS:
        for k in (1, 2, 3):
            assert f"z{k}[{name}]" in held["scheme"]
    assert held["scheme"].endswith("fitted to the held-out rows")
    assert "fitted to the held-out rows" in done.err
    apart = run("calibrate", "m.yaml", *files[:2], "--select", "auto,z*", "--json", "--holdout", files[2])
    held = apart.json["heldout"]
    assert held["after"]["position"]["rms"] < 3e-3
    assert "z1, z2, z3 fitted to these rows" in held["scheme"] and "fitted to these rows" in apart.err


def test_poses_and_grids_are_driven_with_nominal_zeros() -> None:
    """What the control believes: the same readings in every session, those of the nominal machine."""
    Path("poses.csv").write_text("session,x,y\nmon,300,250\ntue,300,250\nwed,300,250\n")
    lines = [f'"z{k + 1}[{name}]": {1e3 * z[k]}' for name, z in ZEROS.items() for k in range(3)]
    Path("p.yaml").write_text("parameters: {" + ", ".join(lines) + "}\n")
    done = run("simulate", "m.yaml", "poses.csv", "-p", "p.yaml", "-o", "out.csv")
    assert done.code == 0, done.err
    nominal = truth("triglide").inverse([[0.3, 0.25]])[0] * 1e3  # type: ignore[attr-defined]
    places = []
    for k, name in enumerate(("q1", "q2", "q3")):
        assert column("out.csv", name) == pytest.approx([nominal[k]] * 3, abs=1e-9)
    for zeros in ZEROS.values():
        positions = nominal[None] * 1e-3 + zeros
        places.append(truth("triglide").forward(positions).tcp[0, :2] * 1e3)  # type: ignore[attr-defined]
    assert np.column_stack([column("out.csv", "x"), column("out.csv", "y")]) == pytest.approx(
        np.array(places), abs=1e-7
    )
    grid = run("simulate", "m.yaml", "--grid", "x=300:300:1,y=250:250:1", "-p", "p.yaml", "-o", "grid.csv")
    assert grid.code == 0 and column("grid.csv", "x") == pytest.approx([300], abs=1e-9)
    assert "values of other sessions are not used: z1[mon]" in grid.err


def sessions_of(machine: str, *tables: str) -> tuple[Model, object]:
    read = read_machine(machine)
    problem = problem_of(compile_machine(read).model, read_measurements(list(tables), read))
    return problem.model, problem


def test_the_inverse_model_knows_whose_rows_it_is_asked_for() -> None:
    """Readings for the same pose differ by the zeros of the sessions; without rows they are the nominal ones."""
    measured(rows=3)
    model, problem = sessions_of("m.yaml", *(f"{name}.csv" for name in ZEROS))
    values = model.nominal
    for k in range(3):
        for name, zeros in ZEROS.items():
            values[model.names.index(f"z{k + 1}[{name}]")] = zeros[k]
    poses = np.full((9, 6), np.nan)
    poses[:, :2] = [0.3, 0.25]
    nominal = truth("triglide").inverse([[0.3, 0.25]])[0]  # type: ignore[attr-defined]
    assert drive_positions(model, poses, values).readings == pytest.approx(np.tile(nominal, (9, 1)), abs=1e-12)
    own = drive_positions(model, poses, values, rows=problem.rows).readings  # type: ignore[attr-defined]
    assert own == pytest.approx(nominal - np.repeat(list(ZEROS.values()), 3, axis=0), abs=1e-12)
    reference = model.reference_readings
    assert compile_machine(read_machine(MACHINES / "triglide.yaml")).model.reference_readings == pytest.approx(
        reference
    )


LEGS = """
units: {length: mm, force: N}
space: planar
ranges: {length: 0.5}
parameters: {"o{i}": {each: {i: [1, 2]}, nominal: 500, range: 10, per: session}, w: 600}
ground: {A: [0, 0], B: [w, 0]}
nodes: {tip: [300, 400]}
bars: {leg1: {between: [A, tip]}, leg2: {between: [B, tip]}}
actuators: {q1: {drives: leg1, offset: o1}, q2: {drives: leg2, offset: o2}}
sensors: {camera: {at: tip, reads: [x, y], sigma: 10 um, frame: machine}}
"""


def test_offsets_of_legs_are_zeros_too_and_lengths_are_judged_with_those_of_their_session() -> None:
    """Two legs from known points: reading = distance - offset; lengths then fit to rounding, by each session's own."""
    Path("legs.yaml").write_text(LEGS)
    rng, offsets = np.random.default_rng(1), {"a": (0.495, 0.507), "b": (0.503, 0.494)}
    for name, (first, second) in offsets.items():
        tip = rng.uniform([0.2, 0.3], [0.4, 0.5], (12, 2))
        readings = [np.linalg.norm(tip, axis=1) - first, np.linalg.norm(tip - [0.6, 0], axis=1) - second]
        np.savetxt(
            f"{name}.csv", np.column_stack([*readings, tip]) * 1e3, "%.15g", ",", header="q1,q2,x,y", comments=""
        )
    done = run("calibrate", "legs.yaml", "a.csv", "b.csv", "--select", "o*", "--json", "--holdout", "none")
    found = {p["name"]: p["value"] for p in done.json["parameters"]}
    for name, both in offsets.items():
        for k, offset in enumerate(both, start=1):
            assert found[f"o{k}[{name}]"] == pytest.approx(1e3 * offset, abs=1e-6)
    assert done.json["after"]["length"]["rms"] < 1e-6 < 1 < done.json["before"]["length"]["rms"]
    model, problem = sessions_of("legs.yaml", "a.csv", "b.csv")
    residual = length_residuals(problem, model.nominal)  # type: ignore[arg-type]
    for rows, both in ((slice(0, 12), offsets["a"]), (slice(12, 24), offsets["b"])):
        assert residual[rows] == pytest.approx(np.tile(0.5 - np.array(both), (12, 1)), abs=1e-9)


def test_the_encoder_of_a_drive_in_force_control_has_a_zero_of_its_own_in_every_session() -> None:
    """The router's lower belts: the same pose reads (zero - zero) / (radius * ratio) apart."""
    belts = "{zeroBL: {per: session}, zeroTL: {per: session}}"
    Path("router.yaml").write_text(f"extends: {MACHINES / 'belt-router.yaml'}\nparameters: {belts}\n")
    Path("poses.csv").write_text("session,x,y\nmon,1400,1000\ntue,1400,1000\n")
    Path("p.yaml").write_text('parameters: {"zeroBL[mon]": 252 mm, "zeroBL[tue]": 249 mm}\n')
    assert run("simulate", "router.yaml", "poses.csv", "-p", "p.yaml", "-o", "out.csv").code == 0
    read = column("out.csv", "BL")
    assert read[1] - read[0] == pytest.approx(3 / (25 * 0.1 * 2 * np.pi), rel=1e-9)
    assert column("out.csv", "BR")[0] == column("out.csv", "BR")[1]


def test_what_zeros_of_sessions_would_cost_is_seen_before_anything_is_measured() -> None:
    """Each session needs rows of its own: zeros of three sessions with 20 rows each are as sure as those of one."""
    Path("zero.yaml").write_text(TRIGLIDE)
    poses = poses_of("triglide", 20) * 1e3
    for sessions in (1, 3):
        lines = [f"s{k},{float(x)!r},{float(y)!r}" for k in range(sessions) for x, y in poses]
        Path("poses.csv").write_text("session,x,y\n" + "\n".join(lines) + "\n")
        done = run("observability", "m.yaml", "poses.csv", "--select", "z1,z2", "--json").json
        stds = {p["name"]: p["std"] for p in done["parameters"]}
        assert len(stds) == 2 * sessions
        if sessions == 1:
            one = stds["z1[s0]"]
        else:
            assert [stds[f"z1[s{k}]"] for k in range(3)] == pytest.approx([one] * 3, rel=1e-6)
    planned = run("plan", "m.yaml", "poses.csv", "--select", "z1[s0],z1[s1]", "--json")
    assert planned.code == 0 and planned.json["n_rows"] == 60
    assert (
        run("sensitivity", "m.yaml", "poses.csv", "--select", "z1", "--json").json["parameters"][0]["name"] == "z1[s0]"
    )


@pytest.mark.parametrize(
    ("where", "what"),
    [
        ("bars: {rod1: {length: z1}}", "`z1` has one value per session, but this is a part of the machine"),
        ("actuators: {q1: {zero: 0, scale: 1 + z1/100}}", "`z1` has one value per session"),
        ("actuators: {q1: {limits: [z1, 900]}}", "`z1` has one value per session"),
    ],
)
def test_other_parts_of_a_drive_or_machine_have_no_sessions(where: str, what: str) -> None:
    Path("bad.yaml").write_text("extends: m.yaml\n" + where + "\n")
    done = run("check", "bad.yaml")
    assert done.code == 1 and what in done.err
    assert "use `per: session` only for sensors, and for `zero` and `offset` of actuators" in done.err


def test_a_session_that_is_off_as_a_whole_is_no_wrong_row(monkeypatch: pytest.MonkeyPatch) -> None:
    """A drive referenced 10 mm away, a hundred ranges: its zero says so; a wrong cell in another session is one row."""
    Path("m.yaml").write_text(TRIGLIDE.replace("range: 5,", "range: 0.1,"))
    for name in ZEROS:
        monkeypatch.setitem(ZEROS, name, (3e-5, -2e-5, 4e-5))
    measured()
    kept = Path("wed.csv").read_text().splitlines()[:6]
    Path("wed.csv").write_text("\n".join([kept[0], *(_moved(line, 0, -10.0) for line in kept[1:])]) + "\n")
    files = [f"{name}.csv" for name in ZEROS]
    done = run("calibrate", "m.yaml", *files, "--select", "z*", "--holdout", "none")
    assert "far from what the other rows predict" not in done.err and "z1[wed]" in done.err
    lines = Path("mon.csv").read_text().splitlines()
    lines[4] = _moved(lines[4], 3, 30.0)
    Path("mon.csv").write_text("\n".join(lines) + "\n")
    done = run("calibrate", "m.yaml", *files, "--select", "z*", "--holdout", "none")
    assert done.code == 1 and "1 row is far from what the other rows predict: mon.csv:5, `x` by up to" in done.err


@pytest.mark.slow
def test_further_rows_belong_to_the_last_session(tmp_path: Path) -> None:
    """The earlier ones are over; of a plan of several each is measured as a whole, with the datum at both ends."""
    measured()
    lines = {name: Path(f"{name}.csv").read_text().splitlines() for name in ("mon", "tue")}
    rows = [f"{name},{line}" for name, count in (("mon", 12), ("tue", 4)) for line in lines[name][1 : count + 1]]
    Path("two.csv").write_text("\n".join(["session," + lines["mon"][0], *rows]) + "\n")
    aim = ("--next", "--budget", "60", "--aim", "l1 60 um")
    done = run("plan", "m.yaml", "two.csv", *aim, "-o", "next.csv", "--json")
    assert done.code == 0
    assert set(texts("next.csv", "session")) == {"tue"}
    assert run("plan", "m.yaml", "two.csv", "-o", "all.csv").code == 0
    sessions, ids = texts("all.csv", "session"), texts("all.csv", "id")
    assert sessions == ["mon"] * 13 + ["tue"] * 5
    assert [k for k, name in enumerate(ids) if name.startswith("datum")] == [0, 12, 13, 17]


def texts(path: str, name: str) -> list[str]:
    """One column of texts."""
    with Path(path).open(encoding="utf-8") as file:
        return [row[name] for row in csv.DictReader(line for line in file if not line.startswith("#"))]


def _moved(line: str, column: int, by: float) -> str:
    """A line with one number changed."""
    cells = line.split(",")
    cells[column] = repr(float(cells[column]) + by)
    return ",".join(cells)


def test_an_instrument_that_is_set_up_anew_for_every_session() -> None:
    """Moved by 7 and -12 mm and turned by 1 deg between two sessions, each of which has a frame of its own."""
    Path("set-up.yaml").write_text(f"""
extends: {MACHINES / "triglide.yaml"}
sensors: {{tracker: {{frame: fitted per session}}}}
""")
    rows = list(csv.DictReader((MACHINES / "triglide.csv").open(encoding="utf-8")))[::3]
    cosine, sine = np.cos(np.radians(1.0)), np.sin(np.radians(1.0))
    lines = ["session,q1,q2,q3,x,y"]
    for k, row in enumerate(rows):
        x, y = float(row["x [mm]"]), float(row["y [mm]"])
        if k % 2:
            x, y = cosine * x - sine * y + 7.0, sine * x + cosine * y - 12.0
        drives = ",".join(row[f"q{a} [mm]"] for a in (1, 2, 3))
        lines.append(f"{('mon', 'tue')[k % 2]},{drives},{x:.6f},{y:.6f}")
    Path("set-up.csv").write_text("\n".join(lines) + "\n")
    result = run("calibrate", "set-up.yaml", "set-up.csv", "--holdout", "none", "--json").json
    assert result["status"] == "converged" and result["chi2_per_dof"] < 2.0
    by_name = {p["name"]: p for p in result["parameters"]}
    mon, tue = (by_name[f"frame@tracker.rz[{name}]"] for name in ("mon", "tue"))
    assert abs(tue["value"] - mon["value"]) == pytest.approx(1.0, abs=5 * (mon["std"] + tue["std"]))
