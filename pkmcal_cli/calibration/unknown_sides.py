"""Rows of a table in which the side of a drive is unknown count by it: reversal is part of their uncertainty."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.lean import lean
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.condensed import LONG
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.mechanism.topology import Index
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction.unknown_sides import side_sigma


def with_unknown_sides(problem: Problem, selected: Collection[str] = (), values: Array | None = None) -> Problem:
    """The problem with the uncertainty of drives in rows without a side, and no other that it had before.

    Reversal errors have their values (P,), or, where these are not known yet, the size that their ranges allow;
    `selected`: parameters that are identified; others count where the machine file gives them a size. Of a long table,
    whose drives have no errors, such rows are left out.
    """
    sizes = _sizes(problem.model, selected, values)
    sigma = side_sigma(problem.model, problem.rows, sizes)
    if sigma is None:
        return problem if problem.side_sigma is None else replace(problem, side_sigma=None)
    if len(problem) > LONG:
        return problem.without(np.nonzero(sigma.any(axis=1) & problem.measured.any(axis=1))[0])
    same = problem.side_sigma is not None and np.array_equal(sigma, problem.side_sigma)
    return problem if same else replace(problem, side_sigma=lean(sigma))


def unsided_rows(problem: Problem) -> tuple[Index, tuple[str, ...]]:
    """Rows that count less, or not, because the side of a drive is unknown, and these drives."""
    if problem.side_sigma is None:
        return np.zeros(0, dtype=np.intp), ()
    rows = np.nonzero((problem.side_sigma > 0).any(axis=1) & problem.measured.any(axis=1))[0]
    drives: NDArray[np.bool_] = np.any(problem.side_sigma[rows] > 0, axis=0)
    return rows, tuple(a.name for a, on in zip(problem.model.actuators, drives, strict=True) if on)


def sided(problem: Problem) -> Problem:
    """The problem without what rows of unknown side say, unless that is most of it: there nobody knows the error."""
    rows, _ = unsided_rows(problem)
    few = 0 < 2 * len(rows) <= int(problem.measured.any(axis=1).sum())
    return problem.without(rows) if few else problem


def _sizes(model: Model, selected: Collection[str], values: Array | None) -> dict[str, float]:
    """Sizes of reversal errors by parameter, SI; of those that are selected the range, 0 of mere candidates."""
    if values is not None:
        return {name: abs(float(value)) for name, value in zip(model.names, values, strict=True)}
    return {p.name: max(abs(p.nominal), p.range if p.name in selected else 0.0) for p in model.parameters}
