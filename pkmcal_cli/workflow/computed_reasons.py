"""Readings that agree with the model far better than their noise allows: they were computed, not measured, or a sigma
is in the wrong unit."""

from __future__ import annotations

import numpy as np
from scipy.special import chdtr

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.complete_fit import Calibration
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import deletion_residuals
from pkmcal_cli.csv_files.origin import SIMULATED
from pkmcal_cli.tables.measurement_set import Measurements

_TIMES = 30.0  # no sigma is stated so many times too large
_CHANCE = 1e-6  # chance of residuals so small from noise of a third of what is stated
_THIRD = 9.0


def computed_reasons(problem: Problem, calibration: Calibration, measured: Measurements) -> tuple[str, ...]:
    """Channels with such readings, in words; none for tables that say that they are simulated, or failed fits."""
    fit = calibration.robust.fit
    if fit.status != "converged" or any(SIMULATED in note for note in measured.notes):
        return ()
    squares, freedom = _by_channel(problem, calibration)
    small = (freedom > 0) & (_TIMES**2 * squares < freedom) & (chdtr(freedom, _THIRD * squares) < _CHANCE)
    names = [c.name for c, each in zip(problem.model.channels, small, strict=True) if each]
    if not names:
        return ()
    factor = float(np.sqrt(freedom[small].sum() / max(squares[small].sum(), 1e-300)))
    size = f"{factor:.2g} times" if factor < 1e6 else "a million times"
    what = ", ".join(f"`{name}`" for name in names)
    why = "computed, not measured, or sigma in the wrong unit"
    return (f"residuals of {what} are {size} smaller than the stated noise: {why}",)


def _by_channel(problem: Problem, calibration: Calibration) -> tuple[Array, Array]:
    """Whitened squares and degrees of freedom (C,) of each channel: readings less what the fit takes of them."""
    fit = calibration.robust.fit
    off, slopes, _ = deletion_residuals(problem, fit.last)
    covariance = fit.directions.determined_covariance() / max(fit.directions.spread, 1e-300)
    on = problem.measured
    leverage = np.einsum("ncp,pq,ncq->nc", slopes, covariance, slopes)
    freedom = np.where(on, 1.0 - np.minimum(leverage, 1.0), 0.0).sum(axis=0)
    return np.asarray((np.where(on, off, 0.0) ** 2).sum(axis=0)), np.asarray(freedom)
