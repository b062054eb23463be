"""Measurements bound to a model: columns of sigma, copies of rows, correlated channels, noise that grows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.calibration.measured_problem import problem_of
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.loading.load_machine import load_machine, load_measurements
from tests.command import HANGPRINTER, HANGPRINTER_DATA, MACHINES, run


def bound(machine: str | Path, table: str | Path) -> Problem:
    loaded = load_machine(str(machine))
    return problem_of(loaded.model, load_measurements(loaded, [str(table)]))


def with_column(table: str, folder: Path, heading: str, cell: str) -> Path:
    lines = [line for line in Path(table).read_text(encoding="utf-8").splitlines() if line[:1] != "#"]
    file = folder / "table.csv"
    file.write_text("\n".join([f"{lines[0]},{heading}", *(f"{line},{cell}" for line in lines[1:])]), encoding="utf-8")
    return file


def test_a_column_of_sigma_says_the_same_as_the_machine_file(tmp_path: Path) -> None:
    """1 mm of line, whether the drive holds its position (A) or is in force control and read (D)."""
    plain = bound(HANGPRINTER, HANGPRINTER_DATA)
    for drive in "AD":
        found = bound(HANGPRINTER, with_column(HANGPRINTER_DATA, tmp_path, f"sigma.{drive} [mm]", "1"))
        np.testing.assert_allclose(found.sigma, plain.sigma, rtol=1e-12)
        np.testing.assert_allclose(found.drive_sigma, plain.drive_sigma, rtol=1e-12)


def test_copies_of_rows_are_used_once(tmp_path: Path) -> None:
    """The bench length, which stands in the first row, does not hide that this row is copied, too."""
    machine, table = tmp_path / "m.yaml", tmp_path / "t.csv"
    base = MACHINES / "delta-printer.yaml"
    machine.write_text(
        f"extends: {base}\nsensors: {{rule: {{kind: bench, of: rod, reading: 288, sigma: 0.1 mm}}}}\n", encoding="utf-8"
    )
    lines = (MACHINES / "delta-printer.csv").read_text(encoding="utf-8").splitlines()
    table.write_text("\n".join([*lines, *(line for line in lines[1:] if line[:1] not in ("#", "i"))]), encoding="utf-8")
    once, twice = (
        run("calibrate", machine, file, "--select", "all", "--json", "--holdout", "none")
        for file in (MACHINES / "delta-printer.csv", table)
    )
    assert "11 rows are exact copies of another" in twice.err and "not used" in twice.err
    for a, b in zip(once.json["parameters"], twice.json["parameters"], strict=True):
        assert (b["value"], b["std"]) == pytest.approx((a["value"], a["std"]), rel=1e-6)


def test_covariance_of_correlated_channels_and_noise_that_grows(tmp_path: Path) -> None:
    """Variance 10^2 + (20 um/m of the distance)^2; half of it common to x and y."""
    machine = tmp_path / "m.yaml"
    machine.write_text(
        f"extends: {MACHINES / 'scissors.yaml'}\n"
        "sensors: {grid: {sigma: 10 um, sigma_per_length: 20 um/m, correlation: {x_y: 0.5}}}\n",
        encoding="utf-8",
    )
    problem = bound(machine, MACHINES / "scissors.csv")
    far = np.hypot(*problem.readings[:, :2].T)
    variance = 1e-10 + (20e-6 * far) ** 2
    whole = variance[:, None, None] * np.array([[1, 0.5], [0.5, 1]])
    np.testing.assert_allclose(problem.noise[:, :2, :2], whole, rtol=1e-9)


def test_values_of_sessions_are_simulated_and_recovered(tmp_path: Path) -> None:
    """A draw wire whose zero is another one in the afternoon: planted by hand, simulated in one table, found again."""
    machine, poses, planted, table = (tmp_path / n for n in ("m.yaml", "p.csv", "v.yaml", "t.csv"))
    machine.write_text(
        f"extends: {MACHINES / 'scissors.yaml'}\n"
        "parameters: {w0: {nominal: 100, range: 20, per: session}}\n"
        "ground: {drum: [0, -900]}\n"
        "sensors: {grid: {sigma: 1 um}, wire: {kind: distance, at: platform, to: drum, zero: w0, sigma: 50 um}}\n",
        encoding="utf-8",
    )
    rows = [f"{'ab'[k % 2]},{x},{y}" for k, (x, y) in enumerate(np.ndindex(6, 5))]
    rows = [f"{s},{-200 + 80 * int(x)},{-180 + 90 * int(y)}" for s, x, y in (row.split(",") for row in rows)]
    poses.write_text("session,x [mm],y [mm]\n" + "\n".join(rows), encoding="utf-8")
    planted.write_text('parameters: {"w0[a]": 95, "w0[b]": {value: 0.107, unit: m}}\n', encoding="utf-8")
    done = run("simulate", machine, poses, "-p", planted, "--noise", "declared", "-o", table)
    assert done.code == 0 and "not used" not in done.err
    found = {p["name"]: p for p in run("calibrate", machine, table, "--json", "--holdout", "none").json["parameters"]}
    for name, true in (("w0[a]", 95.0), ("w0[b]", 107.0)):
        assert abs(found[name]["value"] - true) < 4 * found[name]["std"] < 0.1
    held = run("calibrate", machine, table, "--json", "--holdout", "session").json["heldout"]
    assert held["after"]["distance"]["rms"] < 0.1 and held["after"]["distance"]["unit"] == "mm"
    assert "w0[a], w0[b] fitted to the held-out rows" in held["scheme"]
