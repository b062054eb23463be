"""Where all rows can be predicted: fits of those rows that can be lead to the others."""

from __future__ import annotations

import numpy as np

from pkmcal_cli.calibration.condensed import condensed, evaluate_condensed
from pkmcal_cli.calibration.measured_pose import errors_at_poses, uncertain_drives
from pkmcal_cli.calibration.patience import Patience
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import Evaluation, chi_square, lost_rows
from pkmcal_cli.calibration.step import Scaled, advance
from pkmcal_cli.calibration.trust_region import Region
from pkmcal_cli.prediction import WarmStart

_HOPELESS = 0.5  # sizes of the machine by which drives disagree: no error of geometry is as large
_LEAD = 30  # steps of a fit of those rows that can be predicted


def states_at(evaluation: Evaluation) -> WarmStart | None:
    """Its rows whose drives disagree so far that no values of the parameters help: they fail near it too; or None."""
    return evaluation.start.hopeless(_HOPELESS)


def led(problem: Problem, scale: Scaled, first: Evaluation, patience: Patience) -> Evaluation:
    """Where all rows can be predicted: the start, or where fits of the rows that can be lead to.

    Where these do not lead to more and more rows, the evaluation that has fewest lost rows. patience: when such a fit
    is given up.
    """
    evaluation = nearest(problem, scale, first)
    while not evaluation.solved:
        rows = np.nonzero(evaluation.prediction.solved)[0]
        if not len(rows):
            break
        part = problem.take(rows)
        states, shift = evaluation.start.take(rows), evaluation.shift[rows]
        lead = evaluate_condensed(part, evaluation.values, scale.names, states, shift)
        region, status = Region(), ""
        for _ in range(_LEAD if lead.solved else 0):
            lead, region, status = advance(part, scale, lead, condensed(part, lead), region, patience, compare=False)
            if status:
                break
        again = evaluate_condensed(problem, lead.values, scale.names, states_at(evaluation))
        further = nearest(problem, scale, again)
        if len(lost_rows(problem, further)) >= len(lost_rows(problem, evaluation)):
            break
        evaluation = further
    return evaluation


def nearest(problem: Problem, scale: Scaled, plain: Evaluation) -> Evaluation:
    """An evaluation without drive errors, or that with those which put the rows at their measured poses.

    The one that predicts more rows, then the one of lower chi-square.
    """
    if not uncertain_drives(problem).any():
        return plain
    seen = np.where(problem.measured, problem.readings, np.nan)
    shift = np.nan_to_num(errors_at_poses(problem, plain.values, seen))
    if not shift.any():
        return plain
    posed = evaluate_condensed(problem, plain.values, scale.names, plain.start, shift)
    if plain.solved and posed.solved:
        return min(plain, posed, key=lambda e: chi_square(problem, e))
    return posed if len(lost_rows(problem, posed)) < len(lost_rows(problem, plain)) else plain
