"""Rows in which a rope is between taut and slack: within what is not known, either may be true.

Their readings have a kink there, about which no linear interval holds and no step of a fit is right. They are left out,
also where they alone hold a parameter: that a rope just does not pull says from one side only where it is held.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identify import RowsFailed, identify
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.prediction import Request, predict

_NEAR = 2.0  # standard uncertainties of a rope's elongation
_ROUNDS = 3
_NEAR_KINK = "a rope is taut or slack (within 2 std)"


def steady_fit(problem: Problem, fit: Fit) -> Fit:
    """The fit without rows near the kink of a rope; with them (`Fit.kinked`) where too few others are left.

    A fit that ends at a kink does not converge; without these rows it may.
    """
    left_out = {row: why for row, why in fit.failed.items() if why == _NEAR_KINK}
    best = fit
    for _ in range(_ROUNDS):
        near = {r: why for r, why in near_kinks(problem, best).items() if r not in left_out}
        if not near:
            break
        left_out |= near
        remaining = problem.without(left_out)
        if 2 * len(left_out) > len(problem) or remaining.count <= len(fit.selected):
            return replace(fit, kinked=tuple(left_out))
        try:
            other = identify(remaining, fit.selected, best.values)
        except RowsFailed:
            return replace(fit, kinked=tuple(left_out))
        best = replace(other, before=fit.before, failed={**fit.failed, **left_out, **other.failed})
    # a fit may end at a kink of rows that are left out next
    return best if best.status == "converged" or not left_out else replace(fit, kinked=tuple(left_out))


def near_kinks(problem: Problem, fit: Fit) -> Mapping[int, str]:
    """Rows, and why, in which a rope is within two standard uncertainties of the kink; of those that are measured.

    What the data do not see at all adds nothing: of a rope that is slack in all rows they tell from one side.
    """
    model = problem.model
    if not model.exact.ropes:
        return {}
    request = Request(parameters=fit.selected, by_drive=True, ropes=True)
    prediction = predict(model, fit.values, problem.moved(fit.shift), request, fit.last.start)
    assert prediction.ropes is not None
    slopes = prediction.ropes.jacobian
    variance = np.einsum("nrp,pq,nrq->nr", slopes, fit.directions.determined_covariance(seen=True), slopes)
    variance += np.einsum("nra,na->nr", prediction.ropes.by_drive**2, problem.reading_sigma**2)
    near = np.abs(prediction.ropes.values) < _NEAR * np.sqrt(np.maximum(variance, 0.0))
    near &= (prediction.solved & problem.measured.any(axis=1))[:, None]
    return {int(row): _NEAR_KINK for row in np.nonzero(near.any(axis=1))[0]}
