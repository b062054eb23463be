"""Whether a fit leaves more than noise: chi-square, tested with a stated sigma that is itself only known so well."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc, fdtrc

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.error_budget import ErrorBudget
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.robust import RobustFit

_BEYOND_NOISE = 0.01  # chance of residuals so large where sigma is what is stated
_BEYOND_DOUBT = 0.05  # and where it is as wrong as a stated sigma may be
_MEDIAN = 0.37  # efficiency of the scale of a robust fit, a median absolute deviation, with normal noise


@dataclass(frozen=True)
class Unexplained:
    """An instrument whose residuals are larger than its noise can be: rms of them, in stated sigmas."""

    instrument: str
    factor: float

    @property
    def text(self) -> str:
        """In words."""
        return f"the residuals of {self.instrument} are {self.factor:.3g} times the stated noise"


def unexplained(fit: Fit, budget: ErrorBudget, robust: RobustFit | None = None) -> tuple[Unexplained, ...]:
    """Instruments that show that an effect is missing, or that a sigma is stated far too small; () if the fit failed.

    The ratio of the residuals' mean square to the stated variance, F-distributed with the degrees of freedom that are
    left and those that the statement is worth (`instruments.WORTH`); each of G instruments at 1/G of the level.
    robust: how the fit came about, where rows that a loss does without are not to count. What was measured on the bench
    is another test's (`bench_readings`): the fit follows a single reading, so its residual tells little.
    """
    count = float(budget.counts.sum())
    if fit.status != "converged" or fit.dof <= 0 or not count:
        return ()
    freedom = np.maximum(budget.counts * (fit.dof / count), 1e-9)
    whole, left = budget.share.squares, budget.share.left
    ratio = whole / freedom
    if robust is not None and robust.loss != "squares":
        ratio, freedom = _robust_ratio(robust, budget), _MEDIAN * freedom
    ratio = ratio * np.divide(left, whole, out=np.ones(len(whole)), where=whole > 0)
    level = np.array([_BEYOND_NOISE, _BEYOND_DOUBT]) / len(budget.instruments)
    worth = np.minimum(budget.worth, 1e9)
    beyond = (chdtrc(freedom, ratio * freedom) < level[0]) & (fdtrc(freedom, worth, ratio) < level[1])
    beyond &= (budget.counts > 0) & ~budget.once
    return tuple(Unexplained(budget.instruments[g], float(np.sqrt(ratio[g]))) for g in np.nonzero(beyond)[0])


def _robust_ratio(robust: RobustFit, budget: ErrorBudget) -> Array:
    """Scatter (G,) of the rows that a robust loss goes by, over the stated variance."""
    channels, counts = robust.problem.model.channels, robust.problem.measured.sum(axis=0)
    out = np.ones(len(budget.instruments))
    for g, name in enumerate(budget.instruments):
        members = [k for k, c in enumerate(channels) if c.instrument == name and counts[k]]
        out[g] = np.average(robust.scale[members] ** 2, weights=counts[members]) if members else 1.0
    return out
