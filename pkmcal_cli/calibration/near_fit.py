"""A fit that begins where a like one ended, if it ends where it would have ended from anywhere."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identify import SPOILT, RowsFailed, identified, identify
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import evaluate
from pkmcal_cli.prediction import WarmStart


@dataclass(frozen=True)
class Near:
    """Where a like fit ended: values (P,), drive errors (N, A) and states of N rows there.

    `held`: whether the data did not determine some direction.
    """

    values: Array
    shift: Array
    states: WarmStart
    held: bool

    @classmethod
    def of(
        cls, fit: Fit, names: tuple[str, ...], start: Array, rows: NDArray[np.intp] | slice = slice(None)
    ) -> Near:
        """Of a fit of these `rows` and perhaps more, by other parameters; names and start (P,): of the fit to come."""
        values, fitted = start.copy(), set(fit.selected)
        own = [k for k, name in enumerate(names[: len(fit.values)]) if name in fitted]
        values[own] = fit.values[own]
        return cls(values, fit.shift[rows], fit.last.start.take(rows).renewed(), bool(fit.directions.held.any()))


def identify_near(
    problem: Problem,
    selected: tuple[str, ...],
    start: Array,
    near: Near,
    iterations: int = 60,
    states: WarmStart | None = None,
) -> Fit:
    """As `identify` from `start` (P,), whose `states` these are, but that `before` may be near. Raises RowsFailed."""
    fit = near_fit(problem, selected, start, near, iterations)
    return identify(problem, selected, start, iterations, states=states) if fit is None else fit


def near_fit(
    problem: Problem,
    selected: tuple[str, ...],
    start: Array,
    near: Near,
    iterations: int = 60,
    hopeless: float = np.inf,
) -> Fit | None:
    """The fit that begins near; None where its end depends on where it begins: directions are held, or rows lost.

    Where the like fit held directions it is not tried: this one would too, as a rule.
    Directions that are held keep what they have from the start, and `near` may have it from rows that are held out.
    `hopeless`: as in `identify`.
    """
    if near.held:
        return None
    try:
        fit = identified(
            problem, selected, near.values, iterations, shift=near.shift, states=near.states, hopeless=hopeless
        )
    except RowsFailed:
        return None
    if fit.status != "converged" or fit.failed or fit.directions.held.any():
        return None
    spoilt = fit.chi2_per_dof > SPOILT and not evaluate(problem, start, None).solved
    return None if spoilt else fit
