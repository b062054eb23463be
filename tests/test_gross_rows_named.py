"""`calibrate` names rows of 8 sigma and more, in small tables too; `diagnose` tells one size and one p value of the
same rows; a sigma far too large has a warning."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from tests.campaign_tables import true_values, write_table
from tests.command import MACHINES, Done, run

pytestmark = pytest.mark.usefixtures("unsized")

PLAIN = "triglide-nonredundant"
SIGMA = 0.01  # mm


def spoilt(file: Path, rows: int, seed: int, sizes: Sequence[float], tails: bool = False) -> list[int]:
    """A table by an independent simulator with one coordinate of some rows off by so many sigmas; lines of these."""
    write_table(file, PLAIN, true_values(PLAIN, seed), seed, rows)
    rng = np.random.default_rng([seed, 8])
    head, *lines = file.read_text().splitlines()
    cells = [line.split(",") for line in lines]
    if tails:
        for row in cells:
            row[2:] = [str(float(v) + SIGMA * (rng.standard_t(4) / np.sqrt(2) - 0.0)) for v in row[2:]]
    bad = rng.choice(rows, len(sizes), replace=False)
    for row, size in zip(bad, sizes, strict=True):
        k = int(rng.choice([2, 3]))
        cells[row][k] = str(float(cells[row][k]) + rng.choice([-1, 1]) * size * SIGMA)
    file.write_text("\n".join([head, *(",".join(row) for row in cells)]) + "\n")
    return sorted(int(row) + 2 for row in bad)


def calibrated(file: Path, *more: str, machine: str | Path = PLAIN) -> Done:
    named = machine if machine != PLAIN else MACHINES / f"{PLAIN}.yaml"
    return run("calibrate", named, file, "--holdout", "none", "--json", *more)


@pytest.mark.parametrize("rows", [12, 30])
def test_three_rows_of_some_sigma_are_named_and_the_fit_stays_usable(tmp_path: Path, rows: int) -> None:
    lines = spoilt(tmp_path / "t.csv", rows, 3, [9.0, 11.0, 13.0])
    done = calibrated(tmp_path / "t.csv")
    assert [row["line"] for row in done.json["far_rows"]] == lines
    assert "3 rows are far from what the other rows predict" in done.err
    assert done.code == 0 and done.json["status"] != "implausible"


def test_rows_of_all_sizes_are_named_together(tmp_path: Path) -> None:
    """Large ones do not hide those of 12 sigma."""
    lines = spoilt(tmp_path / "t.csv", 200, 5, np.linspace(12, 30, 10).tolist())
    done = calibrated(tmp_path / "t.csv")
    assert [row["line"] for row in done.json["far_rows"]] == lines
    assert done.code == 1 and done.json["status"] == "implausible"


@pytest.mark.slow
@pytest.mark.parametrize("tails", [False, True])
def test_good_rows_are_not_named(tmp_path: Path, tails: bool) -> None:
    """Fewer than 0.5 % of good rows in 200 tables; normal noise, and normal noise with as much of t4."""
    named = total = 0
    for seed in range(200):
        rows = (12, 30)[seed % 2]
        spoilt(tmp_path / "t.csv", rows, seed, [], tails)
        named += len(calibrated(tmp_path / "t.csv").json["far_rows"])
        total += rows
    assert named < 0.005 * total


def test_size_and_p_value_of_residuals_are_of_the_same_rows(tmp_path: Path) -> None:
    """Of rows that are used: about 1 times the noise, with a p value of that; then what bad rows make of it."""
    lines = spoilt(tmp_path / "t.csv", 200, 5, np.linspace(20, 40, 8).tolist())
    machine = MACHINES / f"{PLAIN}.yaml"
    result = run("diagnose", machine, tmp_path / "t.csv", "--json").json
    assert [row["line"] for row in result["outliers"]] == lines and result["verdict"] == "measurement_fault"
    assert 0.8 < result["chi2_per_dof_before"] < 1.25 and result["p_value"] > 0.01
    text = run("diagnose", machine, tmp_path / "t.csv").err
    of_used = r"are ([\d.]+) times the stated noise: .*, p ([\d.e-]+)\)"
    sizes = re.search(of_used + r"\. With 8 bad rows they are ([\d.]+)", text)
    assert sizes is not None, text
    used, p, every = map(float, sizes.groups())
    assert 0.9 < used < 1.12 and p > 0.01 and every > 2.0


@pytest.mark.parametrize(("stated", "times"), [("0.3 mm", 30.0), pytest.param("3 mm", 300.0, marks=pytest.mark.slow)])
def test_a_sigma_far_too_large_has_a_warning(tmp_path: Path, stated: str, times: float) -> None:
    """Also where it is so large that nothing can be identified: the factor is that of what a fit would leave."""
    write_table(tmp_path / "t.csv", PLAIN, true_values(PLAIN, 2), 2, 80)
    machine = tmp_path / "m.yaml"
    machine.write_text(f"extends: {MACHINES / PLAIN}.yaml\nsensors: {{tracker: {{sigma: {stated}}}}}\n")
    done = calibrated(tmp_path / "t.csv", machine=machine)
    factors = done.json["uncertainty"]["overstated"]
    if done.err.count("wrong unit"):  # told as readings that are too exact for any measurement
        factors = dict.fromkeys("xy", times)
    assert factors == pytest.approx(dict.fromkeys("xy", times), rel=0.25), done.err
    assert "times smaller than" in done.err and "unit" in done.err
    diagnosis = run("diagnose", machine, tmp_path / "t.csv")
    assert "times smaller than its stated noise: check the unit" in diagnosis.err


def test_a_column_of_sigma_in_the_wrong_unit_is_named(tmp_path: Path) -> None:
    """One of two: the other keeps its noise."""
    write_table(tmp_path / "t.csv", PLAIN, true_values(PLAIN, 2), 2, 80)
    head, *lines = (tmp_path / "t.csv").read_text().splitlines()
    text = [f"{head},sigma.x [mm],sigma.y [mm]", *(f"{line},0.2,0.01" for line in lines)]
    (tmp_path / "t.csv").write_text("\n".join(text) + "\n")
    done = calibrated(tmp_path / "t.csv")
    assert done.json["uncertainty"]["overstated"] == pytest.approx({"x": 20.0}, rel=0.25)
    assert "(x)" in done.err and "`sigma.x`" in done.err


def test_a_right_sigma_has_no_warning(tmp_path: Path) -> None:
    write_table(tmp_path / "t.csv", PLAIN, true_values(PLAIN, 2), 2, 80)
    done = calibrated(tmp_path / "t.csv")
    assert done.json["uncertainty"]["overstated"] == {} and "stated noise" not in done.err
