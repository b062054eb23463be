"""Readings that agree with the model far better than their noise allows: they were computed, not measured, or a sigma
is in the wrong unit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtr

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.condensed import in_parts
from pkmcal_cli.calibration.deletion import deletion_residuals
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import Evaluation, evaluate, whitened_residual
from pkmcal_cli.csv_files.origin import SIMULATED
from pkmcal_cli.tables.measurement_set import Measurements

_TIMES = 30.0  # no sigma is stated so many times too large
_NEAR, _EXACT = 10.0, 1e4  # the same before a fit; beyond it a channel is simulated that no parameter moves
_CHANCE = 1e-6  # chance of residuals so small from noise of a third of what is stated
_THIRD = 9.0


@dataclass(frozen=True)
class Computed:
    """Such channels, in words: of readings that the nominal machine explains by itself, and of others."""

    commanded: tuple[str, ...]
    exact: tuple[str, ...]


def computed_readings(problem: Problem, fit: Fit, measured: Measurements) -> Computed:
    """Channels with such readings; none in tables that say that they are simulated, or of failed fits.

    What the nominal machine leaves nothing of are set values, or in a wrong unit: no machine is as exact
    as its drawing. What only a fit leaves nothing of may be a simulation by another program.
    """
    if fit.status != "converged" or any(SIMULATED in note for note in measured.notes):
        return Computed((), ())
    squares, freedom = _by_channel(problem, fit)
    small = (freedom > 0) & (_TIMES**2 * squares < freedom) & (chdtr(freedom, _THIRD * squares) < _CHANCE)
    if not small.any():
        return Computed((), ())
    nominal = whitened_residual(problem, evaluate(problem, problem.model.nominal, ()))
    before = np.nansum(np.where(problem.measured, nominal, 0.0) ** 2, axis=0)
    count = (problem.measured & np.isfinite(nominal)).sum(axis=0)
    highest, lowest = (np.where(problem.measured, problem.readings, s * np.inf) for s in (-1, 1))
    varies = highest.max(axis=0) > lowest.min(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        times = np.where(count > 0, np.sqrt(count / before), 0.0)
    every = bool((times[varies & (count > 0)] > _NEAR).all())
    commanded = small & varies & (times > _NEAR) & (every | (times < _EXACT))
    model = (" from the nominal machine", "set values instead of measurements, or a wrong unit")
    fitted = ("", "computed, not measured, or sigma in the wrong unit")
    return Computed(
        _words(problem, commanded, before, count, *model),
        _words(problem, small & ~commanded, squares, freedom, *fitted),
    )


def _words(
    problem: Problem, affected: NDArray[np.bool_], squares: Array, count: Array, origin: str, why: str
) -> tuple[str, ...]:
    """Own channels (C,), how small their squares (C,) are for their count (C,), and what that means; () for none."""
    names = [c.name for c, each in zip(problem.model.channels, affected, strict=True) if each]
    if not names:
        return ()
    factor = float(np.sqrt(count[affected].sum() / max(squares[affected].sum(), 1e-300)))
    size = f"{factor:.2g} times" if factor < 1e6 else "a million times"
    listed = ", ".join(f"`{name}`" for name in names)
    return (f"deviations of {listed}{origin} are {size} smaller than the stated noise: {why}",)


def _by_channel(problem: Problem, fit: Fit) -> tuple[Array, Array]:
    """Whitened squares and degrees of freedom (C,) of each channel: readings less what the fit takes of them."""
    covariance = fit.directions.determined_covariance() / max(fit.directions.spread, 1e-300)
    squares, freedom = np.zeros((2, problem.readings.shape[1]))

    def visit(rows: slice, part: Problem, evaluation: Evaluation) -> None:
        off, slopes, _ = deletion_residuals(part, evaluation)
        leverage = np.einsum("ncp,pq,ncq->nc", slopes, covariance, slopes)
        squares[:] += (np.where(part.measured, off, 0.0) ** 2).sum(axis=0)
        freedom[:] += np.where(part.measured, 1.0 - np.minimum(leverage, 1.0), 0.0).sum(axis=0)

    in_parts(problem, fit.last, visit)
    return squares, freedom
