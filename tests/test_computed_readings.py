"""Readings that agree better than noise allows: of simulations users are warned, set values are mistakes."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.command import TRIGLIDE, Done, clean, run

pytestmark = pytest.mark.usefixtures("unsized")

OFF = "parameters: {l1: 300.05, l2: 299.96, yb1r: 100.03, xb2r: 0.04, yb3r: 149.95}\n"
NOMINAL = "parameters: {}\n"


def calibrated(folder: Path, parameters: str, decimals: int) -> Done:
    """A calibration of exact readings of the Triglide with these parameters, rounded, which nothing says to be such."""
    (folder / "p.yaml").write_text(parameters, encoding="utf-8")
    made = clean(run("simulate", TRIGLIDE, "--grid", "x=300:600:6,y=200:350:5", "-p", folder / "p.yaml", "-q")).out
    text = "\n".join(line for line in made.splitlines() if not line.startswith("#")) + "\n"
    rounded = re.sub(r"-?\d+\.\d+(e-?\d+)?", lambda m: f"{float(m[0]):.{decimals}f}", text)
    (folder / "t.csv").write_text(rounded, encoding="utf-8")
    return clean(run("calibrate", TRIGLIDE, folder / "t.csv", "--holdout", "none", "--json"))


@pytest.mark.parametrize("decimals", [4, 6, 12])
def test_a_simulation_of_another_program_is_no_mistake(tmp_path: Path, decimals: int) -> None:
    """Exact readings of a machine that is off as its ranges say: a warning tells."""
    done = calibrated(tmp_path, OFF, decimals)
    assert done.code == 0 and done.json["status"] == "converged", done.err
    assert "smaller than the stated noise: computed, not measured" in done.err


def test_set_values_are_no_readings(tmp_path: Path) -> None:
    """Places that were commanded, noted as measured: the nominal machine leaves nothing of them."""
    done = calibrated(tmp_path, NOMINAL, 4)
    assert done.code == 1 and done.json["status"] == "implausible"
    assert "set values instead of measurements" in done.err
    diagnosis = clean(run("diagnose", TRIGLIDE, tmp_path / "t.csv", "--json"))
    assert diagnosis.code == 1 and "set values instead of measurements" in diagnosis.err


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_a_channel_that_was_not_read_is_no_matter(tmp_path: Path) -> None:
    calibrated(tmp_path, OFF, 6)
    head, *rows = (tmp_path / "t.csv").read_text(encoding="utf-8").splitlines()
    at = [cell.split(" ")[0] for cell in head.split(",")].index("y")
    cells = [[cell if k != at else "" for k, cell in enumerate(row.split(","))] for row in rows]
    (tmp_path / "x.csv").write_text("\n".join([head, *map(",".join, cells)]) + "\n", encoding="utf-8")
    done = clean(run("calibrate", TRIGLIDE, tmp_path / "x.csv", "--holdout", "none", "--json", "--select", "l1,yb1r"))
    assert "deviations of `x` are" in done.err and "`y` are" not in done.err
