"""The same fit with ranges as wide as parameters turned out to be off, and sigma as large: they decide what is held.

What is compared is their ratio, so ranges over the root of the noise's variance do for both.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.condensed import condensed
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identifiability import UNSEEN, Directions, directions
from pkmcal_cli.calibration.identify import RowsFailed, identify
from pkmcal_cli.calibration.patience import EXACT, Patience
from pkmcal_cli.calibration.prior import prior_of_ranges
from pkmcal_cli.calibration.problem import Problem

_NARROWER = 1.5  # a part of the rows makes ranges no narrower than by this


def with_estimated_ranges(
    problem: Problem, fit: Fit, start: Array, factors: Array, patience: Patience = EXACT
) -> tuple[Problem, Fit]:
    """Problem and fit with ranges of the selected parameters, then of the datum's, times factors (p + g,); unchanged
    where nothing is held, or no fit converges.

    start (P,): where the fit began; what the data do not see stays there, and what they hardly see at nominal.
    """
    if problem.prior is not None and problem.prior.stated:
        return problem, fit
    model = problem.model
    index = [model.names.index(n) for n in fit.selected]
    ranges = problem_ranges(problem, fit, factors)
    unseen = UNSEEN * min(float(factors.min(initial=1.0)), 1.0)  # what was seen still is
    wider, values = replace(problem, model=model.with_ranges(ranges), unseen=unseen), fit.values
    if problem.prior is None:
        near, beside = condensed(problem, fit.last), problem.beside(fit.selected, ranges)
        spectrum = directions(near.jacobian, fit.selected, ranges[index], unseen, beside)
        both = (spectrum, fit.directions)
        if not any(each.weak.any() for each in both) and len({each.rank for each in both}) == 1:
            return problem, fit
        values = centred(problem, values, start, spectrum)
    else:
        wider = replace(wider, prior=prior_of_ranges(wider.model, fit.selected, wider.datum, start))
    try:
        again = identify(wider, fit.selected, values, shift=fit.shift, states=fit.last.start, patience=patience)
    except RowsFailed:
        return problem, fit
    if again.status != "converged" or again.failed:
        return problem, fit
    again = again.with_spread(fit.directions.spread)
    steps = fit.iterations + again.iterations
    return wider, replace(again, before=fit.before, failed=fit.failed, kinked=fit.kinked, iterations=steps)


def problem_ranges(problem: Problem, fit: Fit, factors: Array) -> Array:
    """Ranges (P,) of all parameters, those of the selected ones and of the datum's times factors (p + g,)."""
    ranges, held = problem.model.ranges, () if problem.datum is None else problem.datum.held
    ranges[[problem.model.names.index(n) for n in (*fit.selected, *held)]] *= factors
    return ranges


def far_from_held(problem: Problem, fit: Fit, factors: Array) -> bool:
    """Whether nothing would be held in a fit even if ranges times factors (p + g,) were narrower still."""
    if problem.prior is not None:
        return False
    ranges = problem_ranges(problem, fit, factors / _NARROWER)
    widths, beside = ranges[[problem.model.names.index(n) for n in fit.selected]], problem.beside(fit.selected, ranges)
    spectrum = directions(condensed(problem, fit.last).jacobian, fit.selected, widths, beside=beside)
    return not (spectrum.weak.any() or spectrum.null.any())


def centred(problem: Problem, values: Array, start: Array, spectrum: Directions) -> Array:
    """Values (P,) with weak directions about nominal, null ones as at the start (P,), within bounds."""
    index = [problem.model.names.index(n) for n in spectrum.names]
    nominal, held = problem.nominal_at(values)[index], spectrum.held
    way = np.where(spectrum.weak[:, None], nominal - values[index], (start - values)[index])
    way /= spectrum.ranges
    parts = (spectrum.duals[held] * way[held]).sum(axis=1)  # (k,)
    out = values.copy()
    out[index] += spectrum.vectors[held].T @ parts * spectrum.ranges
    low, high = problem.bounds[index].T
    out[index] = np.clip(out[index], low, high)  # else no row may have a prediction
    return out
