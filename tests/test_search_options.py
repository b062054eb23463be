"""`-p`, `--loss` and `--prior` of `diagnose` and `improve`: they reach every fit, and mean what `calibrate` means."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.complete_fit import with_prior
from pkmcal_cli.calibration.robust import Loss, normal_figures, weights_of
from pkmcal_cli.diagnosis.closed_loop import improve
from pkmcal_cli.diagnosis.first_fit import calibrated
from pkmcal_cli.diagnosis.refits import recalibrated
from pkmcal_cli.diagnosis.run_diagnosis import Diagnosis, diagnose
from pkmcal_cli.diagnosis.scoring import score_all
from pkmcal_cli.diagnosis.search_options import SearchOptions
from tests.benchmark.setting import ALPHA, Ready, ready
from tests.command import MACHINES, SCISSORS, TRIGLIDE, TRIGLIDE_DATA, clean, run
from tests.truth.campaigns import campaign, unit

pytestmark = pytest.mark.usefixtures("unsized")

SEED = 4
PLAY = unit("scissors", "backlash", "q3", SEED)
TRUE = PLAY.values["b"]


@cache
def case(rows: int = 80) -> Ready:
    return ready(campaign("scissors", [PLAY], SEED, rows=rows))


def few(there: Ready) -> Ready:
    """Searched for plays and two effects more alone."""
    names = {*(f"backlash@q{k}" for k in range(1, 5)), "straight@left.x", "thermal_strut@all"}
    kept = tuple(h for h in there.candidates.hypotheses if h.name in names)
    assert len(kept) == len(names)
    return replace(there, candidates=replace(there.candidates, hypotheses=kept))


def spoilt(share: float, rows: int = 80) -> tuple[Ready, set[int]]:
    """The same table with gross errors of 20 to 300 standard uncertainties in a share of the rows."""
    there, rng = case(rows), np.random.default_rng(1)
    readings = there.problem.readings.copy()
    bad = rng.permutation(len(readings))[: int(share * len(readings))]
    size = np.geomspace(20, 300, len(bad)) * rng.choice([-1, 1], len(bad))
    readings[bad] += there.problem.sigma[bad] * size[:, None]
    return replace(there, problem=replace(there.problem, readings=readings)), {int(r) for r in bad}


def diagnosed(there: Ready, loss: Loss = "squares") -> Diagnosis:
    return diagnose(there.candidates, there.problem, there.selected, ALPHA, SEED, loss=loss)


def size(found: Diagnosis) -> tuple[float, float]:
    """The play that was found: value and standard uncertainty, m."""
    (finding,) = found.findings
    assert finding.hypothesis.name == "backlash@q3"
    return finding.estimate[0], finding.std[0]


def moved(there: Ready) -> tuple[Array, int]:
    """Values (P,) with one held parameter a thousandth of its range off nominal, and which it is."""
    model = there.problem.model
    held = next(p for p in model.parameters if p.name not in there.selected and not p.fixed and p.range > 0)
    k, start = model.names.index(held.name), model.nominal
    start[k] += 1e-3 * held.range
    return start, k


# --- prior ---------------------------------------------------------------------------------
def test_ranges_as_prior_give_the_same_name_and_an_interval_that_holds_the_truth() -> None:
    there = case()
    known = replace(there, problem=with_prior(there.problem, there.selected, "ranges"))
    value, std = size(diagnosed(known))
    assert abs(value - TRUE) < 2 * std and std < 0.025 * TRUE  # 0.015 by noise; parameters that are held add the rest


@pytest.mark.slow
def test_scores_with_a_prior_are_those_of_fits_with_it() -> None:
    """The linear test predicts what chi-square, of readings and prior together, falls by in a fit with the effect.

    With noise a hundred times as large the data hardly count beside the ranges, so that a prior left out of either
    would show; backlash acts in proportion to its size, and parameters nearly do.
    """
    there = case()
    noisy = replace(there.problem, sigma=100 * there.problem.sigma)
    known = replace(there, problem=with_prior(noisy, there.selected, "ranges"))
    search = replace(diagnosed(known).search, accepted=(), bad_rows=())
    search = recalibrated(replace(search, problem=replace(known.problem, model=search.problem.model)))
    (play,) = (h for h in search.candidates.hypotheses if h.name == "backlash@q3")
    scored = score_all(search, [play])
    after = recalibrated(replace(search, accepted=(play.whole,)))
    fall = search.fit.chi2 - after.fit.chi2
    assert scored.linear.chi2 == pytest.approx(search.fit.chi2, rel=1e-3)
    assert fall == pytest.approx(scored.linear.score_of(play).statistic, rel=1e-3)
    without = recalibrated(replace(search, problem=replace(search.problem, prior=None)))
    assert without.fit.chi2 < search.fit.chi2 - 1, "the prior does count here"


# --- loss ----------------------------------------------------------------------------------
@pytest.mark.slow
@pytest.mark.parametrize("loss", ["huber", "tukey"])
def test_a_robust_loss_bears_gross_rows_that_hide_the_effect(loss: Loss) -> None:
    """Every eighth row is wrong by far: too many to be taken out one by one."""
    there, rows = spoilt(0.12)
    assert not diagnosed(there).findings, "by least squares nothing is found"
    found = diagnosed(there, loss)
    value, std = size(found)
    assert found.verdict == "found" and abs(value - TRUE) < 3 * std and std < 0.03 * TRUE
    assert found.weighed is not None
    assert {d.row for d in found.weighed.doubtful if abs(d.deviation) > 6} == rows, "and the rows are told"


@pytest.mark.slow
@pytest.mark.parametrize("loss", ["huber", "tukey"])
def test_a_robust_loss_changes_nothing_where_all_rows_are_good(loss: Loss) -> None:
    """Same name, same size; 5 % of efficiency are lost, a third of them in the uncertainty."""
    value, std = size(diagnosed(case(), loss))
    plain, own = size(diagnosed(case()))
    assert abs(value - plain) < own and own == pytest.approx(std, rel=0.1)


@pytest.mark.parametrize("loss", ["huber", "tukey"])
def test_weighted_squares_of_normal_noise_are_as_large_as_without_weights(loss: Loss) -> None:
    """And a mean that is weighted so scatters as much as is said, and 5 % more than the plain one (in variance)."""
    z = np.random.default_rng(0).normal(size=(20000, 100))
    level, inflation = normal_figures(loss)
    weight = weights_of(loss, z) / level
    assert float((weight * z**2).mean()) == pytest.approx(1.0, abs=5e-3)
    mean = np.zeros(len(z))
    for _ in range(30):
        weight = weights_of(loss, z - mean[:, None]) / level
        mean = (weight * z).sum(axis=1) / weight.sum(axis=1)
    assert mean.var() * 100 == pytest.approx(1 / 0.95, rel=0.03)
    assert inflation / float(weight.mean()) == pytest.approx(1 / 0.95, rel=0.03)


@pytest.mark.slow
def test_the_loop_bears_them_too() -> None:
    there = few(spoilt(0.12, 48)[0])
    start, k = moved(there)
    candidates = replace(there.candidates, start=start)
    found = improve(candidates, there.problem, there.selected, None, ALPHA, SEED, loss="tukey")
    assert found.fit.values[k] == start[k], "where a held parameter is"
    assert [h.name for h in found.accepted] == ["backlash@q3"] and found.confirmed and not found.failures
    value = found.fit.values[found.problem.model.names.index("backlash@q3.b")]
    std = found.fit.std[found.fit.selected.index("backlash@q3.b")]
    assert abs(value - TRUE) < 4 * std and std < 0.03 * TRUE


# --- start ---------------------------------------------------------------------------------
def test_fits_begin_where_the_parameter_file_says_and_held_parameters_stay_there() -> None:
    """Also one that is held: its value is that of the file in every fit, not the nominal one."""
    there = case()
    start, k = moved(there)
    begun = replace(there, candidates=replace(there.candidates, start=start))
    found = diagnosed(begun)
    assert found.before.before.values[k] == found.before.values[k] == start[k] != there.problem.model.nominal[k]
    assert all(fit.values[k] == start[k] for fit in (found.search.fit, found.before))
    assert found.search.null[k] == start[k]


def test_what_the_data_hardly_see_is_about_nominal_wherever_fits_begin() -> None:
    """With noise two hundred times as large ranges hold some combinations: the fit from afar is that from nominal."""
    there = case()
    problem, model = replace(there.problem, sigma=200 * there.problem.sigma), there.problem.model
    start, index = model.nominal, [model.names.index(n) for n in there.selected]
    start[index] += 0.3 * model.ranges[index]
    options = SearchOptions(alpha=ALPHA, seed=SEED)
    _, plain = calibrated(there.candidates, problem, there.selected, options)
    candidates, afar = calibrated(replace(there.candidates, start=start), problem, there.selected, options)
    assert afar.directions.weak.any() and not afar.directions.null.any()
    assert candidates.start is not None and afar.before.values is not start
    assert afar.values[index] == pytest.approx(plain.values[index], abs=1e-3 * model.ranges[index].min())
    assert np.abs(start - plain.values)[index].max() > 0.1 * model.ranges[index].min()


@pytest.mark.slow
def test_a_diagnosis_from_a_calibrated_file_gives_the_same_names(tmp_path: Path) -> None:
    """What the data hardly see is held by its range about nominal, wherever fits begin: so the fit is the same."""
    params = tmp_path / "p.yaml"
    table = str(MACHINES / "scissors-shopfloor.csv")
    run("calibrate", SCISSORS, table, "-o", params, "-q", "--holdout", "none")
    plain = clean(run("diagnose", SCISSORS, table, "--json")).json
    done = clean(run("diagnose", SCISSORS, table, "-p", params, "--json")).json
    assert [(e["effect"], e["at"]) for e in done["effects"]] == [(e["effect"], e["at"]) for e in plain["effects"]]
    assert done["chi2_per_dof_before"] == pytest.approx(plain["chi2_per_dof_before"], rel=1e-6)
    for mine, theirs in zip(done["effects"], plain["effects"], strict=True):
        for a, b in zip(mine["parameters"], theirs["parameters"], strict=True):
            assert a["value"] == pytest.approx(b["value"], abs=1e-3 * b["std"])
    assert set(done["provenance"]["inputs"]) - set(plain["provenance"]["inputs"]) == {str(params)}
    assert (done["loss"], done["prior"]) == ("squares", "none")


@pytest.mark.parametrize("command", ["diagnose", "improve"])
def test_wrong_files_and_words_are_the_errors_of_calibrate(command: str, tmp_path: Path) -> None:
    params = tmp_path / "p.yaml"
    assert run("calibrate", SCISSORS, MACHINES / "scissors.csv", "-o", params, "-q", "--holdout", "none").code == 0
    for wrong in (["-p", str(params)], ["--loss", "hube"], ["--prior", "range"], ["-p", "none.yaml"]):
        here, there = (run(c, TRIGLIDE, TRIGLIDE_DATA, *wrong) for c in (command, "calibrate"))
        assert here.code == there.code in (2, 3) and here.err == there.err and here.out == ""


@pytest.mark.parametrize("command", ["diagnose", "improve"])
def test_only_one_input_is_stdin(command: str) -> None:
    done = run(command, SCISSORS, "-", "-p", "-", stdin="")
    assert done.code == 2 and "only one input can be `-`" in done.err
