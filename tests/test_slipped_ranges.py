"""Ranges that are wrong by orders of magnitude: what is held, what is believed, and what is told of them."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.calibration.range_scales import Evidence, drawn_scales
from pkmcal_cli.calibration.scale_start import first_factors
from tests.campaigns import shipped
from tests.command import MACHINES, Done, clean, run
from tests.hostile.campaigns.planted import measured

NAME, SEED, ROWS = "triglide-nonredundant", 5, 60


def calibrated(folder: Path, millimetres: str) -> Done:
    """A machine of an independent simulator, drawn with ranges of 0.1 mm, whose file states others."""
    machine, table = folder / "m.yaml", folder / "m.csv"
    machine.write_text(f"extends: {MACHINES / NAME}.yaml\nranges: {{length: {millimetres}}}\n", encoding="utf-8")
    table.write_text(measured(NAME, SEED, rows=ROWS).text(), encoding="utf-8")
    return clean(run("calibrate", machine, table, "--holdout", "none", "--json"))


@cache
def planted() -> dict[str, float]:
    """The drawn values, mm, as `measured` draws them."""
    plan, rng = shipped(NAME), np.random.default_rng([33, SEED])
    rng.choice(len(plan.positions), ROWS, replace=False)
    return {name: 1e3 * value for name, value in plan.model.by_name(plan.drawn(rng)).items()}


@pytest.mark.parametrize("millimetres", ["1e-3", "3e-4", "1e-4", "1e-5"])
def test_what_is_identified_does_not_depend_on_ranges_that_the_data_contradict(
    millimetres: str, tmp_path: Path
) -> None:
    done = calibrated(tmp_path, millimetres)
    assert done.code == 0 and done.json["status"] == "converged" and done.json["chi2_per_dof"] < 1.3
    off = [(p["value"] - planted()[p["name"]]) / p["std"] for p in done.json["parameters"]]
    assert len(off) == 6 and np.abs(off).max() < 3, off
    factor = done.json["uncertainty"]["ranges"]["factors"]["length"]
    assert 0.02 < factor * float(millimetres) < 0.3, "of the 0.1 mm with which the machine was drawn"
    assert "The ranges do not fit how far parameters are off nominal" in done.err
    assert "lacks an effect" not in done.err and "cannot be separated" not in done.err


def test_check_warns_of_ranges_that_no_workshop_keeps(tmp_path: Path) -> None:
    calibrated(tmp_path, "1e-4")
    assert "range of l1 = 0.0001 mm: did you mean 0.0001 m?" in run("check", tmp_path / "m.yaml").err
    calibrated(tmp_path, "1e-2")
    assert "range of l1" not in run("check", tmp_path / "m.yaml").err


def evidence(offsets: list[float], known: float) -> Evidence:
    """Lengths so many half ranges off, each measured to 1 / known of these, where a fit has held them at nominal."""
    q = len(offsets)
    noise = np.random.default_rng(1).normal(size=(40, q))
    jacobian = known / np.sqrt(40)
    readings = jacobian * np.array(offsets) + noise
    return Evidence(
        information=known**2 * np.eye(q)[None], score=jacobian * readings.sum(axis=0)[None],
        squares=np.array([(readings**2).sum()]), counts=np.array([40 * q]), freedom=np.array([10.0]),
        centre=np.zeros(q), kinds=("length",) * q, estimated=np.ones(q, dtype=bool),
    )  # fmt: skip


def test_draws_begin_where_they_arrive() -> None:
    """Offsets of thousands of half ranges that are known to hundreds: not noise; one that is wild widens no other."""
    far = evidence([4000.0, -2500.0, 1500.0, -6000.0, 3000.0], 0.01)
    assert first_factors(far) == pytest.approx(np.full(5, 4450.0), rel=0.1)
    found = drawn_scales(far, first_factors(far))
    assert 2000 < np.median(found.factors["length"]) < 6000 and 0.7 < found.typical_noise[0] < 1.4
    assert first_factors(evidence([6000.0, 1.0, -0.5, 0.8, 1.2], 10.0)) == pytest.approx(np.ones(5))
    assert first_factors(evidence([1.0, -2.0, 0.5, 0.8, 1.2], 10.0)) == pytest.approx(np.ones(5))


def test_directions_that_no_data_see_need_no_factor() -> None:
    """All parameters of the strained Scissors, four combinations of which nothing sees: there rounding is no offset."""
    machine, table = MACHINES / "scissors-strained.yaml", MACHINES / "scissors-strained.csv"
    done = run("calibrate", machine, table, "--select", "all", "--holdout", "none", "--json")
    assert done.code == 0, done.err
    assert 0.2 < done.json["uncertainty"]["ranges"]["factors"]["length"] < 3.0
