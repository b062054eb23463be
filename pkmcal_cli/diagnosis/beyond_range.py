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
from pkmcal_cli.diagnosis.score import Score, tail_of


def begun_beyond(hypothesis: Hypothesis, score: Score, offsets: Array, null: Array, problem: Problem) -> Hypothesis:
    """A hypothesis whose fits begin at its estimate, where it could be seen only far beyond its range; else itself.

    offsets (k,): the estimate, off null; null (P,): values without it; SI. What moves nothing at null, as a lag does,
    begins there.
    """
    if not score.far:
        return hypothesis
    begin = []
    for name, offset, length2 in zip(hypothesis.parameters, offsets, score.length2, strict=True):
        k = problem.model.names.index(name)
        if name in hypothesis.unknown and length2 > 0:
            begin.append((name, float(np.clip(null[k] + offset, *problem.bounds[k]))))
    return replace(hypothesis, begin=tuple(begin))


def improbability(problem: Problem, accepted: Sequence[Hypothesis], values: Array, null: Array) -> float:
    """Log prior density of the sizes of effects beyond their ranges, over that within; values, null (P,), SI."""
    tails = 0.0
    for hypothesis in (h for h in accepted if h.begin):
        index = [problem.model.names.index(name) for name, _ in hypothesis.begin]
        off = np.abs(values[index] - null[index]) / problem.model.ranges[index]
        tails += tail_of(max(off.tolist()))
    return tails


def unheld(problem: Problem, accepted: Sequence[Hypothesis]) -> Problem:
    """The problem with ranges as wide as effects are large where their fits begin; itself where none is beyond its.

    All numbers of an effect are wider by the same factor: one that is small is told no better than the largest.
    """
    model, ranges = problem.model, problem.model.ranges.copy()
    for hypothesis in (h for h in accepted if h.begin):
        index = [model.names.index(name) for name, _ in hypothesis.begin]
        off = np.abs([value for _, value in hypothesis.begin] - model.nominal[index])
        ranges[index] *= max(1.0, *(off / ranges[index]).tolist())
    if (ranges == model.ranges).all():
        return problem
    return replace(problem, model=model.with_ranges(ranges))
