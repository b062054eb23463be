"""Fits whose steps never end, as a direction that is held turns on the way; and what further starts may not hide."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.calibration.condensed import condensed
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.selection import select
from pkmcal_cli.calibration.starts import best_of_starts
from pkmcal_cli.calibration.step import Scaled, creeps
from tests.campaigns import shipped
from tests.command import run

_DATA = Path(__file__).parent / "data"
STAGE, TABLE = _DATA / "rpr4.yaml", _DATA / "rpr4.csv"
"""A redundant planar stage, and 60 rows of it by a simulator that minimises energy: leg 3 grows at once."""


@pytest.mark.parametrize("starts", ["0", "4"])
def test_a_lag_that_is_not_seen_is_no_reason_to_end_elsewhere(starts: str) -> None:
    """All 60 steps were taken, each gaining less; a false minimum, 5 ranges off, was the best of further starts."""
    fit = run("calibrate", STAGE, TABLE, "--holdout", "none", "--starts", starts, "--json").json
    assert (fit["status"], fit["stopped"]) == ("converged", "noise") and 0.85 < fit["chi2_per_dof"] < 1.15
    by_name = {p["name"]: p for p in fit["parameters"]}
    for name, true in (("backlash@q2.b", 30.0), ("thermal_strut@leg3.a", 11.5), ("scale@q1.s", 200.0)):
        assert abs(by_name[name]["value"] - true) < 3 * by_name[name]["std"], name
    assert abs(by_name["p1x"]["value"] + 120) < 0.1, "within its range"


def test_steps_that_gain_are_taken_and_so_are_all_where_nothing_is_held() -> None:
    plan, rng = shipped("triglide"), np.random.default_rng(3)
    held = plan.measured(plan.drawn(rng), rng)
    names = select(held.model, "auto")
    fit, scale = identify(held, names), Scaled.of(held, names)
    end = condensed(held, fit.last)
    slow = [fit.chi2 + 1e-4 * k for k in range(9, -1, -1)]
    assert fit.directions.weak.any() and creeps(held, scale, end, slow) == "noise"
    assert creeps(held, scale, end, slow[-8:]) == "", "too few to tell"
    assert creeps(held, scale, end, [fit.chi2 + 0.1 * k for k in range(9, -1, -1)]) == ""
    sharp = replace(end, jacobian=end.jacobian * 1e4)
    assert creeps(held, scale, sharp, slow) == "", "nothing is held"


def test_the_best_of_starts_is_none_that_another_leaves_far_behind() -> None:
    """One that has not converged, but explains much more, shows that the others have ended in a false minimum."""
    plan, rng = shipped("triglide-nonredundant"), np.random.default_rng(3)
    problem = plan.measured(plan.drawn(rng), rng)
    names, start = select(problem.model, "auto"), problem.model.nominal
    noisy = replace(problem, sigma=problem.sigma / 3.0)
    end = replace(identify(noisy, names), status="not_converged")
    beaten = replace(end, chi2=end.chi2 - 20.0 * end.excess)
    assert end.excess > 1.0
    assert best_of_starts(noisy, names, start, beaten, 2, seed=0)[0].status == "not_converged"  # type: ignore[union-attr]
    assert best_of_starts(noisy, names, start, end, 2, seed=0)[0].status == "converged"  # type: ignore[union-attr]
