"""Successive rows that are alike: by noise with a memory, or by an effect where poses stand in the order of a grid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.diagnosis.groups import group_columns
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.linear import Linear, linear_problem
from pkmcal_cli.diagnosis.noise_tests import independent, noise_scale
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.workflow.search_case import CaseRequest, prepare
from tests.test_first_machines import BENCH, TRIPOD, simulated, tripod_poses


@cache
def tripod() -> tuple[Problem, Linear, tuple[Hypothesis, ...]]:
    """Poses on a grid, in its order; the problem at its calibration."""
    with TemporaryDirectory() as folder:
        machine = Path(folder) / "m.yaml"
        machine.write_text(TRIPOD + BENCH)
        table = simulated(Path(folder), machine, "t", "z,rx,ry", tripod_poses())
        case = prepare(CaseRequest(machine=str(machine), measurements=(str(table),)), Reporter(quiet=True))
    fit = identify(case.problem, case.selected)
    single = case.candidates.single
    others = [n for h in single for n in h.parameters]
    return case.problem, linear_problem(case.problem, fit.values, case.selected, others, None), single


def memory(residual: np.ndarray, hypotheses: Sequence[Hypothesis]) -> float:
    """Correlation of successive rows that is taken for one of the noise."""
    problem, linear, _ = tripod()
    found = independent(replace(linear, residual=residual), problem, hypotheses).memory
    return 0.0 if found is None else found.correlation


def white(seed: int) -> np.ndarray:
    linear = tripod()[1]
    return np.random.default_rng(seed).normal(size=len(linear.residual)) * linear.on.ravel()


@pytest.mark.parametrize("name", ["meas_scale@gauge", "pitch_curve@q2", "scale@q1", "straight@tower2.x"])
def test_what_an_effect_explains_is_no_memory(name: str) -> None:
    """Fifteen standard uncertainties of an effect: in the order of the grid, successive rows correlate by it."""
    _, linear, hypotheses = tripod()
    hypothesis = next(h for h in hypotheses if h.name == name)
    column = linear.tested(hypothesis) @ linear.score_of(hypothesis).basis[:, -1]
    there = 15 * column / np.sqrt(column @ linear.free(column)) + white(0)
    others = [h for h in hypotheses if h.effect != hypothesis.effect]
    assert memory(there, ()) > 0.2, "else the order of the rows proves nothing"
    assert memory(there, hypotheses) == 0.0
    assert memory(there, others) in (0.0, memory(there, ())), "another effect may explain it as well"


def test_what_a_smooth_field_explains_is_no_memory() -> None:
    """Of no effect of the catalogue: it is for the unknown to tell."""
    problem, linear, _ = tripod()
    shapes = linear.whitened(group_columns(problem)["pose"])
    for seed in range(6):
        rng = np.random.default_rng(seed)
        field = linear.free(shapes @ rng.normal(size=shapes.shape[1]))
        assert memory(30 * field / np.linalg.norm(field) + white(seed), ()) == 0.0


def test_noise_with_a_memory_is_taken_for_what_it_is() -> None:
    problem, linear, hypotheses = tripod()
    rows, shape = len(problem), problem.readings.shape
    drawn = np.random.default_rng(5).normal(size=shape)
    for k in range(1, rows):
        drawn[k] = 0.7 * drawn[k - 1] + np.sqrt(1 - 0.7**2) * drawn[k]
    assert memory(drawn.ravel() * linear.on.ravel(), hypotheses) == pytest.approx(0.7, abs=0.15)


def test_noise_is_at_least_rounding() -> None:
    """A table without noise leaves rounding, of which no effect is a cause."""
    problem, linear, _ = tripod()
    left = replace(linear, residual=1e-9 * white(3))
    assert noise_scale(left, problem, group_columns(problem)).variance == 1e-8
