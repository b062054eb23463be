"""What could stand in the place of an effect: the set holds the effect, fits correct scores, resamples count alike."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pkmcal_cli.diagnosis import refine
from pkmcal_cli.diagnosis.refine import credible_set, final_evidence, set_of
from pkmcal_cli.diagnosis.scoring import score_without
from pkmcal_cli.diagnosis.stability import stability
from pkmcal_cli.diagnosis.warming import alike_in_time
from pkmcal_cli.report.diagnosis import DiagnosisReport
from tests.benchmark.cases import case
from tests.benchmark.setting import diagnosed, machine
from tests.test_search import SEED, at, planted
from tests.truth.campaigns import Planted, Scenario, campaign, unit


def test_a_set_holds_what_it_is_the_set_of() -> None:
    """A wrong name beside overwhelming evidence for the right one: both are in its set, the right one first."""
    search = at(planted(("backlash", "q3", 1.0)), "backlash@q1")
    members = set_of(search, search.accepted[0]).members
    assert members[0].name == "backlash@q3" and search.accepted[0] in members


def test_no_rival_is_ahead_by_its_score_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where fits say that those with the best scores are far worse, the next ones are fitted too."""
    search = at(planted(("backlash", "q3", 1.0)), "backlash@q1")
    accepted = search.accepted[0]
    without = score_without(search, [accepted], (accepted, *search.open_without([accepted])))
    ahead = int((without.log_bayes > without.log_bayes[0]).sum())
    fitted = []

    def worse(*arguments: object) -> float:
        fitted.append(arguments[-1])
        return -1000.0

    monkeypatch.setattr(refine, "_fitted_gain", worse)
    evidence = final_evidence(search, accepted, without)
    assert ahead > refine.RIVALS and int(np.argmax(evidence)) == 0
    assert len(fitted) == len(set(fitted)) <= 12


def test_a_shape_counts_in_fits_as_in_scores() -> None:
    """A scale with a ripple, beside a turn of the carriage that acts alike and has one number more: both are named."""
    scale = case("single", 372)
    (finding,) = diagnosed(scale.measured(), scale.seed).findings
    assert {r.hypothesis.name for r in finding.rivals} == {"scale@q2", "carriage_angle@c2.rz"}
    assert scale.drawn[0].cosine > 0.9999, "no data tell them apart"


@pytest.mark.slow
def test_what_scores_tell_nothing_of_is_judged_by_fits(monkeypatch: pytest.MonkeyPatch) -> None:
    """An effect that is far off where the others are linear: rivals whose fits are worse do not stand in its place."""
    search = at(planted(("backlash", "q3", 1.0)), "backlash@q3")
    accepted = search.accepted[0]
    without = score_without(search, [accepted], (accepted, *search.open_without([accepted])))
    blind = without.scores[0]
    blind = replace(blind, basis=blind.basis[:, :0], information=np.zeros(0), gradient=np.zeros(0))
    unseen = replace(
        without,
        scores=(blind, *without.scores[1:]),
        log_bayes=np.concatenate([[-np.inf], without.log_bayes[1:]]),
    )
    evidence = final_evidence(search, accepted, unseen)
    kept = credible_set(without, evidence, np.zeros(len(evidence), dtype=bool))
    assert np.isfinite(evidence[0]) and [r.hypothesis.name for r in kept] == ["backlash@q3"]


def test_resamples_count_sizes_beyond_ranges_as_all_rows_do() -> None:
    """What has little evidence although it explains most, because its size is improbable, has little in resamples."""
    backlash = planted(("backlash", "q3", 1.0))
    search = at(backlash)
    without = score_without(search, [], search.open)
    order = [int(k) for k in np.argsort(-without.log_bayes)]
    best = order[0]
    second = next(k for k in order if without.hypotheses[k].effect != without.hypotheses[best].effect)
    priced = without.log_bayes.copy()
    priced[best] = priced[second] - 20.0
    rival = without.hypotheses[second]
    resampled = stability(replace(without, log_bayes=priced), priced, backlash.problem, rival, [], 0)
    assert dict(resampled.others).get(without.hypotheses[best], 0.0) < 0.2


def test_a_cooling_phase_decides_where_time_and_temperature_go_together() -> None:
    """Also where all corrections agree in the measured region; and nothing is in the set twice."""
    drive = replace(unit("scissors", "thermal_screw", "q2", SEED), values={"o": 1e-6})
    warms = diagnosed(campaign("scissors", [drive], SEED, scenario=Scenario(swing=0.0, warming=6.0)), SEED)
    report = DiagnosisReport(machine("scissors")[0], None, warms)  # type: ignore[arg-type]
    (finding,) = [f for f in warms.findings if f.ambiguous]
    alike = replace(finding, rivals=tuple(replace(r, cosine=1.0) for r in finding.rivals))
    assert "a cooling phase would decide" in report._alternatives(alike)
    names = [r.hypothesis.name for r in finding.rivals]
    assert len(names) == len(set(names)) and finding.hypothesis.name in names


def test_a_drift_of_the_instrument_is_in_the_set_of_a_drive_that_moves_the_tool_as_it_does() -> None:
    """Both have one course in time; in the direction of the drive its one number has more evidence than three."""
    drifts = Planted("drift", "tracker", {"x1": 0.7e-6, "y1": 7.0e-6, "z1": 2.9e-6})
    (finding,) = diagnosed(campaign("delta4", [drifts], 19), 19).findings
    members = {r.hypothesis.name: r for r in finding.rivals}
    assert finding.hypothesis.name == "zero_drift@q2" and finding.ambiguous
    assert members["drift@tracker"].cosine > 0.95 and not any(r.hypothesis.members for r in finding.rivals)


def test_a_drift_that_the_table_tells_from_the_instruments_stands_alone() -> None:
    drive = Planted("zero_drift", "q1", {"o1": 60e-6})
    (finding,) = diagnosed(campaign("triglide", [drive], 3), 3).findings
    assert [r.hypothesis.name for r in finding.rivals] == ["zero_drift@q1"]


def test_drifts_of_all_drives_together_imitate_any_drift_and_are_no_rivals_of_one() -> None:
    """A drive's drift is that of the instrument, whichever of them was accepted."""
    search = diagnosed(campaign("triglide", [], 3), 3).search
    names = ("drift@tracker", "zero_drift@q1", "zero_drift@q2", "zero_drift@each", "backlash@q1")
    some = {h.name: h for h in search.candidates.hypotheses if h.name in names}
    for one, rivals in (("drift@tracker", {"zero_drift@q1", "zero_drift@q2"}), ("zero_drift@q1", {"drift@tracker"})):
        alike = alike_in_time(search.problem, some[one], list(some.values()))
        assert {name for name, yes in zip(some, alike, strict=True) if yes} == rivals
    assert len(some) == len(names)
