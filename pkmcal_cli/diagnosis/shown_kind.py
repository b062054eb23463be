"""Of which readings errors are told as one figure: of the kind that carries what noise does not explain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.errors_before_after import kinds_of
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.unknown_sides import sided

_CHANCE = 1e-3  # of squares as large by noise alone: kinds whose squares are no larger carry nothing


@dataclass(frozen=True)
class ShownKind:
    """A kind of readings as in error figures, and its channels; alone: whether the table has no other kind."""

    name: str
    channels: tuple[int, ...]
    alone: bool


def reported_kind(shown: ShownKind, rows: Sequence[Problem]) -> ShownKind:
    """The same where some of these rows measure it; else positions, or the first kind that they do measure."""
    measured = np.any([p.measured.any(axis=0) for p in rows], axis=0)  # (C,)
    if measured[list(shown.channels)].any():
        return shown
    kinds = kinds_of(rows[0].model).items()
    name, some = next((name, some) for name, some in kinds if measured[some].any())
    return ShownKind(name, tuple(some), alone=False)


def shown_kind(problem: Problem, fit: Fit) -> ShownKind:
    """The kind whose residuals are largest for their noise after a fit; positions, or the first, where all are noise.

    What was measured once is shown only where nothing else is.
    """
    measured = sided(problem).measured & np.isfinite(fit.after.residual)
    squares = np.where(measured, (fit.after.residual / np.where(measured, problem.sigma, 1.0)) ** 2, 0.0)
    kinds = {name: [k for k in some if problem.measured[:, k].any()] for name, some in kinds_of(problem.model).items()}
    kinds = {name: some for name, some in kinds.items() if some}
    every = {name: some for name, some in kinds.items() if not set(some) <= set(problem.once)} or kinds
    excess = {name: _excess(squares[:, some], int(measured[:, some].sum())) for name, some in every.items()}
    name = max(every, key=lambda n: excess[n])  # of equals the first
    return ShownKind(name, tuple(every[name]), len(every) == 1)


def _excess(squares: Array, count: int) -> float:
    """Mean square of readings in their noise, 0 where chance may make it as large."""
    total = float(squares.sum())
    return total / count if count and chdtrc(count, total) < _CHANCE else 0.0
