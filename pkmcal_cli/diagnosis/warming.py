"""Drifts of drives and instruments have one course in time; where temperature goes with it, thermal effects too."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.effects import catalogue

TOGETHER = 0.9  # correlation of time and a temperature from which on they go together
_FITS = 9.2  # chi-square by which an effect may explain less than the best and still fit (1 % of two numbers)


def warming(problem: Problem) -> float:
    """Largest correlation of time and a temperature, without sign; 0 where one is not known."""
    columns = problem.rows.columns
    time = columns.get("time")
    warm = [v for name, v in columns.items() if name == "T" or name.startswith("T.")]
    if time is None or not _varies(time):
        return 0.0
    return max((abs(float(np.corrcoef(time, v)[0, 1])) for v in warm if _varies(v)), default=0.0)


def _varies(values: Array) -> bool:
    return bool(np.isfinite(values).all()) and bool(np.ptp(values) > 0)


def of_warming(hypothesis: Hypothesis) -> bool:
    """Whether an effect is a drift or depends on temperature."""
    effect = catalogue().get(hypothesis.effect)
    return effect is not None and bool({"time", "temperature"} & set(effect.needs))


def alike_in_time(problem: Problem, one: Hypothesis, others: Sequence[Hypothesis]) -> NDArray[np.bool_]:
    """Which of others (H,) have the course of one effect in time, so that only what they move tells them apart.

    An instrument drifts in any direction, and has numbers for it; a drive moves the tool in one. Where that is near,
    fewer numbers have more evidence, whichever it was.
    """
    if of_warming(one) and warming(problem) > TOGETHER:
        return np.array([of_warming(h) for h in others], dtype=bool)
    rivals = [_drifts(h) and h.measurement != one.measurement and not h.members for h in others]
    return np.array(rivals, dtype=bool) & _drifts(one)


def _drifts(hypothesis: Hypothesis) -> bool:
    effect = catalogue().get(hypothesis.effect)
    return effect is not None and "time" in effect.needs


def fits_as_well(statistic: Array, best: float, variance: float) -> Array:
    """Which effects (H,) explain nearly as much as the best, whatever their evidence."""
    return np.asarray((best - statistic) / variance < _FITS)
