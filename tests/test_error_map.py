"""Uncertainty of the TCP after a calibration: what parameters drawn from the covariance do, and what errors show."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.model.tool_channels import tcp_model
from pkmcal_cli.prediction import Request, Rows, predict
from tests.campaigns import by_engine, shipped
from tests.command import TRIGLIDE, TRIGLIDE_DATA, run

GRID = "x=250:650:4,y=180:360:3"


def written(file: Path) -> tuple[list[str], Array]:
    rows = list(csv.reader(line for line in file.read_text().splitlines() if line[:1] != "#"))
    return rows[0], np.array([[float(c) for c in row[1:]] for row in rows[1:]])


def test_the_map_is_what_parameters_drawn_from_the_file_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """3000 draws from the covariance that the file states: 4 % on a standard deviation."""
    monkeypatch.chdir(tmp_path)
    assert run("calibrate", TRIGLIDE, TRIGLIDE_DATA, "-o", "p.yaml", "--holdout", "none", "-q").code == 0
    done = run("simulate", TRIGLIDE, "--grid", GRID, "-p", "p.yaml", "--uncertainty", "-o", "map.csv")
    assert done.code == 0 and "uncertainty of the TCP position from the calibration" in done.err
    head, table = written(tmp_path / "map.csv")
    assert head[-2:] == ["u.x [um]", "u.y [um]"]
    from pkmcal_cli.loading.load_machine import load_machine, load_parameters

    machine = load_machine(TRIGLIDE).model
    start = load_parameters(machine, "p.yaml")
    assert start.covariance is not None
    names, covariance = start.covariance
    size = np.sqrt(np.diag(covariance))  # stiffnesses beside lengths
    shares = covariance / np.outer(size, size)
    drawn = size * np.random.default_rng(0).multivariate_normal(np.zeros(len(names)), shares, 3000, method="eigh")
    rows = Rows.at(table[:, :3] * 1e-3)
    found = predict(tcp_model(machine), start.values, rows, Request(parameters=names))
    assert found.jacobian is not None
    moved = found.jacobian @ drawn.T  # (N, 2, R)
    assert table[:, -2:] == pytest.approx(moved.std(axis=2) * 1e6, rel=0.06)


@pytest.mark.slow
def test_errors_at_new_positions_are_as_large_as_the_map_says() -> None:
    """60 campaigns on the Scissors, 30 positions each: errors over uncertainties have the rms 1 within 8 %."""
    plan = by_engine(shipped("scissors"))
    away = plan.positions[:30] + 1e-3 * np.random.default_rng(7).normal(size=plan.positions[:30].shape) @ np.diag(
        [1, 0, 0, 1]
    )
    ratios = []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        true = plan.drawn(rng)
        fit = identify(plan.measured(true, rng), plan.selected)
        names = fit.selected
        told = predict(plan.model, fit.values, Rows.at(away), Request(parameters=names))
        seen = predict(plan.model, true, Rows.at(away)).values
        assert told.jacobian is not None
        covariance = fit.directions.determined_covariance()
        u = np.sqrt(np.einsum("ncp,pq,ncq->nc", told.jacobian, covariance, told.jacobian))
        ratios.append((told.values - seen) / u)
    assert np.sqrt(np.mean(np.square(ratios))) == pytest.approx(1.0, abs=0.08)


def test_without_a_calibration_there_is_no_map(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert run("simulate", TRIGLIDE, "--grid", GRID, "--uncertainty").code == 2
    Path("bare.yaml").write_text("parameters: {l1: 300.01}\n")
    done = run("simulate", TRIGLIDE, "--grid", GRID, "--uncertainty", "-p", "bare.yaml")
    assert done.code == 3 and "correlations" in done.err


def test_where_no_row_has_a_solution_the_map_is_empty(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert run("calibrate", TRIGLIDE, TRIGLIDE_DATA, "-o", "p.yaml", "--holdout", "none", "-q").code == 0
    short = re.sub(r"(?m)^( +l1: .*?)3\d\d\.", r"\g<1>1.", Path("p.yaml").read_text())
    Path("p.yaml").write_text(short)
    done = run("simulate", TRIGLIDE, TRIGLIDE_DATA, "-p", "p.yaml", "--uncertainty", "-o", "map.csv")
    assert done.code == 1 and "uncertainty of the TCP position: not available" in done.err, done.err
    assert not written(tmp_path / "map.csv")[1].size
