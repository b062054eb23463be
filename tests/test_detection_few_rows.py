"""Sizes that are detected in 80 % with few rows, against campaigns of which every value is drawn and scored.

Few rows leave much of an effect in what counts as noise, may stand on one row, and do not tell alike effects apart.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.measured_problem import problem_of
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.selection import select
from pkmcal_cli.compiler import compile_machine
from pkmcal_cli.diagnosis.confirm import blocks
from pkmcal_cli.diagnosis.detection import Detection
from pkmcal_cli.diagnosis.experiment_design import expected_procedure
from pkmcal_cli.diagnosis.hypotheses import RELEASE, Candidates, Hypothesis, candidates
from pkmcal_cli.diagnosis.known_results import KnownResults
from pkmcal_cli.diagnosis.linear import Linear, linear_problem
from pkmcal_cli.diagnosis.scale import Scale
from pkmcal_cli.diagnosis.scoring import Scored, Search, score_all, scored
from pkmcal_cli.diagnosis.search import stands_on_one_row
from pkmcal_cli.diagnosis.trial import Procedure
from pkmcal_cli.language.machine_yaml import read_machine
from pkmcal_cli.tables.measurements import read_measurements
from tests.command import MACHINES
from tests.test_detection import helped
from tests.test_diagnosis_linear import setting, synthetic

DRAWS = 200


@dataclass(frozen=True)
class Few:
    """Some poses of a shipped table, as a plan sees them."""

    problem: Problem
    linear: Linear
    hypotheses: tuple[Hypothesis, ...]
    single: tuple[Hypothesis, ...]
    procedure: Procedure

    def size(self, name: str) -> tuple[int, Array, float]:
        """Number, unit vector of the leading number (p,), and the size that is promised."""
        k = [h.name for h in self.single].index(name)
        detection = Detection(self.linear, self.problem, self.single, 0, self.hypotheses)
        direction = np.eye(len(self.single[k].parameters))[detection.scores[k].leading]
        return k, direction, detection.size(k, direction, self.procedure)


@cache
def few(machine: str, rows: int) -> Few:
    """Poses spread over the table."""
    described = read_machine(MACHINES / f"{machine}.yaml")
    table = read_measurements([MACHINES / f"{machine}.csv"], described)
    model = compile_machine(described, True).model
    selected = select(model, "auto")
    found = candidates(model, selected, table)
    problem = problem_of(found.model, table)
    problem = problem.take(np.linspace(0, len(problem) - 1, rows).astype(int))
    others = [n for h in found.hypotheses for n in h.parameters if n not in selected]
    linear = linear_problem(problem, found.model.nominal, selected, list(dict.fromkeys(others)), None)
    procedure = expected_procedure(linear, problem, found.hypotheses, 0.005, 0)
    return Few(problem, linear, found.hypotheses, found.single, procedure)


def named(few: Few, drawn: Scored, name: str) -> bool:
    """Whether an effect is among those with 95 % of the evidence, one of them is significant, and nothing speaks
    against it: as docs/decisions.md says."""
    evidence = drawn.log_bayes + [h.preference for h in drawn.hypotheses]
    weight = np.exp(evidence - evidence.max())
    order = np.argsort(-weight, kind="stable")
    last = int(np.searchsorted(np.cumsum(weight[order]) / weight.sum(), 0.95)) + 1
    near = order[:last].tolist()
    k = [h.name for h in drawn.hypotheses].index(name)
    if k not in near or not (drawn.p_values[near] < few.procedure.critical).any() or stands_on_one_row(drawn, k):
        return False
    labels = np.repeat(blocks(few.problem, drawn.hypotheses[k])[0], few.linear.channels)
    columns = few.linear.tested(drawn.hypotheses[k]) @ drawn.scores[k].basis
    return helped(few.linear, columns, labels, drawn.linear.residual)


def share(few: Few, name: str) -> float:
    """Of campaigns with the promised size."""
    k, direction, size = few.size(name)
    effect, rng = few.linear.tested(few.single[k]) @ direction * size, np.random.default_rng(3)
    told = 0
    for _ in range(DRAWS):
        residual = few.linear.on.ravel() * (effect + rng.normal(size=len(effect)))
        told += named(few, scored(replace(few.linear, residual=residual), few.problem, few.hypotheses), name)
    return told / DRAWS


@pytest.mark.parametrize(
    ("machine", "rows", "name"),
    [
        pytest.param("triglide-nonredundant", 30, "straight@rail.y", marks=pytest.mark.slow),
        pytest.param("triglide-nonredundant", 30, "guide_angle@rail.y", marks=pytest.mark.slow),
        ("scissors", 20, "straight@left.x"),
    ],
)
def test_the_promised_size_is_detected_in_80_percent_of_campaigns(machine: str, rows: int, name: str) -> None:
    """Within three standard deviations of both counts, 10 %."""
    assert share(few(machine, rows), name) == pytest.approx(0.8, abs=0.1)


def test_an_effect_that_another_name_says_with_fewer_numbers_is_never_detected() -> None:
    """Of three numbers the first moves the readings as a parameter does that is held: that is named, not the effect."""
    problem, count = setting().ready.problem, len(setting().linear.residual)
    columns = 20 * np.random.default_rng(4).normal(size=(count, 6))
    linear = replace(synthetic(columns, 3, np.zeros(count)), channels=setting().linear.channels)
    effect = Hypothesis(effect="tool", at="tracker", parameters=("p3", "p4", "p5"))
    parameter = Hypothesis(effect=RELEASE, at="p3", parameters=("p3",))
    procedure, first = Procedure(1e-4, Scale()), np.array([1.0, 0.0, 0.0])
    by_itself = Detection(linear, problem, [effect], 0).size(0, first, procedure)
    beside = Detection(linear, problem, [effect, parameter], 0)
    assert np.isfinite(by_itself) and beside.size(0, first, procedure) == np.inf
    assert beside.size(1, np.ones(1), procedure) < by_itself


def test_scores_of_a_whole_effect_do_not_stand_for_its_best_part() -> None:
    """Whatever was scored before at the same solution."""
    case = few("triglide-nonredundant", 30)
    effect = next(h for h in case.hypotheses if h.name == "pitch_curve@q1")
    search = Search(
        candidates=Candidates(case.problem.model, case.hypotheses, ()),
        problem=case.problem,
        declared=case.linear.projected,
        fit=identify(case.problem, case.linear.projected),
    )
    whole, best = score_all(search, [effect.whole]), score_all(search, [effect])
    assert len(whole.hypotheses[0].parameters) == 5
    assert best.hypotheses == score_all(replace(search, known=KnownResults()), [effect]).hypotheses
    assert len(best.hypotheses[0].parameters) < 5
