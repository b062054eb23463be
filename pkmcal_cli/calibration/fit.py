"""What an identification found."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.special import chdtrc

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.identifiability import Directions
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import Evaluation, evaluate

SIGNIFICANT = 0.01
"""Chance of a chi-square so large at which more is left than sigma explains."""
ABANDONED = "abandoned"
"""Why a fit stopped that was to end soon, and is far from any end."""


@dataclass(frozen=True)
class Ended:
    """Where a fit ended: the rows that it used, and the evaluation with derivatives and the drives' errors."""

    problem: Problem
    last: Evaluation

    @cached_property
    def after(self) -> Evaluation:
        """The rows as the drives read: of most fits that are compared nobody asks for it."""
        if not self.last.shift.any():
            return self.last
        return evaluate(self.problem, self.last.values, start=self.last.start)


@dataclass(frozen=True, kw_only=True)
class Fit:
    """Result of an identification.

    values (P,): all parameters, SI; selected: names identified; directions: at the solution; chi2 and dof of
    the weighted residuals; status "converged", "not_converged" or "nothing_identifiable"; at_bound: names of
    selected parameters on a bound.
    """

    values: Array
    selected: tuple[str, ...]
    directions: Directions
    before: Evaluation
    ended: Ended
    chi2: float
    dof: int
    status: str
    iterations: int
    at_bound: tuple[str, ...]
    failed: Mapping[int, str] = field(default_factory=dict)  # why rows that nothing predicts had no part in it
    kinked: tuple[int, ...] = ()  # rows in which a rope is between taut and slack, though used
    stopped: str = "nothing"  # why it ended there: `step.advance`, "budget" of steps, "nothing" to identify, ABANDONED
    flat: bool = False  # whether chi-square had hardly changed for some steps when the fit ended

    @property
    def last(self) -> Evaluation:
        """With derivatives and the drives' errors, as the fit ended."""
        return self.ended.last

    @property
    def after(self) -> Evaluation:
        """The rows it used, as the drives read."""
        return self.ended.after

    @property
    def abandoned(self) -> bool:
        """Whether nothing was identified, as no fit soon explains readings that look wrong."""
        return self.stopped == ABANDONED

    @property
    def usable(self) -> bool:
        """Whether the fit has converged, or chi-square at least: parameters that hardly matter may still wander."""
        return self.status == "converged" or (self.status == "not_converged" and self.flat and not self.abandoned)

    @property
    def shift(self) -> Array:
        """Errors of the drive readings (N, A), m or rad."""
        return self.last.shift

    @property
    def covariance(self) -> Array:
        """Covariance (p, p) of the selected parameters, SI, nan where undetermined."""
        return self.directions.covariance()

    @property
    def std(self) -> Array:
        """Standard uncertainties (p,) of the selected parameters, nan where undetermined."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def chi2_per_dof(self) -> float:
        """Chi-square per degree of freedom; nan without any."""
        return self.chi2 / self.dof if self.dof > 0 else float("nan")

    @property
    def excess(self) -> float:
        """Chi-square per degree of freedom where it exceeds 1 significantly (at 1 %), else 1."""
        if self.dof <= 0 or float(chdtrc(self.dof, self.chi2)) > SIGNIFICANT:
            return 1.0
        return max(self.chi2_per_dof, 1.0)

    def with_spread(self, spread: float) -> Fit:
        """The fit with all its variances multiplied by a factor."""
        return replace(self, directions=replace(self.directions, spread=spread))
