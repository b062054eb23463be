"""The search for effects: forks, steps back, exchanges, rows held out together, warming, what is refuted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.diagnosis import exchanges
from pkmcal_cli.diagnosis import search as searching
from pkmcal_cli.diagnosis.confirm import blocks
from pkmcal_cli.diagnosis.exchanges import swapped
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.refine import set_of
from pkmcal_cli.diagnosis.refits import recalibrated, refit
from pkmcal_cli.diagnosis.refuted import refuted_causes
from pkmcal_cli.diagnosis.scoring import Scored, Search, score_all
from pkmcal_cli.diagnosis.search import needed_only, run_search
from pkmcal_cli.diagnosis.search_options import SearchOptions
from tests.benchmark.cases import case as of_benchmark
from tests.benchmark.setting import ALPHA, Ready, diagnosed, ready
from tests.truth.campaigns import Scenario, campaign, unit

SEED = 4


@cache
def planted(*effects: tuple[str, str, float]) -> Ready:
    """A campaign on the Scissors with effects of multiples of their usual size."""
    return ready(campaign("scissors", [unit("scissors", k, at, SEED).scaled(f) for k, at, f in effects], SEED))


def at(case: Ready, *names: str) -> Search:
    """The search where these effects are accepted and fitted, with the threshold of a whole one."""
    fit = identify(case.problem, case.selected)
    begun = Search(candidates=case.candidates, problem=case.problem, declared=case.selected, fit=fit)
    by_name = {h.name: h.whole for h in case.candidates.hypotheses}
    accepted = tuple(by_name[n] for n in names)
    evidence = dict.fromkeys(names, 0.0)
    return recalibrated(replace(begun, accepted=accepted, critical=1e-5, evidence=evidence, p_values=evidence))


def names(hypotheses: Sequence[Hypothesis]) -> set[str]:
    return {h.name for h in hypotheses}


def test_an_effect_that_others_make_needless_goes() -> None:
    """What was accepted first by chance is not needed once the cause is there; the cause itself stays."""
    case = planted(("backlash", "q3", 1.0))
    assert names(needed_only(at(case, "pitch_curve@q1", "backlash@q3")).accepted) == {"backlash@q3"}
    both = planted(("backlash", "q3", 1.0), ("straight", "left.x", 2.0))
    kept = needed_only(at(both, "straight@left.x", "backlash@q3"))
    assert names(kept.accepted) == {"straight@left.x", "backlash@q3"}


@pytest.mark.slow
def test_two_that_stand_for_two_others_are_exchanged_together() -> None:
    """Windup of two drives for their backlash: with one of them exchanged nothing is better."""
    case = planted(("backlash", "q3", 1.0), ("backlash", "q4", 1.0))
    wrong, right = at(case, "windup@q3", "windup@q4"), at(case, "backlash@q3", "backlash@q4")
    assert right.fit.chi2 < wrong.fit.chi2
    assert names(swapped(wrong).accepted) == names(right.accepted) == names(swapped(right).accepted)


def test_a_row_without_a_side_counts_less_by_what_is_declared_or_accepted_and_no_longer() -> None:
    """Its first row: reversal of the drives that have some is part of their uncertainty there, and nowhere else."""

    def drives(search: Search) -> set[str]:
        sigma = search.problem.side_sigma
        assert sigma is None or not sigma[1:].any()
        named = [a.name for a in search.problem.model.actuators]
        return set() if sigma is None else {name for name, s in zip(named, sigma[0], strict=True) if s}

    case = planted(("backlash", "q3", 1.0))
    rows = case.problem.rows
    sides = {n: np.where(np.arange(len(rows)) > 0, v, 0) for n, v in rows.columns.items() if n.startswith("dir.")}
    problem = replace(case.problem, rows=replace(rows, columns={**rows.columns, **sides}))
    without = replace(at(case), problem=problem)
    (q3,) = at(case, "backlash@q3").accepted
    found = without.accepting([q3])
    assert (drives(without), drives(found), drives(found.accepting((), [q3]))) == (set(), {"q3"}, set())
    declared = replace(without, declared=(*without.declared, "backlash@q1.b")).accepting([q3])
    assert (drives(declared), drives(declared.accepting((), [q3]))) == ({"q1", "q3"}, {"q1"})


def test_what_an_exchange_makes_needless_goes() -> None:
    case = planted(("backlash", "q3", 1.0))
    assert names(swapped(at(case, "backlash@q1", "pitch_curve@q2")).accepted) == {"backlash@q3"}


def test_of_a_group_the_members_that_are_needed_stay() -> None:
    """Three drives of four with play: the fourth's is nothing, so the group is no shorter way to say it."""
    case = planted(("backlash", "q1", 1.0), ("backlash", "q2", 0.7), ("backlash", "q3", 0.5))
    assert names(swapped(at(case, "backlash@each")).accepted) == {"backlash@q1", "backlash@q2", "backlash@q3"}


def test_a_group_whose_members_are_all_needed_stays() -> None:
    """Two drives that both have play, of a machine with two: one by one they say the same."""
    effects = [unit("triglide-nonredundant", "backlash", q, SEED).scaled(f) for q, f in (("q1", 1.0), ("q2", 0.4))]
    case = ready(campaign("triglide-nonredundant", effects, SEED))
    assert names(swapped(at(case, "backlash@each")).accepted) == {"backlash@each"}


def test_exchanges_that_lead_too_far_keep_what_was_better_on_the_way(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a strong effect the noise seems so large that fewer numbers seem to do: that step alone is taken back."""
    case = planted(("backlash", "q3", 1.0))
    way = [at(case, "backlash@q3"), at(case, "pitch_curve@q2")]
    monkeypatch.setattr(exchanges, "_walk", lambda search: iter(way))
    assert names(swapped(at(case, "backlash@q3", "pitch_curve@q2")).accepted) == {"backlash@q3"}


@pytest.mark.parametrize("one", ["drift@grid", "resetup@s2"])
def test_one_that_stands_for_two_is_exchanged_for_both(one: str) -> None:
    case = planted(("drift", "grid", 1.0), ("resetup", "s2", 1.0))
    assert names(swapped(at(case, one)).accepted) == {"drift@grid", "resetup@s2"}


def test_what_a_shape_has_beyond_its_formula_is_no_pair_of_others() -> None:
    """A guide's simulated curve has a ripple that two screws of its carriages would explain as pitch."""
    case = of_benchmark("two", 78)
    d = diagnosed(case.measured(), case.seed)
    assert names([f.hypothesis for f in d.findings]) == {x.name for x in case.drawn} and not d.unknown


def test_two_kinds_of_effects_are_told_from_one_kind_at_several_places() -> None:
    """Struts and one screw that grow: the screws, each with values of its own, explain it to the noise as well."""
    case = of_benchmark("two", 5)
    found = names(swapped(at(ready(case.measured()), "thermal_screw@each")).accepted)
    assert found == {d.name for d in case.drawn} == {"thermal_strut@all", "thermal_screw@q2"}


def test_effects_of_one_kind_are_priced_by_the_ways_to_choose_them() -> None:
    """One of K; several of a kind of which there are n also by n!/(m! (n - m)!) choices of m."""
    case = planted(("backlash", "q3", 1.0))
    search, every = at(case), {h.name: h for h in case.candidates.hypotheses}
    kinds = [h.effect for h in every.values()]
    n, total = kinds.count("backlash"), len(kinds)
    three = [every[f"backlash@q{k}"] for k in (1, 2, 3)]
    assert search.price(three[:1]) == pytest.approx(np.log(total))
    assert search.price(three) == pytest.approx(np.log(total * n * (n - 1) * (n - 2) / 6))
    both = search.price([three[0], every["windup@q1"]])
    assert both == pytest.approx(2 * np.log(total))


def test_a_displacement_without_a_name_that_leaves_effects_does_not_stand_for_all() -> None:
    """A guide that is not straight and a screw's pitch: one free shape at the guide explains nearly all of both."""
    case = of_benchmark("two", 1)
    d = diagnosed(case.measured(), case.seed)
    assert names([f.hypothesis for f in d.findings]) == {x.name for x in case.drawn} and not d.unknown


def test_what_cannot_be_decided_is_followed_both_ways(monkeypatch: pytest.MonkeyPatch) -> None:
    """The end with most evidence is the search's, whichever way was seen first."""
    case = planted(("backlash", "q3", 1.0))
    plain = searching._best_of
    for first in ("backlash@q1", "backlash@q3"):

        def forked(search: Search, scored: Scored, evidence: np.ndarray, first: str = first) -> list[Search]:
            if search.accepted:
                return plain(search, scored, evidence)
            by_name = {h.name: h for h in scored.hypotheses}
            ways = [first, *({"backlash@q1", "backlash@q3"} - {first})]
            forks = [replace(search, accepted=(by_name[n],)) for n in ways]
            return [replace(f, fit=fit) for f in forks if (fit := refit(f, {})) is not None]

        monkeypatch.setattr(searching, "_best_of", forked)
        begun = at(case)
        assert names(run_search(begun, SearchOptions(alpha=ALPHA, seed=SEED)).accepted) == {"backlash@q3"}


def test_repeated_poses_are_held_out_together_and_few_poses_one_by_one() -> None:
    case = planted(("backlash", "q3", 1.0))
    by_name = {h.name: h.whole for h in case.candidates.hypotheses}
    few = case.problem.take(np.repeat(np.arange(12), 3))
    labels, scheme = blocks(few, by_name["backlash@q3"])
    assert scheme == "each pose in turn" and len(set(labels)) == 12
    assert all(len(set(labels[3 * k : 3 * k + 3])) == 1 for k in range(12))
    many = case.problem.take(np.repeat(np.arange(60), 2))
    for name, wanted in (("backlash@q3", "random poses"), ("straight@left.x", "workspace cells")):
        labels, scheme = blocks(many, by_name[name])
        assert scheme == wanted and len(set(labels)) > 2 and (labels[::2] == labels[1::2]).all()


@pytest.mark.slow
def test_where_time_and_temperature_go_together_no_evidence_decides_between_drifts_and_heat() -> None:
    """A drive that drifts in a hall that only warms: every drift and thermal effect that fits stays in the set."""
    drive = replace(unit("scissors", "thermal_screw", "q2", SEED), values={"o": 1e-6})
    warms = diagnosed(campaign("scissors", [drive], SEED, scenario=Scenario(swing=0.0, warming=6.0)), SEED)
    (finding,) = warms.findings
    weight = {r.hypothesis.name: r.weight for r in finding.rivals}
    assert warms.verdict == "ambiguous" and weight.keys() >= {"thermal_screw@q2", "zero_drift@q2", "thermal_foot@left"}
    assert weight["thermal_foot@left"] < 0.01, "hardly any evidence for it, but it fits"
    cools = diagnosed(campaign("scissors", [drive], SEED, scenario=Scenario(swing=4.0, warming=0.0)), SEED)
    assert cools.verdict == "found"
    assert [[r.hypothesis.name for r in f.rivals] for f in cools.findings] == [["thermal_screw@q2"]]


def test_what_held_out_rows_speak_against_is_unknown_as_long_as_it_is_significant() -> None:
    case = planted(("backlash", "q3", 1.0))
    by_name = {h.name: h.whole for h in case.candidates.hypotheses}
    vetoed = replace(at(case), vetoed=(by_name["backlash@q3"],))
    (unknown,) = refuted_causes(vetoed, score_all(vetoed, vetoed.open))
    assert unknown.depends_on == "direction" and "backlash@q3 fits" in unknown.hint and unknown.p_value < 1e-5
    explained = replace(at(case, "backlash@q3"), vetoed=(by_name["backlash@q1"],))
    assert refuted_causes(explained, score_all(explained, explained.open)) == []


@pytest.mark.slow
def test_the_set_of_an_effect_is_judged_where_the_search_has_come_to() -> None:
    case = planted(("backlash", "q3", 1.0))
    near = set_of(at(case, "backlash@q1"), at(case, "backlash@q1").accepted[0])
    assert near.members[0].name == "backlash@q3"


def test_a_gross_row_does_not_hide_in_the_noise_that_it_makes() -> None:
    """Rows are judged by the noise of the others: with an estimated variance, one row of 40 would raise its own."""
    case = planted(("backlash", "q3", 1.0))
    few = case.problem.take(np.arange(40))
    noisy = replace(few, readings=few.readings + np.random.default_rng(3).normal(0, 2 * few.sigma))
    readings = noisy.readings.copy()
    readings[17] += 30 * few.sigma[17]
    scored = score_all(at(replace(case, problem=replace(noisy, readings=readings)), "backlash@q3"), ())
    others = noisy.without((17,))
    fair = score_all(at(replace(case, problem=others), "backlash@q3"), ())
    assert scored.scale.variance > 1.2 * fair.scale.variance
    rest = np.delete(np.arange(40), 17)
    ratio = scored.rows.statistic[rest].mean() / fair.rows.statistic[rest].mean()
    assert abs(ratio - 1) < 0.15 and scored.rows.p_value[17] < 1e-5
