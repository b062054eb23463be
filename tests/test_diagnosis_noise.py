"""Noise is noise: odd rows, tails, growth over the workspace and wrong ranges name nothing.

Campaigns come from the independent simulator.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.diagnosis.groups import varying_axes
from pkmcal_cli.diagnosis.linear import Linear, linear_problem
from pkmcal_cli.diagnosis.noise_growth import DISTANCE, noise_growth, weighted
from pkmcal_cli.diagnosis.noise_tests import _without_tails, chance_of_noise, without_odd_row
from pkmcal_cli.diagnosis.scale import Scale
from pkmcal_cli.diagnosis.scoring import Search, score_all, scored
from pkmcal_cli.diagnosis.search import stands_on_one_row
from pkmcal_cli.diagnosis.unknown import unknown_effects
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.workflow.search_case import CaseRequest, prepare
from tests.benchmark.setting import Setting, diagnosed, ready
from tests.command import MACHINES
from tests.detected_sizes import outcome
from tests.test_diagnosis_linear import setting
from tests.truth.campaigns import campaign
from tests.truth.shop_conditions import Scenario

LEAST = 1e-4


def with_residual(residual: np.ndarray) -> Linear:
    linear = setting().linear
    return linear.projecting(linear.projected, residual=residual)


def noise(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=len(setting().linear.residual))


# --- one odd row ---------------------------------------------------------------------------
def test_an_effect_thatstands_on_one_row_is_none() -> None:
    """A value 40 sigma off makes hypotheses significant, but none without its row; a planted effect stays."""
    problem, hypotheses = setting().ready.problem, setting().ready.candidates.hypotheses
    odd = noise(1)
    odd[2 * 31] += 40.0
    seen = scored(with_residual(odd), problem, hypotheses)
    best = int(np.argmax([s.statistic for s in seen.scores]))
    assert seen.scores[best].statistic > 25 and stands_on_one_row(seen, best)
    k = next(k for k, h in enumerate(hypotheses) if h.name == "backlash@q2")
    score, columns = seen.scores[k], setting().linear.tested(hypotheses[k])
    planted = scored(with_residual(noise(2) + columns[:, 0] * 5.0 / np.sqrt(score.information[0])), problem, hypotheses)
    assert planted.scores[k].statistic > 10 and not stands_on_one_row(planted, k)


def test_one_odd_row_is_nothing_unknown() -> None:
    problem = setting().ready.problem
    odd = noise(3)
    odd[2 * 31] += 40.0
    linear = with_residual(odd)
    assert without_odd_row(linear).chi2 < 0.4 * linear.chi2
    assert unknown_effects(linear, problem, Scale(), 1e-3, ()) == []
    assert without_odd_row(with_residual(noise(3))).extra is None, "noise has no odd row"


# --- is the noise as it is stated? ---------------------------------------------------------
def test_noise_that_is_larger_is_told_from_noise_with_tails() -> None:
    """1.25 times the stated noise in 18 of 20 tables; of t4 noise, of which 4 % of the rows are 4 sigma off, none."""
    size = len(setting().linear.residual)
    larger = [chance_of_noise(with_residual(1.25 * noise(k))) for k in range(20)]
    assert sum(p < 1e-3 for p in larger) >= 18
    rng = np.random.default_rng(4)
    heavy = [chance_of_noise(with_residual(rng.standard_t(4, size) / np.sqrt(2))) for _ in range(20)]
    assert min(heavy) > 1e-3
    plain = [chance_of_noise(with_residual(noise(k))) for k in range(20, 60)]
    assert min(plain) > 1e-3 and np.median(plain) == pytest.approx(0.5, abs=0.2)


def test_what_ranges_say_is_no_noise() -> None:
    """True errors 25 times the ranges: held directions are off, and yet the residual is noise."""
    here = Setting.of("triglide", 5, Scenario(errors=25.0)).ready
    fit = identify(here.problem, here.selected)
    search = Search(candidates=here.candidates, problem=here.problem, declared=here.selected, fit=fit)
    linear = score_all(search, ()).linear
    assert fit.directions.weak.any() and linear.chi2 - linear.dof > 4 * np.sqrt(2 * linear.dof)
    assert chance_of_noise(linear) > 1e-3


@pytest.mark.parametrize(
    ("machine", "tables"), [("delta4", 20), pytest.param("triglide", 60, marks=pytest.mark.slow)]
)
def test_held_directions_cost_no_freedom(machine: str, tables: int) -> None:
    """Chi-square of small tables, many directions of which are held, is its degrees of freedom in the mean."""
    squares, freedom, held = [], [], 0
    for seed in range(tables):
        here = ready(campaign(machine, [], seed, rows=14, scenario=Scenario(sessions=1)))
        fit = identify(here.problem, here.selected)
        linear = linear_problem(here.problem, fit.values, here.selected, (), None)
        squares.append(linear.chi2)
        freedom.append(linear.dof)
        held += int(linear.spectrum.held.sum())
    apart = 4 * np.sqrt(2 * np.sum(freedom))
    assert held > apart, "else nothing is shown"
    assert np.sum(squares) == pytest.approx(np.sum(freedom), abs=apart)


def test_columns_that_say_the_same_count_once() -> None:
    """Chi-square with nine columns projected out, of which three are others' sums and one is empty, drops by five."""
    linear, rng = setting().linear, np.random.default_rng(0)
    columns = rng.normal(size=(len(linear.residual), 5))
    every = np.hstack([columns, columns[:, :3] + columns[:, 1:4], np.zeros((len(columns), 1))])
    assert linear.dof - linear.projecting(linear.projected, extra=columns).dof == pytest.approx(5, abs=1e-3)
    assert linear.dof - linear.projecting(linear.projected, extra=every).dof == pytest.approx(5, abs=1e-3)


# --- growth --------------------------------------------------------------------------------
def test_noise_grows_towards_a_side() -> None:
    """Standard deviations exp(u) along y: a ratio of e^2 from end to end, and weights that make the noise even."""
    problem = setting().ready.problem
    axis = varying_axes(problem)["y"]
    size = np.repeat(np.exp(-axis), 2)
    residual = noise(5) * size / np.sqrt((size**2).mean())
    (found,) = noise_growth(with_residual(residual), problem, Scale(), LEAST)
    assert (found.sensor, found.towards) == ("grid", "y-")
    assert found.ratio == pytest.approx(np.exp(2), abs=3 * found.ratio_std) and found.ratio_std < 0.2 * found.ratio
    even = weighted(problem, (found,)).sigma / problem.sigma
    np.testing.assert_allclose((even**2).mean(axis=0), 1.0)
    np.testing.assert_allclose(even[:, 0] * even[:, 0].mean(), np.exp(-axis), rtol=0.5)


def test_the_slope_is_that_of_the_noise_also_where_sigma_is_estimated() -> None:
    """Noise twice as large as stated, and growing with the distance: its far end over its near one within 3 std."""
    problem = setting().ready.problem
    distance = np.sqrt((problem.readings**2).sum(axis=1))
    size = np.sqrt(1 + (3 * distance / distance.max()) ** 2)
    residual = 2 * noise(7) * np.repeat(size, 2)
    scale = Scale(4 * float((size**2).mean()), 300.0)
    (found,) = noise_growth(with_residual(residual), problem, scale, LEAST)
    assert found.towards == DISTANCE
    true = 2 * 3 / distance.max() * problem.sigma[0, 0]
    assert found.slope == pytest.approx(true, abs=3 * found.slope_std) and found.slope_std < 0.5 * true
    assert found.ratio == pytest.approx(size.max() / size.min(), rel=0.4)


def test_growth_is_no_local_effect() -> None:
    """Far rows of a table whose noise grows steeply are no bump of a drive."""
    measured = campaign("triglide", [], 4, rows=190, scenario=Scenario(sessions=1))
    place = measured.true_readings[:, 0]
    size = 1 + 6 * ((place - place.min()) / np.ptp(place)) ** 2
    shift = (measured.readings - measured.true_readings) * (size / np.sqrt((size**2).mean()))[:, None]
    found = diagnosed(replace(measured, readings=measured.true_readings + shift), 0)
    assert found.verdict == "clean" and found.noise and found.noise[0].ratio > 2


def test_noise_that_grows_sixfold_is_told_in_most_tables_of_sixty_rows() -> None:
    """By squares, which scatter most where noise is largest, it was told in 13 of these 20."""
    told = 0
    for seed in range(20):
        measured = campaign("triglide-nonredundant", [], seed, rows=60, scenario=Scenario(sessions=1))
        place = measured.true_readings[:, 0]
        size = 1 + 5 * (place - place.min()) / np.ptp(place)
        shift = (measured.readings - measured.true_readings) * (size / np.sqrt((size**2).mean()))[:, None]
        here = ready(replace(measured, readings=measured.true_readings + shift))
        fit = identify(here.problem, here.selected)
        linear = linear_problem(here.problem, fit.values, here.selected, (), None)
        told += bool(noise_growth(linear, here.problem, Scale(), LEAST))
    assert told >= 17


def test_noise_that_does_not_grow_is_seldom_told_to() -> None:
    """Even and t4 noise: at a chance of 1 %, in at most 1 % of 1000 tables each, with three deviations of chance."""
    problem, rng, size = setting().ready.problem, np.random.default_rng(6), len(setting().linear.residual)
    for drawn in (rng.normal(size=(1000, size)), rng.standard_t(4, size=(1000, size)) / np.sqrt(2)):
        told = [bool(noise_growth(with_residual(residual), problem, Scale(), 0.01)) for residual in drawn]
        assert np.sum(told) <= 10 + 3 * np.sqrt(10)


def test_a_table_whose_noise_grows_is_clean_and_says_so() -> None:
    measured = campaign("triglide", [], 2, rows=120, scenario=Scenario(sessions=1))
    place = measured.true_readings[:, 1]
    size = 1 + 5 * (place - place.min()) / np.ptp(place)
    shift = (measured.readings - measured.true_readings) * (size / np.sqrt((size**2).mean()))[:, None]
    found = diagnosed(replace(measured, readings=measured.true_readings + shift), 0)
    assert found.verdict == "clean" and [n.towards for n in found.noise] == ["y+"]
    assert found.problem.sigma[np.argmax(place), 0] > 2 * found.problem.sigma[np.argmin(place), 0]


def test_a_rival_that_rows_confirm_takes_the_place_of_one_that_they_do_not() -> None:
    """The reversal error of q1, at the limit: its rival `windup@q1` has more evidence, but no block confirms it."""
    found = outcome("triglide", "backlash", "q1", 6)
    assert found is not None and found.in_set


def test_readings_of_two_rows_have_no_place_to_grow_with(recwarn: pytest.WarningsRecorder) -> None:
    """The router's tape reads distances between rows; its encoders are drives."""
    table = str(MACHINES / "belt-router.csv")
    request = CaseRequest(machine=str(MACHINES / "belt-router.yaml"), measurements=(table,))
    case = prepare(request, Reporter(quiet=True))
    nominal = linear_problem(case.problem, case.problem.model.nominal, case.selected, (), None)
    assert noise_growth(nominal, case.problem, Scale(), LEAST) == () and not recwarn.list


@pytest.mark.parametrize("values", [24, 80, 400])
def test_a_variance_without_the_largest_squares_claims_no_more_degrees_of_freedom_than_it_has(values: int) -> None:
    """A variance with nu degrees of freedom scatters by sqrt(2 / nu) of itself; a trimmed one has fewer than values.

    The formula is for many values; of 24 it tells 5 % too few, and the scatter of so many draws is known to 2 %.
    """
    rng = np.random.default_rng(0)
    drawn = np.array([_without_tails(rng.normal(size=values) ** 2) for _ in range(20_000)])
    variance, worth = drawn[:, 0], drawn[0, 1]
    assert 2 * variance.mean() ** 2 / variance.var() == pytest.approx(
        worth * values, rel=0.08 if values == 24 else 0.05
    )
    assert worth < (0.7 if values == 24 else 0.9)
    assert variance.mean() == pytest.approx(1.0, abs=1.6 / values)
