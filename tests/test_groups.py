"""Groups of places: which there are, effects that are the same at their members, or have values of their own."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.refine import CredibleSet, Rival
from pkmcal_cli.effects import catalogue
from pkmcal_cli.loading.load_machine import load_machine
from pkmcal_cli.model.effect_sites import places, together
from tests.benchmark.setting import diagnosed
from tests.command import MACHINES, clean, column, run
from tests.truth.campaigns import Planted, campaign

pytestmark = pytest.mark.usefixtures("unsized")

BELTS = MACHINES / "belt-router.yaml"
PLAYS = {"q1": 12e-6, "q2": 25e-6, "q3": 18e-6, "q4": 9e-6}


@pytest.mark.parametrize(
    ("machine", "groups"),
    [
        ("belt-router", {"upper": {"TL", "TR", "beltTL", "beltTR"}, "lower": {"BL", "BR", "beltBL", "beltBR"}}),
        ("hangprinter", {"upper": {"D", "lineD"}, "A+B+C": {"A", "B", "C"}}),
        ("delta4", {"q1+q2+q3": {"q1", "q2", "q3"}}),
    ],
)
def test_members_that_may_err_alike_are_known(machine: str, groups: dict[str, set[str]]) -> None:
    """By the file: A, B and C of the hangprinter stand on the floor and come from one `each`, D hangs above."""
    found = load_machine(str(MACHINES / f"{machine}.yaml"), receptive=True).model.effect_groups
    for name, members in groups.items():
        assert set(found[name]) == members
    assert len({frozenset(m) for m in found.values()}) == len(found)


def test_machines_whose_drives_stand_at_one_height_have_none_above() -> None:
    assert "upper" not in load_machine(str(MACHINES / "hexapod7.yaml"), receptive=True).model.effect_groups


def test_a_group_is_a_place_where_several_of_its_members_are_and_not_all() -> None:
    """Of the drives of the hangprinter only D hangs above, and A, B and C are those below."""
    model = load_machine(str(MACHINES / "hangprinter.yaml"), receptive=True).model
    at = set(places(model.sites, catalogue()["scale"], (), model.effect_groups))
    assert at == {"A", "B", "C", "D", "all", "lower"}
    assert set(together(model.sites, catalogue()["scale"], model.effect_groups)) == {"each", "each:lower"}


def simulated(name: str, effects: str, folder: Path) -> np.ndarray:
    """The tape's readings (N,) of the belt router with some effects."""
    file = folder / f"{name}.yaml"
    groups = "groups: {pair: [TL, TR]}"
    file.write_text(f"extends: {BELTS}\n{groups}\neffects: {{{effects}}}\n")
    done = clean(run("simulate", file, MACHINES / "belt-router.csv", "-o", folder / f"{name}.csv", "--force"))
    assert done.code == 0, done.err
    return np.array(column(folder / f"{name}.csv", "tape"))


def test_an_effect_of_a_group_acts_at_each_of_its_members(tmp_path: Path) -> None:
    """The same machine, said in two ways; what the group does not hold stays."""
    alike = simulated("alike", "scale@pair: {s: 500 um/m}", tmp_path)
    both = simulated("both", "scale@TL: {s: 500 um/m}, scale@TR: {s: 500 um/m}", tmp_path)
    one = simulated("one", "scale@TL: {s: 500 um/m}", tmp_path)
    np.testing.assert_allclose(alike, both, rtol=0, atol=1e-9)
    assert np.nanmax(np.abs(alike - one)) > 1e-3


@pytest.mark.parametrize(
    ("groups", "told"),
    [
        ("{top: [TL, beltTl]}", ("did you mean `belt", "`beltTl` is no drive")),
        ("{top: [TL, TL]}", ("fewer than two members", "upper: [q1, q2]")),
        ("{all: [TL, TR]}", ("`all` stands for all places", "choose another name")),
        ("{tape: [TL, TR]}", ("`tape` is the name of a part", "choose another name")),
    ],
)
def test_wrong_groups_are_told_where_they_stand(groups: str, told: tuple[str, ...], tmp_path: Path) -> None:
    file = tmp_path / "m.yaml"
    file.write_text(f"extends: {BELTS}\ngroups: {groups}\n")
    done = clean(run("check", file))
    assert done.code == 1 and f"{file}:2:" in done.err and all(words in done.err for words in told), done.err


def test_an_effect_with_values_of_its_own_at_every_drive_is_one_cause() -> None:
    """Four drives with play of different sizes."""
    planted = [Planted("backlash", q, {"b": b}) for q, b in PLAYS.items()]
    (finding,) = diagnosed(campaign("scissors", planted, 11), 11).findings
    assert finding.hypothesis.name == "backlash@each"
    for name, value, std in zip(finding.hypothesis.parameters, finding.estimate, finding.std, strict=True):
        assert abs(value - PLAYS[name.partition("@")[2].partition(".")[0]]) < 4 * std < 2e-6, name


@pytest.mark.slow
def test_an_effect_at_two_drives_of_four_is_named_one_by_one() -> None:
    planted = [Planted("backlash", q, {"b": PLAYS[q]}) for q in ("q2", "q3")]
    found = diagnosed(campaign("scissors", planted, 11), 11).findings
    assert {f.hypothesis.name for f in found} == {"backlash@q2", "backlash@q3"}


@pytest.mark.slow
def test_improve_writes_the_members_of_a_group_one_by_one(tmp_path: Path) -> None:
    """The improved machine is read again, and explains the table to its noise."""
    worn, table, better = tmp_path / "worn.yaml", tmp_path / "t.csv", tmp_path / "better.yaml"
    plays = ", ".join(f"backlash@{q}: {{b: {b} um}}" for q, b in (("q1", 12), ("q2", 25), ("q3", 18), ("q4", 9)))
    worn.write_text(f"extends: {MACHINES / 'scissors.yaml'}\neffects: {{{plays}}}\n")
    made = run("simulate", worn, MACHINES / "scissors-shopfloor.csv", "--noise", "declared", "--seed", "5", "-o", table)
    assert made.code == 0, made.err
    only = ("--only", "backlash@each,backlash@q2,windup@all")
    done = run("improve", MACHINES / "scissors.yaml", table, *only, "-o", better, "--json")
    assert [s["at"] for s in done.json["steps"]] == ["each"], done.err
    text = better.read_text(encoding="utf-8")
    assert all(f"  backlash@q{k}:" in text for k in (1, 2, 3, 4)) and "each" not in text
    again = run("calibrate", better, table, "--holdout", "none", "--json")
    assert again.code == 0 and again.json["chi2_per_dof"] < 1.5


def _play(at: str, members: tuple[str, ...] = ()) -> Hypothesis:
    names = tuple(f"backlash@{m}.b" for m in members or (at,))
    return Hypothesis(effect="backlash", at=at, parameters=names, members=tuple(_play(m) for m in members))


def test_the_same_effect_spread_otherwise_over_places_is_recognised() -> None:
    """What some rows call `all` or two of three drives, all rows may call `each`; one drive of three is not that."""
    every, upper = _play("each", ("q1", "q2", "q3")), _play("each:upper", ("q1", "q2"))
    one, two, common = _play("q1"), _play("q2"), _play("all")
    other = replace(one, effect="windup")
    assert every.spread([one, two]) and every.spread([common]) and every.spread([upper])
    assert not every.spread([one]) and not every.spread([other]) and not every.spread([])
    assert one.spread([every]) and one.spread([upper]) and common.spread([every])
    assert not _play("q3").spread([upper]) and not one.spread([two]) and not one.spread([common])


def test_the_runner_up_is_another_cause() -> None:
    """A group that holds the accepted drive is no other cause, nor is what has no evidence at all."""
    one, every = _play("q1"), _play("each", ("q1", "q2", "q3"))
    windup, pitch = replace(one, effect="windup"), replace(one, effect="pitch")
    without: Any = SimpleNamespace(hypotheses=(one, every, windup, pitch))
    rivals = (Rival(one, 1.0, 1.0),)
    best = CredibleSet(rivals, without, np.array([10.0, 8.0, 3.0, 1.0])).runner_up
    assert best is not None and (best.hypothesis, best.log_odds) == (windup, 7.0)
    assert CredibleSet(rivals, without, np.array([10.0, 8.0, -np.inf, -np.inf])).runner_up is None
    named = (*rivals, Rival(windup, 0.1, 0.9))
    best = CredibleSet(named, without, np.array([10.0, 8.0, 3.0, 1.0])).runner_up
    assert best is not None and best.hypothesis == pitch
