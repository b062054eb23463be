"""Fits of a part of the rows weigh ranges anew only where these could hold something: nothing else changes by it."""

from __future__ import annotations

import numpy as np
import pytest

from pkmcal_cli.calibration import complete_fit
from pkmcal_cli.calibration.complete_fit import FitOptions, refit
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.selection import select
from tests.campaigns import shipped


@pytest.mark.parametrize(("machine", "weighed"), [("scissors", 1), ("triglide", 2), ("triglide-nonredundant", 1)])
def test_part_of_the_rows_is_fitted_the_same(machine: str, weighed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """With the factors of all rows and without; where directions are held, by the ranges of the part."""
    plan, rng, drawn = shipped(machine), np.random.default_rng(3), []
    whole = plan.measured(plan.drawn(rng), rng)
    names, start = select(whole.model, "auto"), whole.model.nominal
    calibration = complete_fit.calibrated(whole, names, start, FitOptions(), np.zeros(len(whole)))
    budget = complete_fit.error_budget
    monkeypatch.setattr(complete_fit, "error_budget", lambda *a, **k: drawn.append(a) or budget(*a, **k))
    part = whole.take(np.nonzero(np.arange(len(whole)) % 5)[0])
    plain = refit(FitOptions(), part, names, start)
    assert (refit(FitOptions(), part, names, start, factors=calibration.budget.factors).values == plain.values).all()
    assert min(len(drawn), 2) == weighed
    assert (identify(part, names, start).values == plain.values).all() == (weighed == 1), "else ranges held nothing"


def test_what_ranges_nearly_hold_is_weighed() -> None:
    """The least determined direction of the Scissors is known 3.6 times better than its range, half of which holds."""
    plan, rng = shipped("scissors"), np.random.default_rng(3)
    whole = plan.measured(plan.drawn(rng), rng)
    fit = identify(whole, select(whole.model, "auto"))
    margin = fit.directions.singular_values.min() / 2.0
    ones = np.ones(len(fit.selected))
    assert complete_fit.far_from_held(whole, fit, 1.6 / margin * ones)
    assert not complete_fit.far_from_held(whole, fit, 1.4 / margin * ones)
