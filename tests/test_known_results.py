"""A search computes nothing twice, and never takes the result of another problem, solution or set of effects."""

from __future__ import annotations

import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import Evaluation
from pkmcal_cli.diagnosis import known_results, linear, scoring
from pkmcal_cli.diagnosis.confirm import held_out_gain
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.known_results import KnownResults
from pkmcal_cli.diagnosis.linear import Linear
from pkmcal_cli.diagnosis.model_discrepancy import discrepancy_columns, own_discrepancies
from pkmcal_cli.diagnosis.scoring import Scored, Search, score_all, score_without
from tests.benchmark.setting import ready
from tests.truth.campaigns import campaign, unit


@pytest.fixture(scope="module")
def search() -> Search:
    """A backlash of the Scissors in the fit."""
    case = ready(campaign("scissors", [unit("scissors", "backlash", "q3", 4)], 4, rows=40))
    (accepted,) = (h for h in case.candidates.hypotheses if h.name == "backlash@q3")
    selected = (*case.selected, *accepted.parameters)
    fit = identify(case.problem, selected)
    return Search(
        candidates=case.candidates, problem=case.problem, declared=case.selected, fit=fit, accepted=(accepted,)
    )


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> list[Problem]:
    """The problems that are linearised from now on."""
    problems: list[Problem] = []
    plain = scoring.linear_problem

    def counting(problem: Problem, *more: object, compare: bool) -> Linear:
        problems.append(problem)
        return plain(problem, *more, compare=compare)  # type: ignore[arg-type]

    monkeypatch.setattr(scoring, "linear_problem", counting)
    return problems


def fresh(search: Search) -> Search:
    return replace(search, known=KnownResults())


def same(one: Scored, other: Scored) -> None:
    """Scores as they are without anything known; columns are the same numbers, so only sums round."""
    assert [h.name for h in one.hypotheses] == [h.name for h in other.hypotheses]
    np.testing.assert_allclose(one.p_values, other.p_values, rtol=1e-9, atol=1e-300)
    np.testing.assert_allclose(one.linear.chi2, other.linear.chi2, rtol=1e-12)


def test_a_solution_is_linearised_once_for_all_that_is_asked_of_it(search: Search, counted: list[Problem]) -> None:
    search = fresh(search)
    every = score_all(search, search.open)
    assert score_all(search, search.open) is every and len(counted) == 1
    few = score_all(search, search.open[:3])
    assert len(counted) == 1, "the columns of three are among those of all"
    same(few, score_all(fresh(search), search.open[:3]))
    without = score_without(search, search.accepted, search.accepted)
    assert len(counted) == 3, "where an effect is null is another solution"
    same(without, score_without(fresh(search), search.accepted, search.accepted))


def test_rows_that_a_fit_has_compared_are_not_beside_it(search: Search, monkeypatch: pytest.MonkeyPatch) -> None:
    """With other assemblies, which is dear on a strained machine; scores are the same."""
    asked, plain = list[bool](), linear.evaluate

    def recorded(*asked_of: Any, compare: bool) -> Evaluation:
        asked.append(compare)
        return plain(*asked_of, compare=compare)

    monkeypatch.setattr(linear, "evaluate", recorded)
    scores = score_without(fresh(search), search.accepted, search.accepted)
    assert asked == [False]
    monkeypatch.setattr(linear, "evaluate", lambda *asked_of, compare: plain(*asked_of))
    same(scores, score_without(fresh(search), search.accepted, search.accepted))


def test_nothing_is_known_of_other_rows_values_or_effects(search: Search, counted: list[Problem]) -> None:
    search = fresh(search)
    first = score_all(search, search.open)
    fewer = replace(search, problem=search.problem.without([0, 1]))
    moved = replace(search, fit=replace(search.fit, values=search.fit.values + 1e-6))
    other = replace(search, accepted=())  # the same solution, at which more is open and less projected out
    for changed, solutions in ((fewer, 1), (moved, 1), (other, 0)):
        before = len(counted)
        scores = score_all(changed, changed.open)
        assert scores is not first and len(counted) == before + solutions
        same(scores, score_all(fresh(changed), changed.open))


def test_more_columns_are_computed_and_what_is_projected_out_counts(search: Search, counted: list[Problem]) -> None:
    search = fresh(search)
    score_all(search, search.open[:3])
    more = score_all(search, search.open[:6])
    assert len(counted) == 2
    same(more, score_all(fresh(search), search.open[:6]))
    (effect,) = search.accepted
    fitted, free = score_all(search, ()), score_all(replace(search, accepted=()), [effect])
    assert fitted.linear.names == free.linear.names and free.linear.projected == search.declared
    assert fitted.linear.projected == (*search.declared, *effect.parameters)


def test_held_out_gains_belong_to_one_fit(search: Search) -> None:
    search = fresh(search)
    (effect,) = search.accepted
    gain = held_out_gain(search, effect)
    assert held_out_gain(search, effect) is gain
    fewer = replace(search, problem=search.problem.without(list(range(10))))
    assert held_out_gain(fewer, effect) == held_out_gain(fresh(fewer), effect) != gain


def test_shapes_of_an_effect_are_those_of_it_alone_whoever_was_asked_for_before(search: Search) -> None:
    """Of effects at one place and at all, of their own shapes and of all shapes."""
    known, fit, problem = KnownResults(), search.fit, search.problem
    every = [h for h in search.candidates.hypotheses if h.effect in ("backlash", "pitch_curve", "scale")]
    for some in (every[:2], every, every[::-1]):
        both = own_discrepancies(problem, fit, some, known), discrepancy_columns(problem, fit, some, known)
        alone = [own_discrepancies(problem, fit, [h], KnownResults()).get(h.name) for h in some]
        assert both[0].keys() == {h.name for h, columns in zip(some, alone, strict=True) if columns is not None}
        for h, columns in zip(some, alone, strict=True):
            assert columns is None or np.array_equal(both[0][h.name], columns)
        assert np.array_equal(both[1], discrepancy_columns(problem, fit, some, KnownResults()))
    assert len(both[0]) > 2


def test_the_oldest_goes_where_columns_take_too_much(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(known_results, "_BYTES", 100)
    known, of = KnownResults(), object()
    made: list[str] = []

    def result(name: str, nbytes: int) -> str:
        return known.once((of,), (name,), lambda: made.append(name) or name, nbytes)  # type: ignore[func-returns-value]

    for name in ("a", "b", "a"):
        assert result(name, 40) == name
    assert made == ["a", "b"]
    result("c", 40)
    result("b", 40)
    assert made == ["a", "b", "c"], "a went, b stayed"
    result("a", 1000)
    assert made == ["a", "b", "c", "a"] and result("a", 1000) == "a", "the last one stays, however large it is"


def test_another_process_begins_without_them(search: Search) -> None:
    known = KnownResults()
    known.once((search,), ("x",), lambda: Hypothesis(effect="scale", at="q1", parameters=("a",)))
    assert pickle.loads(pickle.dumps(known)) == KnownResults()
