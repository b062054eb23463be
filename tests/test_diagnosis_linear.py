"""Scores, thresholds, noise and bad rows of the linearised problem, against definitions and simulated noise.

Campaigns come from the independent simulator; noise is drawn here.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.special import chdtrc, stdtr
from scipy.stats import chi2, kstest, ncx2

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.diagnosis.groups import group_columns
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.linear import Linear
from pkmcal_cli.diagnosis.noise_tests import noise_scale
from pkmcal_cli.diagnosis.outlying_rows import Tails, row_scores
from pkmcal_cli.diagnosis.score import NONCENTRALITY
from pkmcal_cli.diagnosis.scoring import Search, score_all
from pkmcal_cli.diagnosis.threshold import critical_p, effective_tests, smallest_p
from tests.benchmark.setting import Setting, ready
from tests.truth.campaigns import campaign, unit

DRAWS = 400
ALPHA = 0.005


@cache
def setting() -> Setting:
    """The Scissors, which determine all their nine parameters, with nothing planted."""
    return Setting.of("scissors", 11)


def kinds() -> list[tuple[Hypothesis, Array]]:
    """One hypothesis of each kind that the table can show, and its columns (n, k)."""
    linear, out = setting().linear, dict[str, tuple[Hypothesis, Array]]()
    for h in setting().ready.candidates.hypotheses:
        columns = linear.of(h.parameters)
        if h.effect not in out and linear.score(columns).count:
            out[h.effect] = (h, columns)
    return list(out.values())


def drawn(count: int, seed: int = 0) -> list[Linear]:
    """The problem with residuals of pure noise."""
    rng, linear = np.random.default_rng(seed), setting().linear
    noise = rng.normal(size=(count, len(linear.residual)))
    return [linear.projecting(linear.projected, residual=z) for z in noise]


@cache
def null_p_values() -> Array:
    """p values (DRAWS, H) of hypotheses of all `kinds` in pure noise."""
    found = []
    for linear in drawn(DRAWS):
        scores = [linear.score(columns) for _, columns in kinds()]
        found.append([chi2.sf(s.statistic, s.count) for s in scores])
    return np.array(found)


# --- scores --------------------------------------------------------------------------------
def synthetic(columns: Array, projected: int, residual: Array) -> Linear:
    names = tuple(f"p{k}" for k in range(columns.shape[1]))
    ranges = np.full(len(names), 2.0)
    return Linear(
        residual=residual,
        columns=columns,
        names=names,
        ranges=ranges,
        projected=names[:projected],
        used=len(residual),
        channels=1,
    )


def test_what_declared_parameters_absorb_has_no_direction() -> None:
    """A column inside span(A), and one that is so but for a thousandth, are refused; others are not."""
    rng = np.random.default_rng(0)
    a, free = 50 * rng.normal(size=(60, 3)), 50 * rng.normal(size=60)
    inside = a @ [1.0, -2.0, 0.5]
    columns = np.column_stack([a, inside, inside + 1e-3 * free, inside + free])
    linear = synthetic(columns, 3, rng.normal(size=60))
    absorbed, nearly, seen = (linear.score(linear.of([f"p{k}"])) for k in (3, 4, 5))
    assert absorbed.count == nearly.count == 0 and absorbed.kept < 1e-6 and nearly.kept < 0.01
    assert absorbed.statistic == 0.0 and absorbed.mdb > 1e3
    assert seen.count == 1
    both = linear.score(linear.of(["p3", "p5"]))
    assert both.count == 1, "only one direction of the two is new"


def test_scores_are_those_of_least_squares() -> None:
    """T is the fall of chi-square, the estimate that of a fit with both, information its inverse variance."""
    rng = np.random.default_rng(1)
    columns, residual = 30 * rng.normal(size=(40, 4)), rng.normal(size=40)
    linear = synthetic(columns, 3, residual)
    score = linear.score(linear.of(["p3"]))
    whole, rest, *_ = np.linalg.lstsq(columns, residual, rcond=None)
    without = np.linalg.lstsq(columns[:, :3], residual, rcond=None)[1]
    assert score.estimate[0] == pytest.approx(whole[3], rel=1e-6)
    assert score.statistic == pytest.approx(float(without[0] - rest[0]), rel=1e-6)
    assert score.information[0] == pytest.approx(1 / np.linalg.inv(columns.T @ columns)[3, 3], rel=1e-6)
    assert score.mdb == pytest.approx(np.sqrt(NONCENTRALITY / score.information[0]))


def test_scores_beside_another_hypothesis_are_those_of_fits_that_have_it() -> None:
    rng = np.random.default_rng(5)
    columns, residual = 30 * rng.normal(size=(40, 6)), rng.normal(size=40)
    columns[:, 3] += columns[:, 5]
    linear = synthetic(columns, 3, residual)
    first = Hypothesis(effect="scale", at="q1", parameters=("p3", "p4"))
    (score,) = linear.scores_beside(first, [Hypothesis(effect="backlash", at="q1", parameters=("p5",))])
    whole, rest, *_ = np.linalg.lstsq(columns, residual, rcond=None)
    without = np.linalg.lstsq(columns[:, :5], residual, rcond=None)[1]
    assert score.statistic == pytest.approx(float(without[0] - rest[0]), rel=1e-6)
    assert score.estimate[0] == pytest.approx(whole[5], rel=1e-6)
    assert score.information[0] == pytest.approx(1 / np.linalg.inv(columns.T @ columns)[5, 5], rel=1e-6)


def test_free_parameters_are_fitted_and_no_evidence() -> None:
    """T is the fall of chi-square by the others, in fits that all have the free one; it alone explains nothing."""
    rng = np.random.default_rng(2)
    columns, residual = 30 * rng.normal(size=(40, 6)), rng.normal(size=40)
    columns[:, 3] += columns[:, 5]  # what is tested is not at right angles to what is free
    linear = synthetic(columns, 3, residual)
    hypothesis = Hypothesis(effect="straight", at="rail.y", parameters=("p3", "p4", "p5"), free=("p5",))
    score = linear.score_of(hypothesis)
    _, rest, *_ = np.linalg.lstsq(columns, residual, rcond=None)
    _, without, *_ = np.linalg.lstsq(columns[:, [0, 1, 2, 5]], residual, rcond=None)
    assert score.statistic == pytest.approx(float(without[0] - rest[0]), rel=1e-6) and score.count == 2
    fitted = np.linalg.lstsq(columns, residual, rcond=None)[0]
    np.testing.assert_allclose(score.estimate, [*fitted[3:5], 0.0], atol=1e-9)
    information = np.linalg.inv(np.linalg.inv(columns.T @ columns)[3:5, 3:5])
    np.testing.assert_allclose(score.alone, [information[0, 0], information[1, 1], 0.0], rtol=1e-6, atol=1e-9)
    assert score.leading == int(np.argmax(np.diag(information)))
    off = linear.projecting(linear.projected, residual=100 * columns[:, 5])
    assert off.score_of(hypothesis).statistic < 1e-9 * off.chi2
    plain = Hypothesis(effect="straight", at="rail.y", parameters=("p3", "p4", "p5"))
    assert off.score_of(plain).statistic > 0.9 * off.chi2 and off.score_of(plain).count == 3


def test_a_free_parameter_that_is_taken_up_anyway_frees_nothing() -> None:
    """Where declared parameters move the readings as it does, and where nothing is left to test."""
    rng = np.random.default_rng(3)
    a, tested = 30 * rng.normal(size=(40, 3)), 30 * rng.normal(size=40)
    nearly = a @ [1.0, 2.0, -1.0] + 0.1 * rng.normal(size=40)
    linear = synthetic(np.column_stack([a, tested, nearly, a[:, 0]]), 3, rng.normal(size=40))
    score = linear.score_of(Hypothesis(effect="straight", at="rail.y", parameters=("p3", "p4"), free=("p4",)))
    alone = linear.score(linear.of(["p3"]))
    assert score.statistic == pytest.approx(alone.statistic, rel=1e-9) and score.leading == 0 and score.count == 1
    assert score.length2[1] == 0.0 and score.length2[0] == pytest.approx(float(tested @ tested))
    assert replace(score, whole=np.diag([-1e-20, 0.0])).leading == 0, "rounding leaves less than nothing"
    lost = linear.score_of(Hypothesis(effect="straight", at="rail.y", parameters=("p5", "p4"), free=("p4",)))
    assert lost.count == 0 and lost.leading == 0 and lost.kept < 0.01


@pytest.mark.parametrize("name", ["backlash@q2", "thermal_strut@rod4", "straight@left.x"])
def test_score_estimate_is_the_refit_estimate_to_first_order(name: str) -> None:
    """Real campaigns: the score's estimate and standard uncertainty against a calibration with the effect."""
    keyword, at = name.split("@")
    case = ready(campaign("scissors", [unit("scissors", keyword, at, 5).scaled(0.2)], 5))
    before = identify(case.problem, case.selected)
    (hypothesis,) = (h for h in case.candidates.hypotheses if h.name == name)
    found = score_all(
        Search(candidates=case.candidates, problem=case.problem, declared=case.selected, fit=before), [hypothesis]
    )
    one = hypothesis.parameters[:1]  # a lag has no first order at null
    score = found.linear.score(found.linear.of(one))
    fit = identify(case.problem, (*case.selected, *one))
    k, place = fit.selected.index(one[0]), case.problem.model.names.index(one[0])
    scale = found.linear.scale_of(one)[0]
    assert score.estimate[0] * scale == pytest.approx(fit.values[place], abs=0.1 * fit.std[k])
    assert scale / np.sqrt(score.information[0]) == pytest.approx(fit.std[k], rel=0.02)
    assert before.chi2 - fit.chi2 == pytest.approx(score.statistic, rel=0.02)


@pytest.mark.slow
def test_p_values_of_noise_are_uniform() -> None:
    """For every kind of hypothesis, by Kolmogorov and Smirnov."""
    p = null_p_values()
    assert len(kinds()) > 15
    worst = {h.name: kstest(p[:, k], "uniform").pvalue for k, (h, _) in enumerate(kinds())}
    assert min(worst.values()) > 0.01 / len(worst), min(worst, key=lambda n: worst[n])


@pytest.mark.parametrize("size", [0.5, 0.75, 1.0, 1.25])
def test_power_is_that_of_noncentral_chi_square(size: float) -> None:
    """Sizes in units of the MDB, tests at 0.1 %: an effect of one MDB is missed in 20 %."""
    hypothesis, columns = next((h, c) for h, c in kinds() if h.effect == "backlash")
    score = setting().linear.score(columns)
    effect = columns @ (size * score.mdb * score.basis[:, 0])
    limit = chi2.isf(0.001, 1)
    hits = 0
    for linear in drawn(DRAWS, seed=3):
        hits += linear.projecting(linear.projected, residual=linear.residual + effect).score(columns).statistic > limit
    power = float(ncx2.sf(limit, 1, NONCENTRALITY * size**2))
    assert hits / DRAWS == pytest.approx(power, abs=3 * np.sqrt(power * (1 - power) / DRAWS) + 0.01), hypothesis.name
    assert size != 1.0 or power == pytest.approx(0.8, abs=0.005)


# --- threshold -----------------------------------------------------------------------------
def test_critical_p_lies_between_bonferroni_and_a_single_test() -> None:
    linear, columns = setting().linear, [c for _, c in kinds()]
    smallest = smallest_p(linear, columns, [linear.score(c) for c in columns], seed=0)
    for alpha in (0.003, 0.05, 0.2):
        assert alpha / len(columns) * 0.8 < critical_p(smallest, alpha) < alpha
    assert 1 < effective_tests(smallest) < len(columns) * 1.1
    simulated = float(np.mean(null_p_values().min(axis=1) < critical_p(smallest, 0.2)))
    assert simulated == pytest.approx(0.2, abs=3 * np.sqrt(0.16 / DRAWS))
    twice = smallest_p(linear, columns * 2, [linear.score(c) for c in columns * 2], seed=0)
    assert critical_p(twice, 0.05) == pytest.approx(critical_p(smallest, 0.05), rel=0.1), "the same tests again"


# --- noise and rows ------------------------------------------------------------------------
def test_a_right_sigma_is_kept_and_a_small_one_is_found_out() -> None:
    groups = group_columns(setting().ready.problem)
    right = [noise_scale(linear, setting().ready.problem, groups) for linear in drawn(40)]
    assert np.mean([scale.variance == 1.0 for scale in right]) > 0.65  # 80 % by the rule
    assert np.mean([scale.doubted for scale in right]) < 0.1  # 1 % by the rule
    small = [replace(linear, residual=1.25 * linear.residual) for linear in drawn(20, seed=1)]
    found = [noise_scale(linear, setting().ready.problem, groups) for linear in small]
    factors = np.sqrt([scale.variance for scale in found])
    assert np.mean(factors) == pytest.approx(1.25, abs=0.04) and np.std(factors) < 0.1
    assert all(20 < scale.dof < len(small[0].residual) for scale in found if scale.variance > 1)


def test_a_smooth_effect_is_no_noise() -> None:
    """Sigma is judged by what no smooth group explains."""
    problem, linear = setting().ready.problem, setting().linear
    groups = group_columns(problem)
    smooth = groups["pose"][:, 5] + groups["temperature"][:, 0]
    noise = drawn(1, seed=4)[0].residual
    disturbed = linear.projecting(linear.projected, residual=noise + 5 * smooth)
    plain = linear.projecting(linear.projected, residual=noise)
    assert noise_scale(disturbed, problem, groups) == noise_scale(plain, problem, groups)


def bad_rows(residual: Array) -> list[int]:
    """Rows that are wrong at the usual rate of false alarms, for a residual (n,)."""
    problem, linear = setting().ready.problem, setting().linear
    now = linear.projecting(linear.projected, residual=residual)
    scores = row_scores(now, problem.measured, noise_scale(now, problem, group_columns(problem)))
    return [int(k) for k in np.nonzero(scores.p_value < 0.2 * ALPHA / len(problem))[0]]


def test_heavy_tails_are_no_outliers() -> None:
    rng, size = np.random.default_rng(6), len(setting().linear.residual)
    found = [bad_rows(rng.standard_t(4, size) / np.sqrt(2)) for _ in range(20)]
    assert sum(map(len, found)) <= 1
    normal = [bad_rows(rng.normal(size=size)) for _ in range(20)]
    assert sum(map(len, normal)) == 0


def test_a_gross_error_is_an_outlier_and_makes_no_other() -> None:
    rng, size = np.random.default_rng(7), len(setting().linear.residual)
    found = []
    for _ in range(20):
        wrong = rng.normal(size=size)
        wrong[2 * 17] += 12.0  # x of row 17, in standard uncertainties
        found.append(bad_rows(wrong))
    assert found.count([17]) >= 19


def test_heavy_tails_are_told_from_normal_noise() -> None:
    rng = np.random.default_rng(8)
    t4 = [Tails.of(np.abs(rng.standard_t(4, 400)) / np.sqrt(2)).weights[:4].sum() for _ in range(20)]
    assert sum(w > 0.9 for w in t4) >= 18, "4 to 8 degrees of freedom"
    normal = [Tails.of(np.abs(rng.normal(size=400))).weights[:2].sum() for _ in range(20)]
    assert np.mean(normal) < 0.02 and max(normal) < 0.1
    assert Tails.of(np.full(20, 1e-17)).weights.sum() == 0.0, "of no noise"
    nothing = Tails.of(np.zeros(0)).weights
    assert nothing.sum() == pytest.approx(0.5), "normal noise is as likely as any with tails before any is seen"


def test_tails_decide_how_far_off_a_row_must_be() -> None:
    """A value 8 sigma off: beyond doubt in 400 normal ones, nothing special among heavy ones (closed forms)."""
    rng = np.random.default_rng(9)
    p, statistic, count = np.array([chdtrc(1, 64.0)]), np.array([64.0]), np.array([1])
    normal = Tails.of(np.abs(rng.normal(size=400))).p_value(p, statistic, count)
    heavy = Tails.of(np.abs(rng.standard_t(4, 400)) / np.sqrt(2)).p_value(p, statistic, count)
    alone = 2 * stdtr(4, -8 * np.sqrt(2))
    assert normal[0] < 0.02 * alone and 0.2 * alone < heavy[0] < alone
