"""Corrections on a shop floor: two temperatures, both sides of approach, and effects that the model lacks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from tests.command import Done, column, run
from tests.correction_cases import csv_text, rms
from tests.in_ci import in_ci
from tests.support import MACHINES
from tests.truth.campaigns import Planted, Scenario, campaign
from tests.truth.dimensions import SCISSORS
from tests.truth.pinned import Array
from tests.truth.shop_plans import PLANS
from tests.truth.shop_truth import truth

PLAN = PLANS["scissors"]
BACKLASH, GROWTH = Planted("backlash", "q3", {"b": 12e-6}), Planted("thermal_strut", "all", {"a": 9e-6})
SCENARIO = Scenario(sessions=1, payload=3.0, omit=("session", "payload"), extra=0.0)
_FIXED = ", ".join(f"{n}: {{fixed: true}}" for n in SCISSORS if n not in PLAN.identified)
PLAIN = f"extends: {MACHINES}/scissors.yaml\nparameters: {{{_FIXED}}}\n"
DECLARED = PLAIN + ("effects:\n  backlash@q3: {b: 0}\n  thermal_strut@all: {a: 0, lag: {value: 0, identify: false}}\n")
ROWS = 40
WARM = np.where(np.arange(ROWS) % 2, 17.0, 23.5)  # degC
SIDES = np.stack([np.ones(ROWS), -np.ones(ROWS), np.where(np.arange(ROWS) // 2 % 2, 1.0, -1.0), np.ones(ROWS)], axis=1)


@dataclass(frozen=True)
class Outcome:
    """True errors of the tool point (N, 2) at the commands, their stated standard uncertainties, what was said."""

    error: Array
    stated: Array
    done: Done


def outcome(folder: Path, seed: int, text: str, planted: Sequence[Planted]) -> Outcome:
    """A campaign, its calibration with a machine file, and corrected targets on the true machine."""
    measured = campaign("scissors", planted, seed, 120, SCENARIO)
    (folder / "m.yaml").write_text(text)
    (folder / "d.csv").write_text(measured.csv_text())
    options = ("-q", "--holdout", "none", "-o", folder / "p.yaml", "--force")
    calibration = run("calibrate", folder / "m.yaml", folder / "d.csv", *options)
    assert calibration.code == 0, calibration.err
    targets = np.random.default_rng(seed).uniform(-0.18, 0.18, (ROWS, 2))
    head = ["x [mm]", "y [mm]", "T [degC]", "dir.q1", "dir.q2", "dir.q3", "dir.q4"]
    (folder / "t.csv").write_text(csv_text(head, np.hstack([1e3 * targets, WARM[:, None], SIDES])))
    out = folder / "c.csv"
    done = run("correct", folder / "m.yaml", folder / "t.csv", "-p", folder / "p.yaml", "-o", out, "--force")
    assert done.code == 0, done.err
    commands = 1e-3 * np.stack([column(out, q) for q in PLAN.drives], axis=1)
    here = replace(
        measured.conditions, poses=np.pad(targets, ((0, 0), (0, 1))), q=commands, time=np.zeros(ROWS), temperature=WARM,
        session=np.ones(ROWS, dtype=np.intp), payload=np.full(ROWS, 3.0), direction=SIDES, part={},
    )  # fmt: skip
    geometry = PLAN.geometry({**PLAN.nominal, **measured.parameters})
    found = truth(PLAN, geometry, here, planted, extra=0.0, seed=seed, reference=measured.conditions)
    stated = 1e-6 * np.stack([column(out, f"u.{c}") for c in "xy"], axis=1)
    return Outcome(found.readings - targets, stated, done)


def test_two_temperatures_and_both_sides_of_approach(tmp_path: Path) -> None:
    """What is left is what noise leaves in the parameters: at most 1.2 times their stated uncertainty."""
    found = [outcome(tmp_path, seed, DECLARED, (BACKLASH, GROWTH)) for seed in range(6)]
    floor = np.sqrt(np.mean([rms(o.stated) ** 2 for o in found]))
    assert np.sqrt(np.mean([rms(o.error) ** 2 for o in found])) < 1.2 * floor < 0.4e-6


@pytest.mark.parametrize(
    ("name", "planted"), [("backlash", BACKLASH), pytest.param("growth", GROWTH, marks=pytest.mark.slow)]
)
@pytest.mark.parametrize("size", in_ci(["1.0"], [0.3, 1.0]))
def test_an_effect_that_the_model_lacks_is_in_the_uncertainty(
    name: str, planted: Planted, size: float, tmp_path: Path
) -> None:
    """95 % intervals hold nine of ten true errors or more (these are no normal ones), and it is said."""
    inside = []
    for seed in range(3):
        found = outcome(tmp_path, seed, PLAIN, (planted.scaled(size),))
        assert "something is missing" in found.done.err, name
        inside.append((np.abs(found.error) < 1.96 * found.stated).mean())
    assert np.mean(inside) > 0.89
