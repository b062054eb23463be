"""Effects of the catalogue against an independent energy minimisation, which has no code in common with the engine."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pkmcal_cli.effects.effect import DURING
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import predict
from tests.benchmark.setting import ready
from tests.in_ci import in_ci
from tests.truth.campaigns import MACHINES, Planted, Scenario, campaign, families, unit
from tests.truth.families_true import PERIOD, across
from tests.truth.shop_plans import PLANS

EXACT = 2e-3  # of the effect: the simulator moves feet and turns carriages exactly, small angles and lengths here
SHAPED = {"pitch_curve": 0.2, "straight": 0.05, "unequal_backlash": 0.01, "carriage_angle": 0.01}
"""The simulator makes these shapes of harmonics, the catalogue of polynomials."""
SMOOTHED = {"clearance": 0.7, "windup": 0.05}
"""Signs and sizes of forces are smoothed over other forces."""


def not_drawn(machine: str) -> list[Planted]:
    """What the benchmark does not draw: drifting zeros, those of a session, errors twice a period, shifted guides."""
    drives, guides = PLANS[machine].drives, across(PLANS[machine])
    return [
        *(Planted("zero_drift", q, {"o1": 40e-6, "o2": -25e-6}) for q in drives),
        *(Planted("zero", f"{q}[s2]", {"o": 50e-6}) for q in drives),
        *(Planted("pitch", q, {"c2": 6e-6, "s2": -9e-6, "period": PERIOD.get(machine, 0.01)}) for q in drives),
        *(Planted("straight", place, {"n0": 60e-6}) for place in guides),
    ]


def over_the_day(model: Model, length: float) -> Model:
    """The model whose drifts cover the whole day, s, not only the rows of the table."""
    options = (
        {**e.options, "during": (0.0, length)} if DURING in e.effect.options else e.options for e in model.effects
    )
    return model.with_options(tuple(replace(e, options=o) for e, o in zip(model.effects, options, strict=True)))


@pytest.mark.parametrize("machine", in_ci(["triglide"], MACHINES))
def test_effects_do_what_they_do_in_the_independent_simulator(machine: str) -> None:
    plain = Scenario(extra=0)
    still = campaign(machine, [], 3, rows=30, scenario=plain)
    for planted in [*(unit(machine, keyword, at, 3) for keyword, at in families(machine)), *not_drawn(machine)]:
        keyword, at = planted.keyword, planted.at
        moved = campaign(machine, [planted], 3, rows=30, scenario=plain)
        here = ready(moved)
        model, rows = over_the_day(here.problem.model, still.conditions.air.length), here.problem.rows
        values = model.nominal
        values[[model.names.index(n) for n in moved.parameters]] = list(moved.parameters.values())
        null = predict(model, values, rows)
        for name, value in planted.values.items():
            if name != "period":
                values[model.names.index(f"{keyword}@{at}.{name}")] = value
        change = predict(model, values, rows, start=null.start).values - null.values
        true = moved.true_readings - still.true_readings
        tolerance = max(EXACT, SHAPED.get(keyword, 0.0), SMOOTHED.get(keyword, 0.0))
        assert np.abs(change - true).max() < tolerance * np.abs(true).max(), f"{keyword}@{at}"
