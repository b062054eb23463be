"""What was measured once, on the bench, against what the rows of the table tell without it.

Such a reading is no row: it is compared with a fit that has used none of its kind, and an uncertainty that is made of
its sigma and of what the rows leave open. Directions that they hardly see are as uncertain as the data have them: what
is known there by ranges alone contradicts no reading. What is not identified is known to some ranges.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc, fdtrc

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.error_budget import held_parameters
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identifiability import UNSEEN
from pkmcal_cli.calibration.instruments import WORTH
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import evaluate

_WIDER = 3.0  # times the range of the machine file: no kind of parameters is wider effectively
_BEYOND_NOISE, _BEYOND_DOUBT = 0.01, 0.05  # as of the residuals of any instrument, see `unexplained`
_MOST_WORTH = 1e9


@dataclass(frozen=True, kw_only=True)
class BenchReading:
    """A reading, what the rows predict of it and its standard uncertainty, SI; sigma of the reading and what it is
    worth, in degrees of freedom. channel: its number.
    """

    channel: int
    reading: float
    predicted: float
    predicted_std: float
    sigma: float
    worth: float

    @property
    def off(self) -> float:
        """By how much the reading differs from what the rows predict."""
        return self.reading - self.predicted

    @property
    def deviation(self) -> float:
        """The same in standard uncertainties of the difference."""
        return self.off / float(np.hypot(self.sigma, self.predicted_std))

    @property
    def p_value(self) -> float:
        """Chance of so large a difference where sigma is what is stated."""
        return float(chdtrc(1.0, self.deviation**2))

    def contradicts(self, readings: int) -> bool:
        """Whether noise explains it hardly, be sigma as wrong as a stated one may be; one of so many readings."""
        doubtful = float(fdtrc(1.0, min(self.worth, _MOST_WORTH), self.deviation**2))
        return self.p_value < _BEYOND_NOISE / readings and doubtful < _BEYOND_DOUBT / readings


def bench_readings(problem: Problem, fit: Fit) -> tuple[BenchReading, ...]:
    """All that was measured on the bench and is used in a problem; fit: of its rows without any of it."""
    rows = np.nonzero(problem.measured.any(axis=1) & np.isfinite(fit.after.residual).all(axis=1))[0]
    if not problem.once or not len(rows) or not fit.usable:
        return ()
    one = problem.take(rows[:1])
    held = held_parameters(problem, fit.selected, ())
    there = evaluate(one, fit.values, (*fit.selected, *held), fit.after.start.take(rows[:1]))
    assert there.prediction.jacobian is not None
    covariance = _covariance(problem, fit, held)
    readings = []
    for k in one.once:
        slopes, predicted = there.prediction.jacobian[0, k], float(there.prediction.values[0, k])
        readings.append(
            BenchReading(
                channel=k,
                reading=predicted + float(there.residual[0, k]),
                predicted=predicted,
                predicted_std=float(np.sqrt(slopes @ covariance @ slopes)),
                sigma=float(one.sigma[0, k]),
                worth=WORTH[problem.model.channels[k].sigma_is],
            )
        )
    return tuple(readings)


def _covariance(problem: Problem, fit: Fit, held: tuple[str, ...]) -> Array:
    """Covariance (p + h, p + h) of what the rows tell of identified parameters, and of h others, SI."""
    seen, names = fit.directions, problem.model.names
    p, variance = len(fit.selected), fit.excess / np.maximum(seen.singular_values, UNSEEN) ** 2
    out = np.zeros((p + len(held), p + len(held)))
    out[:p, :p] = (seen.vectors.T * variance @ seen.vectors) * np.outer(seen.ranges, seen.ranges)
    half = 0.5 * problem.model.ranges[[names.index(n) for n in held]]
    np.fill_diagonal(out[p:, p:], (_WIDER * half) ** 2)
    return out
