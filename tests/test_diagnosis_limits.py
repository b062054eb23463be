"""Where a diagnosis is easily misled: noise far from its statement, few rows, directions that are held, part tables."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.calibration.fit import Ended
from pkmcal_cli.calibration.identify import RowsFailed, identify
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import evaluate
from pkmcal_cli.diagnosis.closed_loop import improve
from pkmcal_cli.diagnosis.confirm import held_out_gain
from pkmcal_cli.diagnosis.groups import group_columns
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.linear import Linear, Memory, linear_problem
from pkmcal_cli.diagnosis.noise_tests import noise_scale, successive
from pkmcal_cli.diagnosis.refine import confirmed_only
from pkmcal_cli.diagnosis.refits import refit
from pkmcal_cli.diagnosis.run_diagnosis import diagnose
from pkmcal_cli.diagnosis.scoring import Search, score_all
from tests.benchmark.setting import diagnosed, ready
from tests.command import SCISSORS, SHOPFLOOR, TRIGLIDE, TRIGLIDE_DATA, run
from tests.in_ci import in_ci
from tests.truth.campaigns import Scenario, campaign, unit

pytestmark = pytest.mark.usefixtures("unsized")


# --- noise ---------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("factor", "machine"), in_ci(["4.0-triglide"], product([2.0, 4.0], ["triglide", "scissors"]))
)
@pytest.mark.slow
def test_noise_far_above_its_statement_is_no_effect(machine: str, factor: float) -> None:
    """Nothing planted, sigma stated far too small: sigma is found out to 15 %, and nothing is named."""
    for seed in (11, 12, 13):
        found = diagnosed(campaign(machine, [], seed, scenario=Scenario(sigma_factor=factor)), seed)
        assert not found.findings and not found.unknown and not found.bad_rows
        assert np.sqrt(found.scale.variance) == pytest.approx(factor, rel=0.15) and found.scale.doubted


@pytest.mark.slow
def test_noise_far_below_its_statement_does_not_hide_an_effect() -> None:
    """Sigma stated five times too large: a backlash that the stated sigma would hide is found, as sure as it is."""
    small = unit("scissors", "backlash", "q3", 4).scaled(0.1)
    found = diagnosed(campaign("scissors", [small], 4, scenario=Scenario(sigma_factor=0.2)), 4)
    assert [f.hypothesis.name for f in found.findings] == ["backlash@q3"]
    (finding,) = found.findings
    assert finding.estimate[0] == pytest.approx(2e-6, abs=4 * finding.std[0]) and finding.std[0] < 0.2e-6


def test_shapes_of_pose_are_free_of_noise() -> None:
    """They are the same whatever was measured there."""
    one, other = (ready(campaign("scissors", [], 11, scenario=Scenario(sigma_factor=f))) for f in (1.0, 4.0))
    a, b = (group_columns(r.problem)["pose"] for r in (one, other))
    assert a == pytest.approx(b)


# --- few rows ------------------------------------------------------------------------------
@pytest.mark.parametrize("rows", in_ci(["15"], [10, 15, 20, 25]))
def test_few_rows_of_noise_name_nothing(rows: int) -> None:
    """Noise five times its statement in a short table."""
    for seed in (1, 2, 3):
        measured = campaign("triglide-nonredundant", [], seed, rows, Scenario(sigma_factor=5.0))
        found = diagnosed(measured, seed)
        assert not found.findings, [f.hypothesis.name for f in found.findings]


def test_one_bad_row_of_fifteen_is_found() -> None:
    there = ready(campaign("triglide-nonredundant", [], 5, 15))
    readings = there.problem.readings.copy()
    readings[7, 0] += 100 * there.problem.sigma[7, 0]
    found = diagnose(there.candidates, replace(there.problem, readings=readings), there.selected, 0.005, 0)
    assert found.bad_rows == (7,) and not found.findings


# --- held directions, part tables ----------------------------------------------------------
@pytest.mark.slow
def test_rows_held_out_confirm_an_effect_beside_held_directions() -> None:
    """The delta leaves directions of its parameters undetermined; these must not take over what is held out."""
    found = diagnosed(campaign("delta4", [unit("delta4", "guide_angle", "rail3.x", 3).scaled(3)], 3), 3)
    named = {f.hypothesis.name: f for f in found.findings}
    finding = named["guide_angle@rail3.x"]
    fall = found.before.chi2 - found.search.fit.chi2  # of all rows; most of it must be seen by rows left out too
    assert finding.held_out.confirmed and finding.held_out.gain > 0.5 * fall / found.problem.count
    assert all(r.cosine == pytest.approx(1.0) for r in finding.rivals[:1])


@pytest.mark.slow
def test_improve_spreads_shapes_over_the_whole_table() -> None:
    """A pitch error over the travel is accepted whatever part of the travel each rotation sees."""
    curve = unit("scissors", "pitch_curve", "q1", 2).scaled(2)
    there = ready(campaign("scissors", [curve], 2, scenario=Scenario(extra=0.0)))
    found = improve(there.candidates, there.problem, there.selected, None, 0.005, 0)
    assert "pitch_curve@q1" in [h.name for h in found.accepted]
    fitted = found.fit.chi2 / found.problem.count  # the truth's curve is none of the polynomials
    blind = 1 - found.steps[0].chosen / found.rotations  # rotations that report without it
    assert blind < 0.3 and found.after.chi2 < 1.4 * fitted + 1.5 * blind * found.before.chi2


def test_only_measured_neighbours_count_as_pairs() -> None:
    """Noise in a third of one channel's rows: p values of 5 % in some 5 % of draws, not more."""
    there = ready(campaign("scissors", [], 11))
    measured = np.zeros_like(there.problem.measured)
    measured[: len(measured) // 3, 0] = True
    problem = replace(there.problem, measured=measured)
    linear = linear_problem(problem, problem.model.nominal, there.selected[:1], (), None)
    rng, found = np.random.default_rng(0), []
    for _ in range(300):
        noise = np.where(measured, rng.normal(size=measured.shape), 0.0).ravel()
        found.append(successive(linear.projecting(linear.projected, residual=noise), problem)[1] < 0.05)
    assert np.mean(found) < 0.09  # 5 % by the rule, four standard errors above


def without_reach(problem: Problem, row: int) -> tuple[Problem, Problem]:
    """A table of which one row cannot be predicted, and the same where nothing was measured in it."""
    readings = problem.rows.readings.copy()
    readings[row] += [1.0, -1.0] + [0.0] * (readings.shape[1] - 2)
    spoilt = replace(problem, rows=replace(problem.rows, readings=readings))
    return spoilt, spoilt.without([row])


def test_a_row_that_nothing_predicts_takes_no_part_in_any_test() -> None:
    there = ready(campaign("triglide-nonredundant", [], 5))
    tables = without_reach(there.problem, 7)
    smooth = np.random.default_rng(0).normal(size=(*there.problem.readings.shape, 3))
    cut = smooth.copy()
    cut[7] = 0.0
    found = []
    for problem, shapes in zip(tables, (s.reshape(-1, 3) for s in (smooth, cut)), strict=True):
        plain = linear_problem(problem, problem.model.nominal, there.selected, (), None)
        beside = plain.projecting(plain.projected, extra=shapes)
        assert not plain.on[7].any() and plain.on.sum() == plain.used
        found.append([plain.chi2, plain.dof, *plain.explained(shapes), beside.chi2, *beside.freedom])
    np.testing.assert_allclose(found[0], found[1], rtol=1e-12)
    assert np.isfinite(found).all()
    away = tables[0].rows.readings + np.array([1.0, -1.0])
    lost = replace(tables[0], rows=replace(tables[0].rows, readings=away))
    with pytest.raises(RowsFailed):
        linear_problem(lost, lost.model.nominal, there.selected, (), None)


def test_a_row_that_nothing_predicts_is_not_held_out() -> None:
    d = diagnosed(campaign("triglide-nonredundant", [unit("triglide-nonredundant", "backlash", "q1", 4)], 4), 4)
    (hypothesis,), gains = d.search.accepted, []
    for problem in without_reach(d.search.problem, 7):
        fit = replace(d.search.fit, ended=Ended(problem, evaluate(problem, d.search.fit.values)))
        gains.append(held_out_gain(replace(d.search, problem=problem, fit=fit), hypothesis))
    assert gains[0] == gains[1] and gains[0].confirmed


def test_a_value_after_a_gap_stays_as_it_is() -> None:
    """x <- (x - rho x before) / sqrt(1 - rho^2), but only where both were measured."""
    measured = np.array([[True], [True], [False], [True], [True]])
    memory = Memory(np.arange(5), 0.6, measured)
    x = np.array([1.0, 2.0, 0.0, 3.0, 5.0])
    linear = Linear(
        residual=x, columns=np.zeros((5, 0)), names=(), ranges=np.zeros(0), projected=(), used=4, channels=1
    ).prewhitened(memory)
    assert linear.residual == pytest.approx([1.0, (2 - 0.6) / 0.8, 0.0, 3.0, (5 - 1.8) / 0.8])


def test_held_out_rows_veto() -> None:
    """With which they are predicted worse is no cause, whatever its evidence; what helps stays."""
    there = ready(campaign("scissors", [unit("scissors", "backlash", "q3", 4).scaled(0.4)], 4))
    fit = identify(there.problem, there.selected)
    plain = Search(candidates=there.candidates, problem=there.problem, declared=there.selected, fit=fit)
    names = {h.name: h for h in plain.open}
    idle = next(
        s
        for h in plain.open
        if h.effect in ("scale", "windup", "pitch_curve") and held_out_gain(s := _with(plain, h), h).gain < 0
    )
    (noise,) = idle.accepted
    for evidence in (5.0, 50.0):
        left = confirmed_only(replace(idle, evidence={noise.name: evidence}))
        assert left.accepted == () and left.vetoed == (noise,)
    true = names["backlash@q3"]
    assert confirmed_only(replace(_with(plain, true), evidence={true.name: 5.0})).accepted == (true,)


def _with(now: Search, hypothesis: Hypothesis) -> Search:
    after = replace(now, accepted=(hypothesis,))
    fit = refit(after, {})
    assert fit is not None
    return replace(after, fit=fit)


def test_gaps_are_no_memory() -> None:
    """A channel that is measured in every third row makes successive rows no more alike."""
    there = ready(campaign("scissors", [], 11))
    problem = there.problem
    measured = problem.measured.copy()
    measured[np.arange(len(problem)) % 3 > 0, 1] = False
    problem = replace(problem, measured=measured)
    now = Search(
        candidates=there.candidates, problem=problem, declared=there.selected, fit=identify(problem, there.selected)
    )
    scored = score_all(now, ())
    assert scored.linear.memory is None
    assert noise_scale(scored.linear, problem, group_columns(problem)).variance < 1.3


# --- files ---------------------------------------------------------------------------------
def test_results_never_replace_inputs(tmp_path: Path) -> None:
    machine = tmp_path / "t.yaml"
    machine.write_text(Path(TRIGLIDE).read_text(encoding="utf-8"), encoding="utf-8")
    before = machine.read_bytes()
    for command in (
        ("improve", machine, TRIGLIDE_DATA, "-o", machine, "--force"),
        ("calibrate", machine, TRIGLIDE_DATA, "-o", machine, "--force"),
        ("simulate", machine, TRIGLIDE_DATA, "-o", machine, "--force"),
        ("plan", machine, TRIGLIDE_DATA, "-o", machine, "--force"),
    ):
        done = run(*command)
        assert done.code == 4 and "is an input" in done.err and machine.read_bytes() == before, command[0]


def test_rows_that_report_are_not_those_that_fit() -> None:
    done = run("improve", SCISSORS, SHOPFLOOR, "--validation", SHOPFLOOR)
    assert done.code == 2 and "give held-out rows" in done.err


def test_a_machine_from_stdin_cannot_be_extended(tmp_path: Path) -> None:
    text = Path(TRIGLIDE).read_text(encoding="utf-8")
    done = run("improve", "-", TRIGLIDE_DATA, "-o", tmp_path / "x.yaml", stdin=text)
    assert done.code == 2 and "stdin" in done.err and not (tmp_path / "x.yaml").exists()


@pytest.mark.slow
def test_what_is_simulated_keeps_the_columns_that_effects_need(tmp_path: Path) -> None:
    """The improved shop floor, simulated from its own table: the same effects are found again."""
    improved = tmp_path / "better.yaml"
    assert run("improve", SCISSORS, SHOPFLOOR, "-o", improved, "-q").code == 0
    simulated = tmp_path / "again.csv"
    options = ("-p", tmp_path / "better.params.yaml", "--noise", "declared", "--seed", "1", "-o", simulated)
    assert run("simulate", improved, SHOPFLOOR, *options).code == 0
    found = run("diagnose", SCISSORS, simulated, "--json", "-q").json
    assert {f"{e['effect']}@{e['at']}" for e in found["effects"]} == {"thermal_strut@all", "backlash@q3"}
    assert run("sensitivity", improved).code == 0, "at the drawing, effects are at rest"
    assert run("observability", improved, "--grid", "x=-200:200:3,y=-200:200:3").code in (0, 1)


def test_a_reading_outside_the_machine_is_told_with_its_place(tmp_path: Path) -> None:
    text = Path(SHOPFLOOR).read_text(encoding="utf-8").splitlines()
    header = next(k for k, line in enumerate(text) if line.startswith("id"))
    column = next(k for k, c in enumerate(text[header].split(",")) if c.split(" ")[0] == "x")
    cells = text[header + 3].split(",")
    cells[column] = "1e6"
    text[header + 3] = ",".join(cells)
    table = tmp_path / "typo.csv"
    table.write_text("\n".join(text) + "\n", encoding="utf-8")
    done = run("diagnose", SCISSORS, table)
    assert done.code == 3 and f"typo.csv:{header + 4}" in done.err and "outside the machine" in done.err
