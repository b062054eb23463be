"""Shapes without a name as a machine file states them: by values and covariance at their knots."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pkmcal_cli.calibration.error_budget import ErrorBudget, error_budget
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.compiler.placed_effects import placed_shape
from pkmcal_cli.effects.unexplained import FreeShape, Unexplained, unexplained
from pkmcal_cli.model.effect_sites import PlacedEffect


@dataclass(frozen=True, kw_only=True)
class FitOfKnownShapes:
    """A fit whose shapes have the weights that a machine file gives them in which they are known."""

    problem: Problem
    fit: Fit
    budget: ErrorBudget


def fit_of_known_shapes(problem: Problem, fit: Fit, budget: ErrorBudget) -> FitOfKnownShapes:
    """The same fit with shapes that are known by it: their weights are others then, and so are those in its parameters.

    A shape is the same by either, but weights of one are no weights of the other. Raises RowsFailed.
    """
    placed = problem.model.effects
    known = {e.name: _known(e, fit, budget, problem) for e in placed if _is_identified(e, fit.selected)}
    if not known:
        return FitOfKnownShapes(problem=problem, fit=fit, budget=budget)
    values = fit.values.copy()
    for e in placed:
        if e.name in known:
            values[[problem.model.names.index(n) for n in e.parameters]] = known[e.name].weights
    model = problem.model.with_options(tuple(_with(e, known[e.name]) if e.name in known else e for e in placed))
    problem = replace(problem, model=model)
    fit = identify(problem, fit.selected, values, states=fit.after.start)
    budget = error_budget(problem, fit, budget.held, scales=budget.scales)
    return FitOfKnownShapes(problem=problem, fit=fit, budget=budget)


def _is_identified(placed: PlacedEffect, selected: Sequence[str]) -> bool:
    return isinstance(placed.effect, Unexplained) and set(placed.parameters) <= set(selected)


def _known(placed: PlacedEffect, fit: Fit, budget: ErrorBudget, problem: Problem) -> FreeShape:
    """The shape at its knots, as it came out of a fit."""
    assert isinstance(placed.effect, Unexplained)
    shape, columns = placed.effect.shape, [fit.selected.index(n) for n in placed.parameters]
    weights = fit.values[[problem.model.names.index(n) for n in placed.parameters]]
    covariance = budget.covariance[np.ix_(columns, columns)]
    return replace(shape, values=shape.factor @ weights, covariance=shape.factor @ covariance @ shape.factor.T)


def _with(placed: PlacedEffect, shape: FreeShape) -> PlacedEffect:
    assert isinstance(placed.effect, Unexplained)
    return placed_shape(unexplained(placed.effect.enters, shape, placed.effect.axis), placed.at, placed.sites)
