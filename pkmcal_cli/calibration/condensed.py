"""Long tables in a fit: derivatives are summed chunk by chunk, so that memory does not grow with their number.

A fit needs the normal equations only, as triangles by QR (`triangles`); what looks at rows one by one gets them in
parts, computed again at the states of an evaluation. Tables whose rows are joined or whose drives have errors are
worked on as a whole: there rows, or their drives, have unknowns of their own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.misfit import residuals
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import Evaluation, Linearised, chi_square, evaluate, known_besides, linearise
from pkmcal_cli.calibration.triangles import Triangles
from pkmcal_cli.prediction import Prediction, WarmStart

LONG = 20_000
"""Rows from which on a table is condensed: 40 MB of derivatives by 10 parameters of 20 channels, in several copies."""

Visitor = Callable[[slice, Problem, Evaluation], None]
"""Takes some rows, their problem and their evaluation with derivatives."""


def is_long(problem: Problem) -> bool:
    """Whether a fit of the table is condensed."""
    if len(problem) <= LONG or problem.frames is not None or problem.method != "exact" or problem.drive_sigma.any():
        return False
    return problem.rows.partner is None or not len(problem.joining)


def evaluate_condensed(
    problem: Problem,
    values: Array,
    parameters: tuple[str, ...],
    start: WarmStart | None = None,
    shift: Array | None = None,
    compare: bool = True,
    *,
    sparing: bool = False,
) -> Evaluation:
    """As `evaluate`; of a long table with triangles instead of derivatives."""
    if not is_long(problem):
        return evaluate(problem, values, parameters, start, shift, compare=compare, sparing=sparing)
    triangles = Triangles(problem, len(parameters))

    def add(_: slice, part: Problem, part_evaluation: Evaluation) -> None:
        near = linearise(replace(part, prior=None), part_evaluation)
        triangles.add(near.jacobian.reshape(*part.readings.shape, -1), near.residual.reshape(part.readings.shape))

    evaluation = evaluate_in_parts(problem, values, parameters, start, add, compare)
    return replace(evaluation, triangles=triangles)


def evaluate_in_parts(
    problem: Problem,
    values: Array,
    parameters: tuple[str, ...],
    start: WarmStart | None,
    visit: Visitor,
    compare: bool = True,
) -> Evaluation:
    """As `evaluate`, without drive errors; `visit` takes the rows with derivatives, all at once of a short table."""
    if not is_long(problem):
        whole = evaluate(problem, values, parameters, start, compare=compare)
        visit(slice(0, len(problem)), problem, whole)
        return whole

    def receive(chunk: slice, prediction: Prediction) -> None:
        part = problem.part(chunk)
        evaluation = Evaluation(
            values=values,
            shift=np.broadcast_to(0.0, part.rows.readings.shape),
            residual=residuals(part, prediction.values),
            prediction=prediction,
            parameters=parameters,
        )
        visit(chunk, part, evaluation)

    return evaluate(problem, values, parameters, start, compare=compare, receive=receive)


def in_parts(problem: Problem, evaluation: Evaluation, visit: Visitor) -> None:
    """Hand on the rows of an evaluation with derivatives, in parts where these are not kept."""
    if evaluation.triangles is None:
        visit(slice(0, len(problem)), problem, evaluation)
    else:
        evaluate_in_parts(problem, evaluation.values, evaluation.parameters, evaluation.start, visit, compare=False)


def condensed(problem: Problem, evaluation: Evaluation, damping: float = 0.0) -> Linearised:
    """As `linearise`; of a long table with as many equations as triangles have rows, with the same sums of squares."""
    if evaluation.triangles is not None and not evaluation.triangles.holds(problem):
        values, parameters = evaluation.values, evaluation.parameters
        evaluation = evaluate_condensed(problem, values, parameters, evaluation.start, evaluation.shift, False)
    if evaluation.triangles is None:
        return linearise(problem, evaluation, damping)
    errors, columns = known_besides(problem, evaluation)
    table, channel = evaluation.triangles.rows
    return Linearised(
        residual=np.concatenate([table[:, -1], errors]),
        jacobian=np.vstack([table[:, :-1], columns]),
        drives=(),
        kept=evaluation.shift,
        chi2=chi_square(problem, evaluation),
        least=0.0,
        known=len(errors),
        channel=np.concatenate([channel, np.full(len(errors), -1)]),
    )
