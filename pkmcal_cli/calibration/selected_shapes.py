"""Shapes without a name whose weights are identified: with their prior, whatever was known of them before."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pkmcal_cli.calibration.prior import Prior
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.effects.unexplained import UNEXPLAINED

_UNIT = 2.0  # range of a weight of unit variance


def with_free_shapes(problem: Problem, selected: tuple[str, ...]) -> tuple[Problem, tuple[str, ...]]:
    """The problem with the prior of selected weights, and these."""
    model = problem.model
    weights = tuple(p.name for p in model.parameters if p.kind == UNEXPLAINED and p.name in selected)
    if not weights:
        return problem, ()
    ranges = model.ranges.copy()
    ranges[[model.names.index(n) for n in weights]] = _UNIT
    prior = Prior(weights, np.eye(len(weights)), np.zeros(len(weights)))
    return replace(problem, model=model.with_ranges(ranges), prior=prior), weights
