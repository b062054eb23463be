"""Effects larger than their ranges: what a table shows only there is not held by its range where it is fitted.

A fit holds what the data tell less precisely than half a range, where it began. An effect that could be seen only far
beyond its range is told less precisely than that, by however many standard uncertainties it is off.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.score import Score


def begun_beyond(hypothesis: Hypothesis, score: Score, offsets: Array, null: Array, problem: Problem) -> Hypothesis:
    """A hypothesis whose fits begin at its estimate, where it could be seen only far beyond its range; else itself.

    offsets (k,): the estimate, off null; null (P,): values without it; SI.
    """
    if not score.far:
        return hypothesis
    begin = []
    for name, offset in zip(hypothesis.parameters, offsets, strict=True):
        k = problem.model.names.index(name)
        if name in hypothesis.unknown:
            begin.append((name, float(np.clip(null[k] + offset, *problem.model.parameters[k].bounds))))
    return replace(hypothesis, begin=tuple(begin))


def unheld(problem: Problem, accepted: Sequence[Hypothesis]) -> Problem:
    """The problem with ranges as wide as effects are large where their fits begin; itself where none is beyond its."""
    ranges = problem.model.ranges.copy()
    for name, value in (value for h in accepted for value in h.begin):
        k = problem.model.names.index(name)
        ranges[k] = max(ranges[k], abs(value - problem.model.nominal[k]))
    if (ranges == problem.model.ranges).all():
        return problem
    return replace(problem, model=problem.model.with_ranges(ranges))
