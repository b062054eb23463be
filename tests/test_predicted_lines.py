"""Positioning along lines as a model predicts it: none where the machine is as the control has it."""

from __future__ import annotations

import numpy as np
import pytest

from pkmcal_cli.calibration.predicted_lines import predicted_lines
from pkmcal_cli.loading.covariates import at_rest
from pkmcal_cli.prediction import Rows
from tests.campaigns import shipped


@pytest.mark.parametrize("name", ["biglide", "scissors"])
def test_a_nominal_machine_has_no_deviation(name: str) -> None:
    """Exactly: what rounding leaves is no figure. With a length that is off, there are some."""
    plan = shipped(name)
    model, problem = plan.model, plan.problem(plan.simulate(plan.model.nominal))
    rest = at_rest(model, Rows.at(model.reference_readings[None]))
    lines = predicted_lines(problem, model.nominal, rest)
    assert lines and [figure for x in lines for figure in (x.E, x.M, x.B)] == [0.0] * 3 * len(lines)
    off = model.nominal + 1e-4 * (np.array(model.names) == plan.selected[0])
    assert any(x.E > 1e-6 for x in predicted_lines(problem, off, rest))
