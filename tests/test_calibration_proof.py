"""What is planted is found again, and the intervals hold it: on data of the independent simulators."""

from __future__ import annotations

from functools import cache

import numpy as np
import pandas as pd
import pytest

from pkmcal_cli.calibration.identifiability import combinations
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.report.parameters import determined_sums
from tests.campaigns import (
    COVER,
    Coverage,
    by_engine,
    campaigns,
    coverage,
    planted,
    shipped,
)
from tests.command import ROOT
from tests.coverage_table import COUNT, MACHINES, SEED
from tests.in_ci import in_ci
from tests.truth.machines import PINNED

# without noise --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", in_ci(PINNED, [*PINNED, "hexapod7"]))
def test_planted_parameters_are_recovered(name: str) -> None:
    """To 1e-6 of the range, all of them: sigma is 1 pm, nothing is weak.

    The simulators are good to 1e-15 m, the hexapod's chains of 16 springs a beam to 1e-13 m. Of delta4 each R and r are
    told apart by 0.2 nm a range only (the tilt that unequal arms cause), so that these 1e-15 m are 1e-7 of the range.
    """
    _, fit, errors = planted(name)
    assert fit.status == "converged"
    assert not fit.directions.held.any()
    assert np.abs(errors).max() < 1e-6


# with noise -----------------------------------------------------------------------------------------------------------


@cache
def quick(name: str) -> Coverage:
    """60 campaigns by the engine (which agrees with the independent simulators to 1e-11 m)."""
    return campaigns(by_engine(shipped(name)), 60, SEED)



@pytest.mark.parametrize("name", in_ci(["biglide"], ["triglide", "biglide", "delta4", "hangprinter"]))
def test_intervals_hold_the_true_values(name: str) -> None:
    """95 % of them, within four standard deviations of chance: 60 campaigns, parameters going together as they do.

    A parameter's own count of 60 is binomial: below 47 has a probability of 1e-6. Scores have a mean square of one,
    within four standard deviations of that of 60 independent ones.
    """
    found = quick(name).determined()
    assert found.converged == 60
    assert abs(found.inside.mean() - 0.95) < 4 * max(found.scatter, 0.01)
    assert found.inside.min() >= 47 / 60
    assert (found.scores**2).mean() == pytest.approx(1, abs=4 * np.sqrt(2 / 60))


@pytest.mark.parametrize("name", in_ci(["biglide"], ["triglide", "biglide", "delta4", "hangprinter"]))
def test_chi_square_of_noise_is_one(name: str) -> None:
    """Per degree of freedom, within four standard deviations; a combination held adds a quarter of s^2, below one.

    Where what is not identified is nominal.
    """
    found = campaigns(by_engine(shipped(name)), 20, SEED, every=False)
    least = 1 - 4 * np.sqrt(2 / found.dof[0] / 20)
    most = 2 - least + (found.held / found.dof).mean()
    assert least < found.chi2_per_dof < most


@pytest.mark.slow
def test_determined_sums_are_held_too() -> None:
    """R - r of delta4, where R and r are not determined."""
    plan, inside = by_engine(shipped("delta4")), []
    for k in range(20):
        rng = np.random.default_rng([SEED, k])
        values = plan.drawn(rng)
        fit = identify(plan.measured(values, rng), plan.selected)
        for combination in combinations(fit.directions):
            for coefficients, value, std, unit in determined_sums(plan.model, combination, fit):
                assert unit == "mm"
                true = sum(c * values[plan.model.names.index(n)] for n, c in coefficients.items()) * 1e3
                inside.append(abs(value - true) < COVER * std)
    assert len(inside) == 4 * 20
    assert np.mean(inside) > 0.95 - 4 * np.sqrt(0.95 * 0.05 / len(inside))


def test_a_bad_sigma_is_told_by_chi_square() -> None:
    """Noise of twice the declared sigma: 4 per degree of freedom."""
    plan, rng = by_engine(shipped("triglide")), np.random.default_rng(0)
    values = plan.drawn(rng)
    readings = plan.simulate(values) + 2 * rng.normal(size=(231, 2)) * plan.sigma
    fit = identify(plan.problem(readings), plan.selected)
    assert fit.chi2_per_dof == pytest.approx(4, abs=4 * 4 * np.sqrt(2 / fit.dof))


@pytest.mark.slow
@pytest.mark.parametrize("name", MACHINES)
def test_500_campaigns(name: str) -> None:
    """93 to 97 % on average over a machine's parameters, none below 91 %, with the seed of docs/coverage.md."""
    found = coverage(name, COUNT, SEED)
    some = found.determined()
    assert found.converged == COUNT
    assert 0.93 <= some.inside.mean() <= 0.97
    assert some.inside.min() >= 0.91
    assert found.chi2_per_dof == pytest.approx(1, abs=0.02)
    assert len(some.names) == {"delta4": 12}.get(name, len(found.names))


# figure 12 ------------------------------------------------------------------------------------------------------------


def test_the_table_in_the_documents_is_the_papers_figure() -> None:
    """The non-redundant machine is better in parameters always, also in those that both have; the error of the tool
    point falls as by independent readings, and hardly differs."""
    table = pd.read_csv(ROOT / "docs" / "figure12.csv")
    redundant, plain = (table[table["machine"] == m].reset_index() for m in ("triglide", "triglide-nonredundant"))
    assert redundant["points"].tolist() == plain["points"].tolist() and (table["n"] >= 100).all()
    assert (table["failed"] == 0).all()
    for column in ("length [um]", "common_length [um]"):
        assert (plain[column] < redundant[column]).all()
    many = redundant["points"] >= 20
    for curve in (redundant, plain):
        assert (np.diff(curve["tool [um]"]) < 0).all()
        scaled = curve["tool [um]"][many] * np.sqrt(curve["points"][many])
        assert scaled.max() < 1.25 * scaled.min()
    apart = redundant["tool [um]"] - plain["tool [um]"]
    assert (apart > -3 * np.hypot(redundant["u_tool [um]"], plain["u_tool [um]"])).all()
