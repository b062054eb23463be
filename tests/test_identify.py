"""The fit: bounds, starts, order, units, what is weak, what is missing, and errors of the drives themselves.

"Same" between two ways of the same fit means 1e-6 standard uncertainties: a fit ends when its next step is below 1e-8
ranges or lowers chi-square by less than rounding, and takes that step.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import pkmcal_cli.calibration.step as stepping
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identify import RowsFailed, identify
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import evaluate, linearise
from pkmcal_cli.prediction import Request, Rows, predict
from tests.campaigns import Plan, by_engine, shipped
from tests.support import model, overlay

SAME = 1e-6


def noisy(name: str = "triglide-nonredundant", seed: int = 0) -> tuple[Plan, Problem, Array]:
    """A campaign of a shipped machine by the engine: plan, problem and true values (P,)."""
    plan, rng = by_engine(shipped(name)), np.random.default_rng(seed)
    values = plan.drawn(rng)
    return plan, plan.measured(values, rng), values


def assert_same(first: Fit, second: Fit, tolerance: float = SAME) -> None:
    assert first.status == second.status == "converged"
    std = np.zeros(len(first.values))
    std[: len(first.std)] = first.std
    assert (np.abs(first.values - second.values)[: len(first.std)] / first.std).max() < tolerance
    assert second.std == pytest.approx(first.std, rel=1e-6)
    assert second.chi2 == pytest.approx(first.chi2, rel=1e-9)


def test_at_the_solution_the_gradient_vanishes() -> None:
    """In determined directions, where the whitened Jacobian's columns are of the singular values' size."""
    for name in ("triglide", "scissors"):
        _, problem, _ = noisy(name)
        fit = identify(problem, shipped(name).selected)
        near = linearise(problem, evaluate(problem, fit.values, fit.selected))
        gradient = (near.jacobian * shipped(name).ranges).T @ near.residual
        moved = fit.directions.vectors[~fit.directions.held]
        steps = (moved @ gradient) / fit.directions.singular_values[~fit.directions.held] ** 2
        assert np.abs(steps).max() < 1e-6


# bounds ---------------------------------------------------------------------------------------------------------------


def bounded(problem: Problem, **bounds: tuple[float, float]) -> Problem:
    """The problem with parameters bounded to [low, high] about nominal, in ranges."""
    made = [
        replace(p, bounds=tuple(p.nominal + b * p.range for b in bounds[p.name])) if p.name in bounds else p
        for p in problem.model.parameters
    ]
    return replace(problem, model=replace(problem.model, parameters=tuple(made)))


def test_bounds_are_respected_and_reported() -> None:
    """On its bound the parameter is as if held there, and the others are fitted to it."""
    plan, problem, _ = noisy()
    way = float(((identify(problem, plan.selected).values - plan.model.nominal)[plan.index] / plan.ranges)[0])
    assert abs(way) > 0.02
    low, high = sorted((way / 2, -np.sign(way)))
    fit = identify(bounded(problem, l1=(low, high)), plan.selected)
    assert fit.status == "converged"
    assert fit.at_bound == ("l1",)
    start = plan.model.nominal
    start[0] += way / 2 * plan.ranges[0]
    assert fit.values[0] == pytest.approx(start[0], abs=1e-15)
    rest = identify(problem, plan.selected[1:], start)
    assert (np.abs(fit.values - rest.values)[plan.index[1:]] / rest.std).max() < SAME
    assert fit.chi2 == pytest.approx(rest.chi2, rel=1e-9)
    assert fit.dof == rest.dof


def test_bounds_that_do_not_bind_change_nothing() -> None:
    plan, problem, _ = noisy()
    fit = identify(bounded(problem, l1=(-3, 3), yb1r=(-4, 4)), plan.selected)
    assert fit.at_bound == ()
    assert_same(identify(problem, plan.selected), fit)


def test_all_parameters_within_bounds_all_the_way() -> None:
    """Bounds that the minimum lies beyond, for every parameter."""
    plan, problem, _ = noisy()
    free = (identify(problem, plan.selected).values - plan.model.nominal)[plan.index] / plan.ranges
    sides = {n: (-2.0, w / 2) if w > 0 else (w / 2, 2.0) for n, w in zip(plan.selected, free, strict=True)}
    fit = identify(bounded(problem, **sides), plan.selected)
    moved = (fit.values - plan.model.nominal)[plan.index] / plan.ranges
    assert fit.status == "converged"
    assert fit.at_bound
    for name, value in zip(plan.selected, moved, strict=True):
        assert sides[name][0] - 1e-12 <= value <= sides[name][1] + 1e-12


# verdicts -------------------------------------------------------------------------------------------------------------


def test_too_few_steps_are_not_convergence() -> None:
    _, problem, _ = noisy()
    assert identify(problem, shipped("triglide-nonredundant").selected, iterations=1).status == "not_converged"


def test_nothing_identifiable() -> None:
    """Stiffnesses of a machine without redundancy or load: no strain, no influence."""
    _, problem, _ = noisy()
    fit = identify(problem, ("k1", "k2"))
    assert fit.status == "nothing_identifiable"
    assert np.isnan(fit.std).all()
    assert (fit.values == problem.model.nominal).all()
    assert identify(problem, ()).status == "nothing_identifiable"
    blank = replace(problem, measured=np.zeros_like(problem.measured))
    assert identify(blank, ("l1",)).status == "nothing_identifiable"


def test_no_empty_system_is_solved(monkeypatch: pytest.MonkeyPatch) -> None:
    """LAPACK as scipy 1.11 calls it refuses one, and nothing identifiable would be an internal error."""
    solve = stepping.solve_triangular

    def strict(upper: np.ndarray, right: np.ndarray) -> np.ndarray:
        if not upper.size:
            raise ValueError("illegal value in 7th argument of internal trtrs")
        return np.asarray(solve(upper, right))

    monkeypatch.setattr(stepping, "solve_triangular", strict)
    _, problem, _ = noisy()
    assert identify(problem, ("k1", "k2")).status == "nothing_identifiable"


def test_a_row_that_cannot_be_predicted_has_no_part_in_the_fit() -> None:
    """It is named, and the fit is that of the others, to the last digit."""
    plan, problem, _ = noisy()
    positions = plan.positions.copy()
    positions[17, 0] -= 1.0
    fit = identify(plan.problem(problem.readings, positions), plan.selected)
    alone = identify(problem.without([17]), plan.selected)
    assert list(fit.failed) == [17] and "out of reach" in fit.failed[17]
    assert fit.status == "converged" and (fit.dof, fit.iterations) == (alone.dof, alone.iterations)
    assert fit.values == pytest.approx(alone.values, rel=1e-12) and fit.std == pytest.approx(alone.std, rel=1e-9)


def test_rows_of_which_half_cannot_be_predicted_are_no_table() -> None:
    plan, problem, _ = noisy()
    positions = plan.positions.copy()
    positions[::2, 0] -= 1.0
    with pytest.raises(RowsFailed) as caught:
        identify(plan.problem(problem.readings, positions), plan.selected)
    lost = np.nonzero(~caught.value.evaluation.prediction.solved)[0].tolist()
    assert lost == list(range(0, len(problem), 2))


def test_weak_directions_are_not_moved() -> None:
    """The weakest of the redundant Triglide would wander by 30 ranges; held, it stays near nominal.

    To first order: directions turn a little while the fit moves by about a range.
    """
    plan, problem, _ = noisy("triglide")
    fit = identify(problem, plan.selected)
    assert fit.directions.weak.sum() == 3
    moved = (fit.values - plan.model.nominal)[plan.index] / plan.ranges
    assert np.abs(fit.directions.vectors[fit.directions.weak] @ moved).max() < 0.01
    assert np.abs(fit.directions.vectors[~fit.directions.weak] @ moved).max() > 0.3


# what must not matter -------------------------------------------------------------------------------------------------


def test_order_of_rows_does_not_matter() -> None:
    for name in ("triglide", "scissors"):
        plan, problem, _ = noisy(name)
        order = np.random.default_rng(1).permutation(len(problem))
        assert_same(identify(problem, plan.selected), identify(problem.take(order), plan.selected))


def test_order_of_parameters_does_not_matter() -> None:
    plan, problem, _ = noisy()
    backwards = identify(problem, plan.selected[::-1])
    found = backwards.directions
    turned = replace(found, names=found.names[::-1], vectors=found.vectors[:, ::-1], ranges=found.ranges[::-1])
    backwards = replace(backwards, directions=turned)
    assert_same(identify(problem, plan.selected), backwards)


def test_start_does_not_matter() -> None:
    """From 20 ranges off, some 2 mm on legs of 300 mm."""
    plan, problem, _ = noisy()
    start = plan.model.nominal
    start[plan.index] += np.random.default_rng(3).choice([-20, 20], 6) * plan.ranges
    assert_same(identify(problem, plan.selected), identify(problem, plan.selected, start))


def test_a_row_measured_twice_is_a_row_of_smaller_sigma() -> None:
    plan, problem, _ = noisy()
    twice = problem.take(np.r_[np.arange(len(problem)), 5, 6])
    sigma = np.array(problem.sigma)
    sigma[[5, 6]] /= np.sqrt(2)
    once = replace(problem, sigma=sigma)
    first, second = identify(twice, plan.selected), identify(once, plan.selected)
    assert (np.abs(first.values - second.values)[plan.index] / first.std).max() < SAME
    assert second.std == pytest.approx(first.std, rel=1e-6)


def test_a_missing_cell_is_a_cell_without_weight() -> None:
    """A sigma 1e6 times the others' leaves 1e-12 of the weight."""
    plan, problem, _ = noisy()
    cells = np.random.default_rng(2).random(problem.readings.shape) < 0.3
    missing = plan.problem(np.where(cells, np.nan, problem.readings))
    assert missing.count == (~cells).sum()
    dim = replace(problem, sigma=np.where(cells, 1e6, 1.0) * problem.sigma)
    first, second = identify(missing, plan.selected), identify(dim, plan.selected)
    assert (np.abs(first.values - second.values)[plan.index] / first.std).max() < 1e-5
    assert first.dof == second.dof - cells.sum()
    assert plan.problem(problem.readings, sigma=np.array([1e-5, np.nan])).count == 231


# errors of the drives -------------------------------------------------------------------------------------------------


def self_measured(sigma: str) -> tuple[list[Problem], tuple[str, ...]]:
    """The Triglide with one drive without force, by any two drives as inputs: readings of all, with errors."""
    rng, names = np.random.default_rng(7), ("l1", "l2", "yb1r", "yb2r", "l3")
    machines = []
    for slack in ("q3", "q1"):
        others = [q for q in ("q1", "q2", "q3") if q != slack]
        drives = "".join(f"\n  {q}: {{redundant: false, sigma: {sigma}}}" for q in others)
        drives += f"\n  {slack}: {{redundant: true, control: force, force: 0, sigma: 5 um}}"
        machines.append(model(overlay("triglide", f"actuators:{drives}")))
    first = machines[0]
    values = first.nominal
    index = [first.names.index(n) for n in names]
    values[index] += rng.normal(size=5) * first.ranges[index] / 2
    true = shipped("triglide").positions[77:154]
    found = predict(first, values, Rows.at(true), Request())
    q = true + rng.normal(size=true.shape) * 5e-6
    q[:, 2] = found.values[:, 2] + rng.normal(size=len(q)) * 5e-6
    tcp = found.values[:, :2] + rng.normal(size=(len(q), 2)) * 1e-6
    problems = []
    for machine, slack in zip(machines, (2, 0), strict=True):
        readings = np.column_stack([tcp, q[:, slack]])
        spread = np.broadcast_to([c.sigma for c in machine.channels], readings.shape)
        spread = np.where([False, False, True], 5e-6, 1e-6 + 0 * spread)
        drives = np.broadcast_to(np.nan_to_num([a.sigma for a in machine.actuators]), q.shape)
        problems.append(
            Problem(
                model=machine,
                rows=Rows.at(q),
                readings=readings,
                sigma=spread,
                drive_sigma=drives,
                measured=~np.isnan(readings),
            )
        )
    return problems, names


def test_with_errors_of_the_drives_the_choice_of_inputs_does_not_matter() -> None:
    """Errors of 5 um on legs of 300 mm: a second order of 1e-5. Without their sigma the results differ grossly."""
    problems, names = self_measured("5 um")
    first, second = (identify(p, names) for p in problems)
    assert_same(first, second, 1e-3)
    assert first.chi2_per_dof == pytest.approx(1, abs=4 * np.sqrt(2 / first.dof))
    blind, names = self_measured("0.001 um")
    worse = [identify(p, names) for p in blind]
    assert worse[0].chi2_per_dof > 5
    assert (np.abs(worse[0].values - worse[1].values)[:5] / first.std[[0, 1, 2, 3, 4]]).max() > 0.5
