"""Ropes that are slack in all rows of a fit that does not explain the data: would they pull, if they were tighter?

A slack rope moves no reading, so that no derivative says whether it should be taut, and a fit leaves it slack.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identify import RowsFailed, identify
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.steady_ropes import steady_fit
from pkmcal_cli.prediction import Request, predict

_TAUT = (0.1, 0.4)  # shares of the rows in which such a rope is made taut
_STEPS = 25  # of a fit from there
_SLIGHT = 1e-6  # of a rope's dependence on all parameters: what the data do not see does not move it


def with_tightened_ropes(problem: Problem, fit: Fit) -> Fit:
    """The best of a fit that leaves more than noise and of those that begin with taut ropes instead of slack ones."""
    if fit.excess <= 1.0 or not problem.model.exact.ropes or not fit.directions.null.any():
        return fit
    best = fit
    index = [problem.model.names.index(n) for n in fit.selected]
    for step in _tightening(problem, fit):
        start = fit.values.copy()
        start[index] += step
        try:
            other = identify(problem, fit.selected, start, iterations=_STEPS)
        except RowsFailed:
            continue
        other = other if other.status == "converged" else steady_fit(problem, other)
        best = min(best, other, key=lambda f: (f.status != "converged", f.chi2_per_dof))
    return best if best is fit else with_tightened_ropes(problem, replace(best, before=fit.before))


def _tightening(problem: Problem, fit: Fit) -> list[Array]:
    """Steps (p,) of the selected parameters, unseen by the data, that make a rope taut that is slack in all rows."""
    request = Request(parameters=fit.selected, ropes=True)
    prediction = predict(problem.model, fit.values, problem.moved(fit.shift), request, fit.last.start)
    assert prediction.ropes is not None
    rows = prediction.solved & problem.measured.any(axis=1)
    long, slopes = prediction.ropes.values[rows], prediction.ropes.jacobian[rows] * fit.directions.ranges
    unseen = fit.directions.vectors[fit.directions.null]
    steps = []
    for rope in np.nonzero((long < 0).all(axis=0))[0] if len(long) else []:
        mean = slopes[:, rope].mean(axis=0)
        way = unseen.T @ (unseen @ mean)  # in ranges
        per_way = slopes[:, rope] @ way
        if np.abs(per_way).min() <= _SLIGHT * np.abs(mean).max() ** 2:
            continue
        ahead = np.sort(-long[:, rope] / per_way)
        steps += [way * ahead[int(share * (len(ahead) - 1))] * fit.directions.ranges for share in _TAUT]
    return steps

