"""What keeps a diagnosis honest: free shapes, unmodelled alternatives, resampled rows, noise that is not as stated."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.diagnosis.alternatives import best_alternative, families
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.known_results import KnownResults
from pkmcal_cli.diagnosis.linear import Linear
from pkmcal_cli.diagnosis.model_discrepancy import own_discrepancies, own_discrepancy
from pkmcal_cli.diagnosis.noise_growth import DISTANCE, noise_growth
from pkmcal_cli.diagnosis.run_diagnosis import Diagnosis
from pkmcal_cli.diagnosis.scale import Scale
from pkmcal_cli.diagnosis.score import log_evidence
from pkmcal_cli.diagnosis.scoring import Search, score_all
from pkmcal_cli.diagnosis.stability import Stability, stability
from pkmcal_cli.diagnosis.unit_columns import unit_columns
from pkmcal_cli.effects.effect import legendre
from pkmcal_cli.report.diagnosis import DiagnosisReport
from tests.benchmark.cases import case
from tests.benchmark.setting import Setting, diagnosed, machine
from tests.truth.campaigns import campaign, unit


@cache
def setting() -> Setting:
    """The Scissors with nothing planted."""
    return Setting.of("scissors", 11)


@cache
def calibrated() -> Fit:
    return identify(setting().ready.problem, setting().ready.selected)


def hypothesis(name: str) -> Hypothesis:
    return next(h for h in setting().ready.candidates.hypotheses if h.name == name)


def with_residual(residual: Array) -> Linear:
    return setting().linear.projecting(setting().linear.projected, residual=residual)


def noise(seed: int) -> Array:
    return np.random.default_rng(seed).normal(size=len(setting().linear.residual))


# --- shapes --------------------------------------------------------------------------------
@pytest.mark.parametrize("name", ["pitch_curve@q2", "straight@left.x", "carriage_angle@c1.rz"])
def test_any_shape_is_the_unit_column_times_it(name: str) -> None:
    """The derivative by an effect's parameter, row by row, is that by a constant displacement times the shape."""
    problem, there = setting().ready.problem, setting().linear
    effect = next(e for e in problem.model.effects if e.name == name)
    values = setting()._true
    units = unit_columns(problem, values, None, [effect])
    assert len(effect.parameters) == {"pitch_curve": 5, "straight": 4, "carriage_angle": 2}[name.partition("@")[0]]
    for parameter in effect.parameters:
        order = int(parameter[-1])
        made = sum(u.shaped(legendre(u.inputs.normalised_travel, order)[:, None])[:, 0] for u in units)
        column = there.of([parameter])[:, 0] / there.scale_of([parameter])[0]
        assert made == pytest.approx(column, abs=1e-6 * np.abs(column).max())


def test_a_shape_of_its_own_is_recognised_and_costs_certainty() -> None:
    """An effect plus a fifth of it in free shapes speaks for these and widens its sizes; a pure effect does not."""
    linear, name = setting().linear, hypothesis("pitch_curve@q2")
    columns = linear.of(name.parameters)
    discrepancies = own_discrepancies(setting().ready.problem, calibrated(), [name], KnownResults())[name.name]
    rng = np.random.default_rng(5)
    pure = 12 * columns @ rng.normal(size=columns.shape[1]) / np.sqrt((columns**2).sum()) * 5
    extra = discrepancies @ rng.normal(size=discrepancies.shape[1])
    extra *= 0.2 * np.sqrt((pure**2).sum() / (extra**2).sum())
    plain, rich = (with_residual(noise(3) + r) for r in (pure, pure + extra))
    before, after = (own_discrepancy(x, Scale(), columns, discrepancies) for x in (plain, rich))
    assert after.evidence > 3 > before.evidence >= 0
    assert np.trace(after.covariance) > 4 * np.trace(before.covariance)


def test_a_second_effect_is_no_shape_of_the_first_where_it_explains_more() -> None:
    """A step of the set-up has five more log evidence than a free shape in time of the drift that was found first."""
    planted = case("two", 40)
    d = diagnosed(planted.measured(), planted.seed)
    assert {f.hypothesis.name for f in d.findings} == {x.name for x in planted.drawn} == {"drift@tracker", "resetup@s2"}


def test_evidence_is_the_likeliest_normal_prior() -> None:
    """Against the marginal likelihood of normal sizes, maximised over their variance by trying many."""
    for statistic, count in ((30.0, 1), (30.0, 4), (200.0, 3)):
        g = np.geomspace(1.0, 1e5, 20001)
        marginal = 0.5 * (statistic * g / (1 + g) - count * np.log1p(g))
        assert float(log_evidence(np.array(statistic), np.array(count))) == pytest.approx(marginal.max(), rel=1e-6)
    assert log_evidence(np.array(0.0), np.array(0)) == -np.inf


# --- alternatives without a name ----------------------------------------------------------
def test_nameless_alternatives_are_recognised() -> None:
    """A step, an oscillation, a bump of a guide: each is the best alternative where it is there, and where it is."""
    problem, kinds = setting().ready.problem, families(setting().ready.problem, calibrated())
    time = problem.rows.columns["time"]
    day = (time - time.min()) / np.ptp(time)
    along = np.tile([1.0, 0.0], len(problem))
    step = 4 * along * np.repeat(day > 0.3, 2)
    wave = 3 * along * np.repeat(np.sin(2 * np.pi * 11 * day), 2)
    effect = next(e for e in problem.model.effects if e.name == "straight@right.x")
    units = unit_columns(problem, calibrated().values, None, [effect])
    travel = np.stack([u.inputs.travel for u in units], axis=1)
    share = (travel - travel.min()) / np.ptp(travel)
    bell = np.exp(-4 * np.log(2) * ((share - 0.15) / 0.05) ** 2)
    bump = np.sum([u.shaped(b[:, None])[:, 0] for u, b in zip(units, bell.T, strict=True)], axis=0)
    bump *= 25 / np.sqrt((bump**2).sum())
    cases = (step, "time", f"step at row {int(np.argmax(day > 0.3)) + 1}"), (wave, "time", "oscillation, 11"), (
        bump, "pose", "at 15 % of the travel of right.x",
    )  # fmt: skip
    for planted, depends_on, words in cases:
        best = best_alternative(with_residual(noise(1) + planted), Scale(), kinds)
        assert best is not None and best.evidence > 20
        assert best.depends_on == depends_on and words in best.words, best
    quiet = [best_alternative(with_residual(noise(k)), Scale(), kinds) for k in range(10, 20)]
    assert max(g.evidence for g in quiet if g is not None) < 7


# --- rows resampled ------------------------------------------------------------------------
@cache
def clear_case() -> Diagnosis:
    """A clear backlash."""
    return diagnosed(campaign("scissors", [unit("scissors", "backlash", "q3", 4).scaled(0.4)], 4), 4)


@pytest.mark.slow
def test_resampled_rows_name_the_same_effect() -> None:
    (finding,) = clear_case().findings
    assert finding.hypothesis.name == "backlash@q3" and finding.stable.share >= 0.95
    assert finding.nonlinear == pytest.approx(1.0, abs=0.05), "backlash acts in proportion to its size"


def test_resampled_noise_names_now_this_now_that() -> None:
    """What is best in pure noise is best in few resamples."""
    ready = setting().ready
    now = Search(candidates=ready.candidates, problem=ready.problem, declared=ready.selected, fit=calibrated())
    scored = score_all(now, now.open)
    best = scored.hypotheses[int(np.argmax(scored.log_bayes))]
    none = scored.log_bayes
    assert np.mean([stability(scored, none, ready.problem, best, [], seed).share for seed in range(5)]) < 0.7
    told = stability(scored, none, ready.problem, best, [], 0)
    assert told.share + sum(share for _, share in told.others) == pytest.approx(1.0)
    assert best not in [h for h, _ in told.others] and told.others[0][1] == max(share for _, share in told.others)
    least = min((h for h, s in zip(scored.hypotheses, scored.scores, strict=True) if s.count), key=lambda h: h.name)
    assert 0 <= stability(scored, none, ready.problem, least, [], 0).share <= 1


# --- noise that grows with distance --------------------------------------------------------
def test_noise_that_grows_with_distance_is_told() -> None:
    """sigma^2 = stated^2 + (slope distance)^2: the slope within four of its uncertainties; none of a constant sigma."""
    problem, linear = setting().ready.problem, setting().linear
    distance = np.sqrt((problem.readings**2).sum(axis=1)) / problem.sigma[0, 0]  # in stated sigma
    slope = 2 / np.median(distance)
    factor = np.repeat(np.sqrt(1 + (slope * distance) ** 2), 2)
    (found,) = noise_growth(with_residual(noise(2) * factor), problem, Scale(), 1e-4)
    assert found.sensor == "grid" and found.towards == DISTANCE and found.p_value < 1e-6
    assert found.slope == pytest.approx(slope, abs=4 * found.slope_std)
    assert not [n for k in range(40) for n in noise_growth(with_residual(noise(k)), problem, Scale(), 1e-4)]
    assert linear.channels == 2


def test_what_other_resamples_find_is_told() -> None:
    """An effect that is provisional because rows drawn anew name others: these, most often first."""
    found = clear_case()
    (finding,) = found.findings
    rivals = [h for h in found.first.hypotheses if h.name in ("zero@q3", "scale@q3")]
    others = tuple(zip(rivals, (0.2, 0.11), strict=True))
    doubtful = replace(finding, stable=Stability(0.69, others), provisional=True)
    report = DiagnosisReport(machine("scissors")[0], None, found)  # type: ignore[arg-type]
    expected = f"only 69 % of the resamples find it; of the others 20 % {rivals[0].name}, 11 % {rivals[1].name}."
    assert expected in report._reservation(doubtful)
