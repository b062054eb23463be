"""Effects of the catalogue against an independent energy minimisation, which has no code in common with the engine."""

from __future__ import annotations

import numpy as np
import pytest

from pkmcal_cli.prediction import predict
from tests.benchmark.setting import ready
from tests.truth.campaigns import MACHINES, Scenario, campaign, families, unit

EXACT = 2e-3  # of the effect: the simulator moves feet and turns carriages exactly, small angles and lengths here
SHAPED = {"pitch_curve": 0.2, "drift": 0.05, "straight": 0.05, "unequal_backlash": 0.01, "carriage_angle": 0.01}
"""The simulator makes these shapes of harmonics (or of an exponential), the catalogue of polynomials."""
SMOOTHED = {"clearance": 0.7, "windup": 0.05}
"""Signs and sizes of forces are smoothed over other forces."""


@pytest.mark.parametrize("machine", MACHINES)
def test_effects_do_what_they_do_in_the_independent_simulator(machine: str) -> None:
    plain = Scenario(extra=0)
    still = campaign(machine, [], 3, rows=30, scenario=plain)
    for keyword, at in families(machine):
        planted = unit(machine, keyword, at, 3)
        moved = campaign(machine, [planted], 3, rows=30, scenario=plain)
        here = ready(moved)
        model, rows = here.problem.model, here.problem.rows
        values = model.nominal
        values[[model.names.index(n) for n in moved.parameters]] = list(moved.parameters.values())
        null = predict(model, values, rows).values
        for name, value in planted.values.items():
            if name != "period":
                values[model.names.index(f"{keyword}@{at}.{name}")] = value
        change = predict(model, values, rows).values - null
        true = moved.true_readings - still.true_readings
        tolerance = max(EXACT, SHAPED.get(keyword, 0.0), SMOOTHED.get(keyword, 0.0))
        assert np.abs(change - true).max() < tolerance * np.abs(true).max(), f"{keyword}@{at}"
