"""An effect is told by its lowest numbers where these suffice, and by more where they are needed."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.calibration.selection import select
from pkmcal_cli.diagnosis.alpha import Alpha
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.scoring import score_all, scored
from pkmcal_cli.diagnosis.threshold import critical_p, smallest_p
from pkmcal_cli.loading.load_machine import load_machine
from pkmcal_cli.report.improved_machine import null_lines
from tests.benchmark.setting import ALPHA, FOLDER, Setting, diagnosed
from tests.truth.campaigns import Planted, Scenario, campaign
from tests.truth.families_true import PERIOD

PLAIN = Scenario(extra=0.0)


@cache
def found(*planted: tuple[str, str, tuple[tuple[str, float], ...]]) -> tuple[tuple[str, frozenset[str]], ...]:
    """Names of effects, and which of their numbers are told."""
    effects = [Planted(keyword, at, dict(values)) for keyword, at, values in planted]
    findings = diagnosed(campaign("scissors", effects, 2, scenario=PLAIN), 2).findings
    told = [(f.hypothesis.name, f.hypothesis.parameters) for f in findings]
    return tuple((name, frozenset(n.rpartition(".")[2] for n in numbers)) for name, numbers in told)


def test_a_linear_drift_is_told_as_one() -> None:
    assert found(("drift", "grid", (("x1", 8e-6), ("y1", -6e-6)))) == (("drift@grid", frozenset({"x1", "y1"})),)


@pytest.mark.slow
def test_a_drift_that_bends_has_all_its_numbers() -> None:
    bent = (("x1", 8e-6), ("y1", -6e-6), ("x2", 7e-6), ("y2", 5e-6))
    assert found(("drift", "grid", bent)) == (("drift@grid", frozenset({"x1", "y1", "x2", "y2"})),)


@pytest.mark.slow
def test_higher_numbers_alone_are_found_too() -> None:
    """Parts hold all numbers up to an order: of a curve of the third, that of the second as well."""
    ((name, numbers),) = found(("pitch_curve", "q2", (("p3", 12e-6),)))
    assert name == "pitch_curve@q2" and {"p2", "p3"} <= numbers < {"p2", "p3", "p4", "p5", "p6"}


ONCE, TWICE = (("c", 5e-6), ("s", -4e-6)), (("c2", 3e-6), ("s2", 5e-6))


@pytest.mark.parametrize("numbers", [ONCE, TWICE, ONCE + TWICE], ids=["once", "twice", "both"])
def test_harmonics_are_told_each_by_itself_and_together(numbers: tuple[tuple[str, float], ...]) -> None:
    """No harmonic comes before another: a strain-wave gear errs twice a turn and not once."""
    told = found(("pitch", "q2", (*numbers, ("period", PERIOD["scissors"]))))
    assert told == (("pitch@q2", frozenset(name for name, _ in numbers)),)


def test_parts_of_harmonics_are_the_first_the_second_and_all() -> None:
    (pitch,) = (h for h in Setting.of("scissors", 1).ready.candidates.hypotheses if h.name == "pitch@q1")
    first, second, both = (tuple(n.rpartition(".")[2] for n in p.parameters) for p in pitch.nested_parts)
    assert (first, second, both) == (("c", "s"), ("c2", "s2"), ("c", "s", "c2", "s2"))
    once, _, whole = pitch.nested_parts
    assert pitch.beyond(once).nested_parts == (whole,)


def test_parts_are_nested_and_end_with_the_whole() -> None:
    hypotheses = Setting.of("scissors", 1).ready.candidates.hypotheses
    for h in (h for h in hypotheses if h.effect != "pitch"):
        sizes = [len(p.parameters) for p in h.nested_parts]
        assert sizes == sorted(set(sizes)) and h.nested_parts[-1] == h
        assert all(set(a.parameters) < set(b.parameters) for a, b in zip(h.nested_parts, h.nested_parts[1:]))
        assert all(set(h.free) <= set(p.parameters) for p in h.nested_parts), "a mean is free in every part"
    group = next(h for h in hypotheses if h.name == "pitch_curve@each")
    (least, *_) = group.nested_parts
    assert {n.rpartition(".")[2] for n in least.parameters} == {"p2"} and len(least.members) == len(group.members)
    assert [m.parameters for m in least.members] == [(n,) for n in least.parameters]


def test_a_part_is_contained_and_is_the_same_effect() -> None:
    whole = Hypothesis(effect="drift", at="grid", parameters=("x1", "x2"), parts=(("x1",),))
    part, same = whole.nested_parts
    assert whole.contains(part) and not part.contains(whole) and same == whole and not whole.contains(same)
    assert whole.beyond(part).nested_parts == (same,)


def test_the_threshold_counts_all_parts() -> None:
    """The smallest p value of pure noise is smaller if parts are tested too."""
    setting = Setting.of("scissors", 1)
    hypotheses, linear = setting.ready.candidates.hypotheses, setting.linear
    parts = [p for h in hypotheses for p in h.nested_parts]
    draws = [
        smallest_p(linear, [linear.tested(h) for h in some], [linear.score_of(h) for h in some], 0)
        for some in ([h.whole for h in hypotheses], parts)
    ]
    assert np.quantile(draws[1], 0.01) < 0.97 * np.quantile(draws[0], 0.01)


def test_what_is_not_needed_is_held_where_it_is_written(tmp_path: Path) -> None:
    """A calibration of the written machine fits what was told, and no more."""
    search = diagnosed(campaign("scissors", [Planted("drift", "grid", {"x1": 8e-6})], 2, scenario=PLAIN), 2).search
    assert "drift@grid.x1" in search.selected and "drift@grid.x2" not in search.selected
    (drift,) = search.accepted
    written = tmp_path / "written.yaml"
    numbers = "".join(f"    {n.rpartition('.')[2]}: 1 um\n" for n in drift.parameters)
    needless = "\n".join(null_lines(search.problem.model, drift))
    written.write_text(f"extends: {FOLDER / 'scissors.yaml'}\neffects:\n  drift@grid:\n{numbers}{needless}\n")
    model = load_machine(str(written)).model
    assert {n for n in select(model, "auto") if n.startswith("drift@grid")} == set(drift.parameters)
    assert {n for n in model.names if n.startswith("drift@grid")} > set(drift.parameters)


def test_a_choice_among_parts_costs_its_number() -> None:
    """The evidence of the best part, less the log of how many were seen."""
    setting = Setting.of("scissors", 1)
    problem, linear = setting.ready.problem, setting.linear
    drift = next(h for h in setting.ready.candidates.hypotheses if h.name == "drift@grid")
    whole = scored(linear, problem, [drift])
    parts = scored(linear, problem, drift.nested_parts)
    assert len(parts.log_bayes) == 2 and all(s.count for s in parts.scores)
    assert whole.log_bayes[0] == pytest.approx(parts.log_bayes.max() - np.log(2), abs=1e-12)


def test_more_numbers_of_an_accepted_part_stay_open() -> None:
    search = diagnosed(campaign("scissors", [Planted("drift", "grid", {"x1": 8e-6})], 2, scenario=PLAIN), 2).search
    (drift,) = search.accepted
    (more,) = (h for h in search.open if h.name == "drift@grid")
    assert set(more.parameters) > set(drift.parameters) and more.nested_parts == (more,)
    assert "drift@grid" in {h.name for h in search.open_without([drift])}


def test_the_search_stands_on_that_threshold() -> None:
    """Of all parts of all hypotheses that were searched, at the share of false alarms that these have."""
    found = diagnosed(campaign("scissors", [], 2, scenario=PLAIN), 2)
    hypotheses = [p for h in found.search.candidates.hypotheses for p in h.nested_parts]
    linear = score_all(found.search, found.search.open).linear
    columns = [linear.tested(h) for h in hypotheses]
    draws = smallest_p(linear, columns, [linear.score_of(h) for h in hypotheses], 2)
    assert not found.findings and found.search.critical == pytest.approx(critical_p(draws, Alpha(ALPHA).catalogue))
