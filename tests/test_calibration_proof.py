"""What is planted is found again, and the intervals hold it: on data of the independent simulators."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.calibration.identifiability import combinations
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.report.parameters import determined_sums
from tests import figure12
from tests.campaigns import (
    COVER,
    Coverage,
    by_engine,
    campaigns,
    coverage,
    planted,
    shipped,
)
from tests.coverage_table import COUNT, MACHINES, SEED
from tests.truth.machines import PINNED

# without noise --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [*PINNED, "hexapod7"])
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


@pytest.mark.parametrize("name", ["triglide", "biglide", "delta4", "hangprinter"])
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


@pytest.mark.parametrize("name", ["triglide", "biglide", "delta4", "hangprinter"])
def test_chi_square_of_noise_is_one(name: str) -> None:
    """Per degree of freedom, within four standard deviations; a combination held adds a quarter of s^2, below one.

    Where what is not identified is nominal.
    """
    found = campaigns(by_engine(shipped(name)), 20, SEED, every=False)
    least = 1 - 4 * np.sqrt(2 / found.dof[0] / 20)
    most = 2 - least + (found.held / found.dof).mean()
    assert least < found.chi2_per_dof < most


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


def test_figure_12() -> None:
    """More points, smaller errors; the non-redundant machine is the better one.

    Twelve repetitions of 10 and 160 points: the TCP's errors, a ratio of 4, stand out of their scatter of 10 %; the
    parameters' scatter by some 10 % too, and the prior holds those of the redundant machine.
    """
    every = [figure12.errors(n, c, 12) for n in figure12.MACHINES for c in (10, 160)]
    found = {(e.machine, e.points): e for e in every}
    redundant, plain = figure12.MACHINES
    for name in figure12.MACHINES:
        assert found[name, 160].tcp < 0.5 * found[name, 10].tcp
    assert found[plain, 160].parameters < 0.7 * found[plain, 10].parameters
    assert found[plain, 160].parameters < 0.7 * found[redundant, 160].parameters
    assert found[plain, 160].common < 0.8 * found[redundant, 160].common
    assert found[plain, 160].tcp < found[redundant, 160].tcp + 2 * found[redundant, 160].tcp_scatter


def test_figure_12_is_written(tmp_path: Path) -> None:
    rows = [figure12.Errors(n, c, 30.0 / c, 20.0 / c, 5.0 / c, 0.1) for n in figure12.MACHINES for c in (5, 50)]
    figure12.write(rows, tmp_path / "f.csv")
    lines = (tmp_path / "f.csv").read_text().splitlines()
    assert lines[0] == "machine,points,parameters [um],common [um],tcp [um],tcp_scatter [um]"
    assert lines[1] == "triglide,5,6.000,4.000,1.000,0.100"
    assert len(lines) == 5
    figure12.draw(rows, tmp_path / "f.svg")
    assert (tmp_path / "f.svg").read_text().startswith("<?xml")


def test_the_table_in_the_documents_has_a_hundred_repetitions_and_more() -> None:
    """As written by the command: the non-redundant machine is better in parameters always, in the TCP from 7 points."""
    assert figure12.REPETITIONS >= 100
    lines = [line.split(",") for line in (figure12.DOCS / "figure12.csv").read_text().splitlines()[1:]]
    curves = {
        name: np.array([line[1:] for line in lines if line[0] == name], dtype=float) for name in figure12.MACHINES
    }
    redundant, plain = (curves[n] for n in figure12.MACHINES)
    assert redundant[:, 0].tolist() == plain[:, 0].tolist() == list(figure12.POINTS)
    assert (plain[:, 1:3] < redundant[:, 1:3]).all()
    assert (plain[1:, 3] < redundant[1:, 3]).all()
    for curve in (redundant, plain):
        assert (np.diff(curve[:, 3]) < 0).all()
