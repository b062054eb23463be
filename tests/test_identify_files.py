"""Calibration from files: the same bytes twice, units, columns of sigma, empty cells, turns near pi, exit codes."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pkmcal_cli.app import run
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.prediction import Rows, predict
from tests.command import run as command
from tests.command import timeless
from tests.support import MACHINES, model

NAMES = ("l1", "l2", "xb1", "xb2", "y1", "y2")
TWO_LEGS = """
units: {UNITS}
space: planar
ranges: {length: RANGE, stiffness: 1000 N/mm}
parameters: {l1: 300 mm, l2: 300 mm, xb1: 0, xb2: 0, y1: 100 mm, y2: 100 mm, k: {nominal: 50000 N/mm, identify: false}}
guides: {rail: {along: x}}
nodes: {tcp: [360 mm, 275 mm]}
bodies:
  c1: {guide: rail, at: 117 mm, points: {B1: [xb1, y1]}}
  c2: {guide: rail, at: 603 mm, points: {B2: [xb2, y2]}}
bars:
  rod1: {between: [B1, tcp], length: l1, k: k}
  rod2: {between: [B2, tcp], length: l2, k: k}
actuators: {q1: {moves: c1}, q2: {moves: c2}}
sensors: {tracker: {kind: tcp, at: tcp, reads: [x, y], sigma: 10 um, frame: machine}}
"""


def table(file: Path, rows: Array, header: str = "q1 [mm],q2 [mm],x [mm],y [mm]") -> Path:
    """A table of numbers; nan is an empty cell."""
    lines = [",".join("" if np.isnan(v) else repr(float(v)) for v in row) for row in rows]
    file.write_text("\n".join([header, *lines]) + "\n")
    return file


def measured() -> Array:
    """Readings (n, 4) in mm of the machine with errors and noise: q1, q2, x, y."""
    rng, machine = np.random.default_rng(5), two_legs()
    q = np.array([[-117.0, -603.0]]) * -1e-3 + np.stack(
        [rng.uniform(-0.1, 0.4, 40), rng.uniform(-0.1, 0.4, 40)], axis=1
    )
    q[:, 1] = q[:, 0] + rng.uniform(0.3, 0.56, 40)
    values = machine.nominal
    values[:6] += rng.normal(size=6) * 5e-5
    found = predict(machine, values, Rows.at(q))
    assert found.solved.all()
    return np.hstack([q, found.values + rng.normal(size=(40, 2)) * 1e-5]) * 1e3


def text(units: str = "length: mm, angle: deg, force: N", spread: str = "0.1") -> str:
    return TWO_LEGS.replace("UNITS", units).replace("RANGE", spread)


def two_legs() -> Any:
    return model(text())


def calibrated(folder: Path, rows: Path, capsys: pytest.CaptureFixture[str], machine: str = "", *more: str) -> Any:
    """JSON result of `pkmcal calibrate`; exit code 0."""
    (folder / "m.yaml").write_text(machine or text())
    assert run(["calibrate", str(folder / "m.yaml"), str(rows), "--json", "-q", *more]) == 0
    return json.loads(capsys.readouterr().out)


def numbers(result: Any, key: str = "value") -> Array:
    return np.array([p[key] for p in result["parameters"]])


@pytest.mark.slow
def test_the_same_bytes_twice(tmp_path: Path) -> None:
    """JSON and parameter file, but for the time, from two processes with other hash seeds."""
    outputs = []
    for seed in ("1", "2"):
        file = tmp_path / f"{seed}.yaml"
        command = [sys.executable, "-m", "pkmcal_cli", "calibrate", str(MACHINES / "biglide.yaml")]
        command += [str(MACHINES / "biglide.csv"), "--json", "-o", str(file)]
        done = subprocess.run(
            command, capture_output=True, check=True, cwd=MACHINES.parent, env={**os.environ, "PYTHONHASHSEED": seed}
        )
        lines = [line for line in file.read_text().splitlines() if "created:" not in line]
        told = timeless(done.stdout.decode()).replace(file.name, "")
        outputs.append((told, [line.replace(file.name, "") for line in lines]))
    assert outputs[0] == outputs[1]


def test_units_do_not_matter(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Metres instead of millimetres in machine and table: 1e-9 of the range, as parsing rounds the last digit."""
    rows = measured()
    in_mm = calibrated(tmp_path, table(tmp_path / "mm.csv", rows), capsys)
    header = "q1 [m],q2 [m],x [um],y [mm]"
    mixed = table(tmp_path / "m.csv", rows * [1e-3, 1e-3, 1e3, 1], header)
    in_m = calibrated(tmp_path, mixed, capsys, text("length: m, angle: rad, force: kN", "1e-4"))
    # l1 ... y2 keep their own unit; xb1 and xb2, plain numbers, are in the file's
    scale = np.array([1e3 if n.startswith("x") else 1 for n in NAMES])
    assert numbers(in_m) * scale == pytest.approx(numbers(in_mm), abs=1e-9 * 0.1)
    assert numbers(in_m, "std") * scale == pytest.approx(numbers(in_mm, "std"), rel=1e-8)
    assert in_m["chi2"] == pytest.approx(in_mm["chi2"], rel=1e-8)
    assert in_m["condition_number"] == pytest.approx(in_mm["condition_number"], rel=1e-8)


def test_columns_of_sigma_weigh_the_cells(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A gross error of 1 mm with a sigma of 1 m is as if not measured (1e-10 of the weight); empty: the machine's.

    Ranges so wide that data alone determine everything: only then does std follow sigma.
    """
    wide = text(spread="10").replace("sigma: 10 um", "sigma: 10 um, sigma_is: exact")
    rows, spread = measured(), np.full((40, 2), np.nan)
    spoilt = rows.copy()
    spoilt[7, 2] += 1.0
    spread[7, 0] = 1000.0
    header = "q1 [mm],q2 [mm],x [mm],y [mm],sigma.x [mm],sigma.y [mm]"
    heavy = calibrated(tmp_path, table(tmp_path / "s.csv", np.hstack([spoilt, spread]), header), capsys, wide)
    rows[7, 2] = np.nan
    without = calibrated(tmp_path, table(tmp_path / "w.csv", rows), capsys, wide)
    assert numbers(heavy) == pytest.approx(numbers(without), abs=1e-5 * numbers(without, "std").min())
    assert without["degrees_of_freedom"] == heavy["degrees_of_freedom"] - 1 == 2 * 40 - 6 - 1
    spread[:] = 0.02
    twice = calibrated(tmp_path, table(tmp_path / "t.csv", np.hstack([measured(), spread]), header), capsys, wide)
    once = calibrated(tmp_path, table(tmp_path / "o.csv", measured()), capsys, wide)
    assert numbers(twice, "std") == pytest.approx(2 * numbers(once, "std"), rel=1e-3)
    assert twice["chi2"] == pytest.approx(once["chi2"] / 4, rel=1e-6)


def test_verdicts_and_exit_codes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """1: a parameter named but not determined, nothing identifiable, not converged."""
    (tmp_path / "m.yaml").write_text(text())
    rows = table(tmp_path / "m.csv", measured())
    command = ["calibrate", str(tmp_path / "m.yaml"), str(rows), "--json", "-q"]
    assert run([*command, "--select", "auto,k"]) == 1
    named = json.loads(capsys.readouterr().out)
    assert named["status"] == "converged"
    assert [p["std"] for p in named["parameters"] if p["name"] == "k"] == [None]
    assert run([*command, "--select", "k"]) == 1
    nothing = json.loads(capsys.readouterr().out)
    assert nothing["status"] == "nothing_identifiable"
    assert [p["value"] for p in nothing["parameters"]] == pytest.approx([50000], rel=1e-12)

    def hurried(problem: Problem, selected: tuple[str, ...], start: Array, iterations: int = 1, **_: Any) -> object:
        return identify(problem, selected, start, min(iterations, 1))

    monkeypatch.setattr("pkmcal_cli.calibration.starts.identify", hurried)
    assert run(command) == 1
    assert json.loads(capsys.readouterr().out)["status"] == "not_converged"


def test_a_start_at_which_rows_cannot_be_predicted(tmp_path: Path) -> None:
    """The hangprinter's anchors 300 mm off: found; errors before are unknown, and it is told why."""
    start = tmp_path / "far.yaml"
    start.write_text("parameters:\n  Ax: {value: 300, unit: mm}\n  Cz: {value: 150, unit: mm}\n")
    files = [MACHINES / "hangprinter.yaml", MACHINES / "hangprinter_2021-12-16.csv"]
    done = command("calibrate", *files, "-p", start, "--select", "auto,R_*", "--json")
    assert done.code == 0
    assert done.json["status"] == "converged"
    assert done.json["before"]["position"]["rms"] is None
    assert done.json["after"]["length"]["rms"] == pytest.approx(1.14, rel=0.03)
    assert "rows cannot be predicted at the start" in done.err
    assert "nan" not in done.err


TURNTABLE = """
units: {length: mm, angle: deg, force: N}
parameters: {z0: {nominal: 0, range: 2}, arm: {nominal: 100, range: 0.1}}
"""
SPATIAL = f"""{TURNTABLE}
space: spatial
ground: {{O: [0, 0, 0]}}
bodies: {{hub: {{at: [0, 0, 0], points: {{tip: [arm, 0, 0]}}}}}}
joints: {{axle: {{between: [O, hub], type: revolute, axis: [1, 2, 3]}}}}
actuators: {{q: {{turns: axle, zero: z0}}}}
sensors:
  tracker: {{kind: tcp, at: tip, reads: [x, y, z], sigma: 10 um, frame: machine}}
  gyro: {{kind: tcp, at: hub, reads: [rx, ry, rz], sigma: 10 urad, frame: machine}}
"""
PLANAR = f"""{TURNTABLE}
space: planar
ground: {{O: [0, 0]}}
bodies: {{hub: {{at: [0, 0], points: {{tip: [arm, 0]}}}}}}
joints: {{axle: {{between: [O, hub], type: revolute}}}}
actuators: {{q: {{turns: axle, zero: z0}}}}
sensors:
  tracker: {{kind: tcp, at: tip, reads: [x, y], sigma: 10 um, frame: machine}}
  gyro: {{kind: tcp, at: hub, reads: [rz], sigma: 10 urad, frame: machine}}
"""


@pytest.mark.parametrize("text", [SPATIAL, PLANAR], ids=["spatial", "planar"])
def test_turns_near_pi(text: str) -> None:
    """A turn of 180.1 deg reads -179.9 deg; errors of half a degree and noise put it on the other side."""
    machine, rng = model(text), np.random.default_rng(0)
    q = np.radians(np.linspace(170, 190, 41))[:, None]
    values = machine.nominal + np.array([np.radians(0.5), 5e-5])
    sigma = np.array([c.sigma for c in machine.channels])
    true = predict(machine, values, Rows.at(q)).values
    readings = true + rng.normal(size=true.shape) * sigma
    turned = readings[:, -1] / np.abs(readings[:, -1])
    assert set(turned) == {1.0, -1.0}
    problem = Problem(
        model=machine,
        rows=Rows.at(q),
        readings=readings,
        sigma=np.broadcast_to(sigma, true.shape),
        drive_sigma=0 * q,
        measured=np.ones(true.shape, dtype=bool),
    )
    fit = identify(problem, ("z0", "arm"))
    assert fit.status == "converged"
    assert np.abs((fit.values - values) / fit.std).max() < 4
    assert fit.chi2_per_dof == pytest.approx(1, abs=4 * np.sqrt(2 / fit.dof))
