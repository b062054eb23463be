"""Values weighed by a robust loss, the same in every fit of a search: else their chi-squares could not be compared.

A loss weighs by what a fit leaves, and an effect that is missing leaves much. So the weights are those of the declared
parameters first; where effects are found with them, the search is repeated with weights by what these effects leave.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.robust import NEGLIGIBLE, Loss, RobustFit, identify_robustly, normal_figures, weights_of

_FAR = 6.0  # standard deviations from which on a value takes no part
ROUNDS = 3  # of a search, each with weights by what the one before has found


def weighed(problem: Problem, fit: Fit, loss: Loss) -> tuple[Problem, RobustFit]:
    """The problem with weights by a robust fit from where another one ended, and this fit.

    Of normal noise the weighted squares are as large as without weights. What is far off takes no part: tests have
    normal noise in mind, and however little it weighs it is none.
    """
    robust = identify_robustly(replace(problem.without(fit.failed), weight=None), fit, loss)
    assert robust.problem.weight is not None
    level, _ = normal_figures(loss)
    least = max(float(weights_of(loss, np.array(_FAR))), NEGLIGIBLE)
    kept = ~problem.measured | (robust.problem.weight > least)
    weight = robust.problem.weight / level
    return replace(problem, weight=weight, measured=problem.measured & kept), robust
