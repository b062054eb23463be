"""What people get wrong about sensors is told, at its line, with a remedy; every command takes all kinds."""

from __future__ import annotations

import csv
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from tests.command import MACHINES, clean, column, run
from tests.in_ci import in_ci

EVERY = """
parameters:
  {bx: {nominal: 100, range: 3}, by: {nominal: -750, range: 3}, w0: {nominal: 5, range: 1},
   ws: {nominal: 1, range: 0.01, unit: "1"}, h: {nominal: -100, range: 2}, t: {nominal: 0.02, range: 0.01},
   e0: {nominal: 0.1, range: 0.05}}
ground: {ball: [bx, by], hook: [-300, -900]}
frames: {bed: {at: [0, h], turn: t}}
actuators: {q3: {control: passive, sigma: 1 um}}
sensors:
  grid: {frame: fitted}
  level: {at: platform, reads: [rz], frame: machine, sigma: 1 urad}
  ballbar: {kind: distance, at: platform, offset: [30, -50], to: ball, sigma: 1 um}
  wire: {kind: distance, at: A2, to: hook, zero: w0, scale: ws, sigma: 10 um}
  calipers: {kind: span, at: platform, offset: [30, -50], sigma: 20 um}
  probe: {kind: touch, at: platform, offset: [0, -50], surface: bed, sigma: 5 um}
  edge: {kind: touch, at: platform, surface: bed, reads: [x, y], sigma: 5 um}
  current: {kind: force, drive: q2, unit: "1", scale: 120 N, sigma: 0.05}
  encoder: {kind: angle, at: B1, to: A1, zero: e0, unit: deg, sigma: 2 urad}
  gauge: {kind: bench, of: l1 - l2, reading: 0.0, sigma: 1 um}
"""
WRONG = {
    "distance, at: platform, sigma: 1 um": ("sensor kind `distance` needs `to`", "to: POINT"),
    "distanse, at: platform, to: A1, sigma: 1 um": (
        "unknown sensor kind `distanse`",
        "did you mean `distance`?",
    ),
    "span, at: platform, to: A1, sigma: 1 um": ("sensor kind `span` has no `to`", "kind: at, sigma, sigma_is, offset"),
    "touch, at: platform, sigma: 1 um": ("sensor kind `touch` needs `surface`", "surface: FRAME"),
    "touch, at: platform, surface: lift, sigma: 1 um": ("unknown frame `lift`", "did you mean `left`?"),
    "touch, at: platform, surface: left, reads: [rz], sigma: 1 um": ("does not read `rz`", "reads:"),
    "force, drive: q9, sigma: 1 N": ("unknown actuator `q9`", "q4"),
    "force, drive: q2, sigma: 1 um": ("expected a force", "such as `kN`"),
    'force, drive: q2, unit: "1", sigma: 1': ("plain numbers need `scale`", "scale: 120 N"),
    "force, drive: q2, unit: V, sigma: 1": ("unknown unit `V`", "use one of %"),
    "angle, at: A1, to: B1, sigma: 1 um": ("expected an angle", "such as `rad`"),
    "bench, of: l1, sigma: 1 um": ("sensor kind `bench` needs `reading`", "reading: 288.1 mm"),
    "bench, reading: 950, sigma: 1 um": ("sensor kind `bench` needs `of`", "of: l1"),
    "bench, of: l1 + g1, reading: 1, sigma: 1 um": ("cannot combine", "`g1` is an angle (inferred from"),
    "tcp, at: platform, reads: [x, y], sigma: 1 um": ("sensor kind `tcp` needs `frame`", "`frame: machine` or"),
    "tcp, at: platform, reads: [z], frame: machine, sigma: 1 um": ("`z` does not exist in a planar machine", "`rz`"),
    "tcp, at: platform, reads: [x, rz], frame: machine, sigma: 1 um": (
        "both coordinates and orientation",
        "orientation: ",
    ),
    "distance, at: platform, to: A1": ("missing key `sigma`", "sigma"),
    "distance, at: platform, to: B1, sigma: 0": ("must be positive", "sign"),
    "distance, at: [A1, A2], to: B1, sigma: 1 um": ("only sensor kind `tcp` can measure several points", "at: POINT"),
    "distance, at: A1, to: B9, sigma: 1 um": ("`B9`", ""),
    "distance, at: A1, to: B1, frame: fitted, sigma: 1 um": ("sensor kind `distance` has no `frame`", "kind: at"),
}
SENSELESS = {
    "no distance": "a: {kind: distance, at: platform, to: platform, sigma: 1 um}",
    "no line": "a: {kind: angle, at: A1, to: A1, sigma: 1 urad}",
    "no axis": "a: {kind: angle, at: B1, to: A1, axis: [0, 0], sigma: 1 urad}",
    "axis in the plane": "a: {kind: angle, at: B1, to: A1, axis: x, sigma: 1 urad}",
    "scale of nothing": "a: {kind: distance, at: A1, to: B2, scale: 0, sigma: 1 um}",
    "correlation above one": "grid: {correlation: {x_y: 1.5}}",
    "angle in mm": "a: {kind: angle, at: B1, to: A1, unit: mm, sigma: 1 um}",
    "force in Nm": "a: {kind: force, drive: q2, unit: Nm, sigma: 1 Nm}",
    "point twice": "a: {at: [A1, A1], reads: [x], frame: machine, sigma: 1 um}",
    "no channel": "a: {at: A1, reads: [], frame: machine, sigma: 1 um}",
    "no point": "a: {at: [], reads: [x], frame: machine, sigma: 1 um}",
    "negative growth": "grid: {sigma_per_length: -6 um/m}",
    "bench far off": "a: {kind: bench, of: l3, reading: 95, sigma: 1 um}",
    "bench reading of a wrong dimension": "a: {kind: bench, of: l1, reading: 3 N, sigma: 1 um}",
    "bench sigma of a wrong dimension": "a: {kind: bench, of: l1, reading: 950, sigma: 1 N}",
    "bench of a constant": "a: {kind: bench, of: 950 mm, reading: 950, sigma: 1 um}",
    "two columns": "a: {kind: touch, at: A1, surface: left, reads: {y: u}, column: v, sigma: 1 um}",
}
"""What makes no sense."""


def machine(folder: Path, text: str, base: str = "scissors") -> Path:
    file = folder / "machine.yaml"
    file.write_text(f"extends: {MACHINES / base}.yaml\n{text}\n", encoding="utf-8")
    return file


def sensors(*entries: str) -> str:
    return "sensors:\n" + "\n".join(f"  {entry}" for entry in entries)


def test_all_at_once(tmp_path: Path) -> None:
    """Every fault at its line with its remedy in one run."""
    entries = [f"s{k}: {{kind: {text}}}" for k, text in enumerate(WRONG)]
    done = clean(run("check", machine(tmp_path, sensors(*entries))))
    assert done.code == 1
    told = done.err + done.out
    for line, (what, remedy) in enumerate(WRONG.values(), 3):
        mine = [part for part in told.split("\n\n") if f"machine.yaml:{line}:" in part]
        assert any(what in part and remedy in part for part in mine), (what, mine)


@pytest.mark.parametrize("text", WRONG)
def test_one_alone(text: str, tmp_path: Path) -> None:
    what, remedy = WRONG[text]
    done = clean(run("check", machine(tmp_path, sensors(f"a: {{kind: {text}}}")), "--json", "-q"))
    assert done.code == 1
    assert any(what in f["message"] and remedy in (f["help"] or "") and f["line"] == 3 for f in done.json["faults"])


@pytest.mark.parametrize("sigma", ["1 um", "1 urad", "1 N"])
def test_a_misspelt_kind_is_one_fault(sigma: str, tmp_path: Path) -> None:
    """What it measures is not known then, so nothing is said of its sigma."""
    done = run("check", machine(tmp_path, sensors(f"a: {{kind: spam, at: platform, sigma: {sigma}}}")), "--json", "-q")
    assert [f["message"] for f in clean(done).json["faults"]] == ["unknown sensor kind `spam`"]


@pytest.mark.parametrize("text", SENSELESS.values(), ids=SENSELESS.keys())
def test_what_makes_no_sense(text: str, tmp_path: Path) -> None:
    done = clean(run("check", machine(tmp_path, sensors(text)), "--json", "-q"))
    assert done.json["n_faults"] + len(done.json.get("warnings", ())) > 0


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("a: {kind: distance, at: A1, to: B1, sigma: 1 um, column: d}\n"
         "  b: {kind: span, at: A1, sigma: 1 um, column: d}", "column `d` is already used by sensors.a"),
        ("a: {kind: distance, at: A1, to: B1, sigma: 1 um, column: q1}", "column `q1` is already used by actuators.q1"),
        ("to: {kind: span, at: A1, sigma: 1 um}", "the column name `to` is reserved"),
        ("a: {at: A1, reads: {x: u, y: u}, frame: machine, sigma: 1 um}", "column `u` is already used by sensors.a"),
    ],
)  # fmt: skip
def test_one_column_one_sensor(text: str, what: str, tmp_path: Path) -> None:
    done = clean(run("check", machine(tmp_path, sensors(text))))
    assert done.code == 1 and what in done.err + done.out and "choose another column name" in done.err + done.out


def test_a_part_of_the_machine_has_no_sessions(tmp_path: Path) -> None:
    done = run("check", machine(tmp_path, "parameters: {l3: {per: session}}"))
    assert done.code == 1 and "`l3` has one value per session, but this is a part of the machine" in done.err


# tables ---------------------------------------------------------------------------------------------------------------


@cache
def poses() -> str:
    """Sixty positions; every second row is joined to the one before."""
    places = np.random.default_rng(4).uniform(-200, 200, (60, 2))
    rows = [f"p{k},{x:.3f},{y:.3f},{f'p{k - 1}' if k % 2 else ''}" for k, (x, y) in enumerate(places)]
    return "\n".join(["id,x [mm],y [mm],to", *rows])


def simulated(file: Path, name: str, *options: str) -> Path:
    """Readings of a machine at `poses`."""
    asked, target = file.parent / "poses.csv", file.parent / name
    asked.write_text(poses(), encoding="utf-8")
    assert run("simulate", file, asked, "-o", target, "-q", *options).code == 0
    return target


def changed(table: Path, name: str, new: str, row: int | None) -> Path:
    """The table with another heading (row None), or another cell of a column."""
    lines = [line for line in table.read_text(encoding="utf-8").splitlines() if line[:1] != "#"]
    rows = list(csv.reader(lines))
    k = next(k for k, h in enumerate(rows[0]) if h.split(" ")[0] == name)
    rows[0 if row is None else row][k] = new
    with table.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows(rows)
    return table


@pytest.mark.parametrize(
    ("name", "new", "row", "what"),
    [
        ("to", "p1", 2, "`to` names `p1`, which is this row itself"),
        ("to", "nowhere", 2, "`to` names `nowhere`, which is the `id` of no row"),
        ("to", "", 2, "distance to another row measured, but `to` is empty"),
        ("id", "p7", 3, "`to` names `p7`, which is the `id` of 2 rows"),
        ("to", "other", None, "error[csv-partner]: distance to another row measured in 30 rows, but no row has a `to`"),
        ("wire", "wire [rad]", None, "`rad` is a unit of angle, but this is a length"),
        ("encoder", "encoder [mm]", None, "`mm` is a unit of length, but this is an angle"),
        ("current", "current [N]", None, "`N` is a unit of force, but this is a plain number"),
        ("wire", "nan", 3, "`nan` in column `wire` is not a number"),
    ],
)
def test_faults_of_tables(name: str, new: str, row: int | None, what: str, tmp_path: Path) -> None:
    file = machine(tmp_path, EVERY)
    table = changed(simulated(file, "m.csv"), name, new, row)
    if (name, row) == ("id", 3):
        table = changed(table, "to", "p7", 10)
    done = clean(run("calibrate", file, table, "--holdout", "none"))
    assert done.code == 3 and what in done.err and "help:" in done.err
    assert "m.csv:" in done.err


def test_units_of_headings_are_taken(tmp_path: Path) -> None:
    """Micrometres and radians in the heading, millimetres and degrees in the machine file."""
    file = machine(tmp_path, EVERY)
    table = simulated(file, "m.csv", "--noise", "declared")
    first = run("calibrate", file, table, "--json", "-q", "--holdout", "none", "--starts", "1").json
    for name, unit, factor in (("wire", "um", 1e3), ("encoder", "rad", np.pi / 180), ("grid.x", "m", 1e-3)):
        values = column(table, name) * factor
        table = changed(table, name, f"{name} [{unit}]", None)
        for row, value in enumerate(values, 1):
            table = changed(table, name, repr(float(value)), row)
    second = run("calibrate", file, table, "--json", "-q", "--holdout", "none", "--starts", "1").json
    assert second["chi2"] == pytest.approx(first["chi2"], rel=1e-6)


# commands -------------------------------------------------------------------------------------------------------------


def test_every_kind_there_and_back(tmp_path: Path) -> None:
    """Simulated with the stated noise, calibrated: chi-square of 1, parameters at nominal."""
    file = machine(tmp_path, EVERY)
    table = simulated(file, "m.csv", "--noise", "declared", "--seed", "2")
    assert clean(run("check", file, table)).code == 0
    found = clean(run("calibrate", file, table, "--json", "-q", "--holdout", "2", "-o", tmp_path / "p.yaml")).json
    assert found["status"] == "converged"
    assert abs(found["chi2_per_dof"] - 1) < 4 * np.sqrt(2 / found["degrees_of_freedom"])
    assert found["heldout"]["rms_after"] is not None
    for p in (p for p in found["parameters"] if p["std"] is not None and "frame@" not in p["name"]):
        assert abs(p["value"] - p["nominal"]) < 4 * p["std"], p
    again = clean(run("calibrate", file, table, "--json", "-q", "-p", tmp_path / "p.yaml", "--holdout", "none")).json
    assert again["chi2"] == pytest.approx(found["chi2"], rel=1e-6)


@pytest.mark.parametrize("command", ["observability", "sensitivity", "plan", "simulate"])
def test_analyses_of_every_kind(command: str, tmp_path: Path) -> None:
    file, asked = machine(tmp_path, EVERY), tmp_path / "poses.csv"
    asked.write_text("\n".join(poses().splitlines()[:21]), encoding="utf-8")
    output = ("-o", tmp_path / "o.csv") if command == "simulate" else ()
    done = clean(run(command, file, asked, "--json", "-q", *output))
    assert done.code == 0 and done.json["n_rows"] == 20


@pytest.mark.slow
@pytest.mark.parametrize("command", ["diagnose", "improve"])
def test_diagnosis_of_every_kind(command: str, tmp_path: Path) -> None:
    file = machine(tmp_path, EVERY)
    table = simulated(file, "m.csv", "--noise", "declared", "--seed", "2")
    done = clean(run(command, file, table, "--json", "-q"))
    assert done.json["verdict"] == "clean"


# sessions -------------------------------------------------------------------------------------------------------------

MOVED = EVERY.replace("frame: fitted", "frame: fitted per session").replace("w0: {", "w0: {per: session, ")


def two_sessions(folder: Path) -> tuple[Path, Path, Path]:
    file = machine(folder, MOVED)
    first, second = (simulated(file, f"{n}.csv", "--noise", "declared", "--seed", n) for n in "12")
    return file, first, second


def test_tables_of_two_sessions_are_checked(tmp_path: Path) -> None:
    assert clean(run("check", *two_sessions(tmp_path))).code == 0


@pytest.mark.parametrize("command", in_ci(["simulate"], ["simulate", "observability", "calibrate"]))
def test_parameters_of_sessions_are_used_again(command: str, tmp_path: Path) -> None:
    """The machine is calibrated; the next day's table has sessions of its own."""
    file, first, second = two_sessions(tmp_path)
    params = tmp_path / "p.yaml"
    assert run("calibrate", file, first, second, "-o", params, "-q", "--holdout", "none", "--starts", "1").code == 0
    third = simulated(file, "3.csv", "--noise", "declared", "--seed", "3")
    assert clean(run(command, file, third, "-p", params, "-q")).code == 0


# noise ----------------------------------------------------------------------------------------------------------------


def test_noise_is_simulated_as_it_is_stated(tmp_path: Path) -> None:
    """1 mm/m of 0.2 m; x and y go together."""
    file = machine(tmp_path, sensors("grid: {sigma_per_length: 1 mm/m, correlation: {x_y: 0.9}}"))
    exact, noisy = simulated(file, "exact.csv"), simulated(file, "noisy.csv", "--noise", "declared")
    off = np.array([column(noisy, c) - column(exact, c) for c in "xy"])
    far = np.hypot(column(exact, "x"), column(exact, "y"))
    assert np.std(off / far) == pytest.approx(1e-3, rel=0.3)
    assert np.corrcoef(off)[0, 1] > 0.7


def test_angles_do_not_grow_with_distance(tmp_path: Path) -> None:
    """Growth of the noise of coordinates leaves what the orientation tells as it is."""
    angle = "reads: [x, y, rz], sigma: {position: 1 mm, orientation: 1 urad}"
    found = []
    for growth in ("", ", sigma_per_length: 1 mm/m"):
        file = machine(tmp_path, sensors(f"grid: {{{angle}{growth}}}"))
        (tmp_path / "poses.csv").write_text(poses(), encoding="utf-8")
        told = run("observability", file, tmp_path / "poses.csv", "--json", "-q", "--select", "g1").json
        found.append(told["parameters"][0]["std"])
    assert found[1] < 1.1 * found[0]
