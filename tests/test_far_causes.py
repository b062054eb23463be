"""What is far off: belts with a length forgotten in each, by the independent simulator; and what is not far off."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pkmcal_cli.base.budget import Budget
from pkmcal_cli.calibration.identify import RowsFailed, identify
from pkmcal_cli.diagnosis import far_causes, far_starts
from pkmcal_cli.diagnosis.far_causes import with_far_causes
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.off_nominal import run_off
from pkmcal_cli.diagnosis.scoring import Search
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.workflow.search_case import CaseRequest, prepare
from tests.benchmark.setting import diagnosed
from tests.command import MACHINES, Done, clean, run
from tests.truth.campaigns import Planted, Scenario, campaign
from tests.truth.forgotten import forgotten, without_zeros, write

pytestmark = pytest.mark.usefixtures("unsized")

SEEDS = 20


def router(folder: Path, seed: int, upper: float = 0.0) -> tuple[Path, Path]:
    """Machine file and table."""
    machine, table = folder / "router.yaml", folder / f"{seed}.csv"
    machine.write_text(without_zeros((MACHINES / "belt-router.yaml").read_text(encoding="utf-8")), encoding="utf-8")
    write(forgotten(seed, 0.15, upper), table)
    return machine, table


def names(done: Done) -> set[str]:
    return {f"{e['effect']}@{e['at']}" for e in done.json["effects"]}


@pytest.mark.slow
def test_a_length_forgotten_in_every_belt_is_named(tmp_path: Path) -> None:
    """150 mm; a calibration without it moves the anchors by more than 100 mm and leaves 28 mm."""
    machine, table = router(tmp_path, 0)
    done = clean(run("diagnose", machine, table, "--json"))
    assert done.code == 1 and names(done) == {"zero@all"} and done.json["verdict"] == "found"
    (found,) = done.json["effects"]
    (size,) = found["parameters"]
    assert abs(size["value"] - 150_000) < 4 * size["std"] < 15_000, "with what the radii of drums that are held add"
    assert size["unit"] == "um"
    assert re.search(r"every drive is off by 1[45]\d\.?\d*\(\d+\) mm\.", done.err), "to people in millimetres"
    assert len(found["far_off"]) > 3 and max(map(abs, found["far_off"].values())) > 100, "anchors, in mm"
    assert "far beyond the plausible range: zero@all" in done.err
    assert "Without it, parameters come out far off nominal: " in done.err


@pytest.fixture(scope="module")
def search(tmp_path_factory: pytest.TempPathFactory) -> Search:
    """The router's search before anything is found, with lengths of belts (all and two) and two held parameters."""
    machine, table = router(tmp_path_factory.mktemp("router"), 0)
    case = prepare(CaseRequest(machine=str(machine), measurements=(str(table),)), Reporter(quiet=True))
    fit = identify(case.problem, case.selected)
    zeros, held = ([h for h in case.candidates.hypotheses if h.effect == e] for e in ("zero", "release"))
    few = [*zeros[:2], *(h for h in zeros[2:] if h.name == "zero@all")]
    candidates = replace(case.candidates, hypotheses=(*few, *held[:2]))
    return Search(candidates=candidates, problem=case.problem, declared=case.selected, fit=fit)


def test_a_far_cause_is_free_in_size_and_later_fits_begin_with_it(search: Search) -> None:
    found = with_far_causes(search)
    (zero,) = found.accepted
    k = found.problem.model.names.index("zero@all.o")
    assert dict(zero.begin) == {"zero@all.o": found.fit.values[k]} and found.fit.values[k] == pytest.approx(
        0.15, abs=4e-3
    )
    assert found.start[k] == found.fit.values[k]
    free, usual = found.problem.model.ranges, search.problem.model.ranges
    assert free[k] == search.problem.model.length > 100 * usual[k]
    assert np.array_equal(np.delete(free, k), np.delete(usual, k))
    assert with_far_causes(found) is found, "nothing else is far off"


def test_where_a_cause_of_usual_size_is_ahead_no_rival_that_is_far_is_named(
    search: Search, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A scale common to all drives fitted best, within its range: a group far beyond its own was named, as it was far.

    Here what is best counts as usual, and all others as far.
    """
    usual: list[str] = []

    def far(_: Search, hypothesis: Hypothesis, __: object) -> bool:
        usual.append(hypothesis.name)
        return hypothesis.name != "zero@all"

    monkeypatch.setattr(far_causes, "_explains", lambda *_: True)
    monkeypatch.setattr(far_causes, "_is_far", far)
    monkeypatch.setattr(far_causes, "_WORTH", 10.0)
    found = with_far_causes(search)
    assert not found.far_off and [h.name for h in found.accepted] == usual == ["zero@all"]
    assert found.fit.chi2 < 0.1 * search.fit.chi2 and found.p_values["zero@all"] < 1e-6, "as linear tests accept it"


@pytest.mark.parametrize("clearly", [far_causes._CLEARLY, np.inf])
def test_what_leaves_clearly_more_than_a_cause_of_all_is_not_fitted(
    clearly: float, search: Search, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The constant that was planted in all belts is tried first, and no constant of a single belt after it."""
    tried, plain = list[str](), far_causes._fit

    def watched(some: Search, hypothesis: Hypothesis, *more: Any) -> Any:
        tried.append(hypothesis.name)
        return plain(some, hypothesis, *more)

    monkeypatch.setattr(far_causes, "_fit", watched)
    monkeypatch.setattr(far_causes, "_CLEARLY", clearly)
    zeros = [h for h in search.open if h.effect == "zero"]
    found, untried = far_causes._screened(search, zeros, lambda _: None, Budget())
    assert [h.name for h in found] == ["zero@all"] and not untried
    assert tried[0] == "zero@all" and (set(tried) == {h.name for h in zeros}) is (clearly == np.inf)


def test_what_there_was_no_time_for_is_told(search: Search, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(far_causes, "Budget", lambda: Budget(0.0))
    hurried = with_far_causes(search)
    assert not hurried.accepted and set(hurried.untried) == {h.name for h in search.open if h.effect == "zero"}


def test_time_is_counted_once_held_parameters_were_tried(search: Search, monkeypatch: pytest.MonkeyPatch) -> None:
    """These alone took longer than all the time there is, and nothing else was tried."""
    events: list[str] = []
    monkeypatch.setattr(far_causes, "_held_explain", lambda _: bool(events.append("held")))
    monkeypatch.setattr(far_causes, "Budget", lambda: events.append("time") or Budget())
    monkeypatch.setattr(far_causes, "_best", lambda *_: events.append("causes") or (None, ()))
    assert with_far_causes(search) is not None and events == ["held", "time", "causes"]


def test_a_parameter_that_runs_off_is_named(search: Search) -> None:
    """How many ranges the anchors are off, the furthest first; not those that came out near nominal."""
    model, (one, *_, other) = search.problem.model, search.declared
    values = model.nominal
    for name, times in ((one, 12.0), (other, -30.0)):
        k = model.names.index(name)
        values[k] += times * model.ranges[k]
    off = run_off(replace(search, fit=replace(search.fit, values=values)))
    assert list(off) == [other, one] and off == pytest.approx({other: 30.0, one: 12.0})


@pytest.mark.slow
def test_a_far_cause_explains_most_of_what_is_left(search: Search, monkeypatch: pytest.MonkeyPatch) -> None:
    """By the share that is asked for: where it is more than any cause explains, none is named."""
    monkeypatch.setattr(far_causes, "_EXPLAINED", 1 - 1e-6)
    assert not with_far_causes(search).far_off


def test_a_nominal_machine_that_predicts_nothing_has_no_far_cause(
    search: Search, monkeypatch: pytest.MonkeyPatch
) -> None:
    def lost(*_: object) -> None:
        raise RowsFailed(search.fit.after)

    monkeypatch.setattr(far_starts, "linear_problem", lost)
    assert with_far_causes(search) is search


@pytest.mark.slow
def test_improve_corrects_what_is_far_off(tmp_path: Path) -> None:
    """Rows that took no part are predicted as well as by the machine that has the length declared."""
    machine, table = router(tmp_path, 0)
    better = tmp_path / "better.yaml"
    done = clean(run("improve", machine, table, "-o", better, "--json"))
    assert done.code == 0 and [s["accepted"] for s in done.json["steps"]] == [True]
    after = done.json["steps"][-1]["report"]["span"]["rms"]
    true = tmp_path / "true.yaml"
    true.write_text(f"extends: {machine}\neffects: {{zero@all: {{o: {{value: 150 mm, range: 5 mm}}}}}}\n")
    told = clean(run("calibrate", true, table, "--json"))
    assert after <= 1.15 * told.json["heldout"]["after"]["span"]["rms"]
    assert clean(run("calibrate", better, table, "--json")).json["status"] == "converged"


@pytest.mark.slow
@pytest.mark.parametrize("upper", [0.0, -0.004])
def test_forgotten_lengths_are_named_in_all_campaigns(upper: float, tmp_path: Path) -> None:
    """Of 20 seeds: the length in all belts, and drums of the upper ones that are 0.4 % too small."""
    told = [names(clean(run("diagnose", *router(tmp_path, s, upper), "--json"))) for s in range(SEEDS)]
    wanted = {"zero@all"} if not upper else {"zero@all", "release@Rtop"}
    assert np.mean([wanted <= t for t in told]) >= 0.95, told


@pytest.mark.parametrize(
    ("machine", "planted", "scenario", "rows"),
    [
        ("triglide", [Planted("zero_drift", "q1", {"o1": 5e-4})], Scenario(), 160),
        ("scissors", [], Scenario(outliers=0.03), 60),
    ],
    ids=["a drive that drifts by 1 mm", "gross rows"],
)
def test_what_drifts_or_is_gross_is_not_far_off(
    machine: str, planted: list[Planted], scenario: Scenario, rows: int
) -> None:
    """More rows than are screened with, and few."""
    assert not diagnosed(campaign(machine, planted, 3, rows=rows, scenario=scenario), 0).search.far_off
