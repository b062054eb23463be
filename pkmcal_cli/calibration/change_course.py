"""In which way parameters have changed over several data sets: along a line, or by a step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.comparison import Alone, Omnibus, alone
from pkmcal_cli.calibration.data_sets import Common

_LEAST = timedelta(days=1)  # between dates of which a rate is stated


@dataclass(frozen=True)
class Course:
    """times (n,): how much of the change each data set has, from 0 to 1.

    days: between the first and the last, 0 where dates do not tell; since: the first data set after a step.
    """

    times: tuple[float, ...]
    days: float = 0.0
    since: int | None = None

    @property
    def rate(self) -> bool:
        """Whether changes have a rate."""
        return self.days > 0.0 and self.since is None

    @property
    def steps(self) -> list[Course]:
        """Sudden changes in its place, one after each data set but the last."""
        firsts = np.argsort(self.times, kind="stable")[1:].tolist()
        return [Course(tuple(float(t >= self.times[k]) for t in self.times), self.days, since=k) for k in firsts]


def line_of(dates: Sequence[datetime]) -> Course:
    """By dates, or in the order of the data sets where all are of nearly the same time."""
    first, span = min(dates), max(dates) - min(dates)
    if span < _LEAST:
        return Course(tuple(np.linspace(0.0, 1.0, len(dates)).tolist()))
    return Course(tuple((d - first) / span for d in dates), span / timedelta(days=1))


def likely_course(c: Common, contrasts: Array, test: Omnibus, line: Course) -> tuple[Course, Alone | None]:
    """The course by which one parameter explains everything best, with that parameter; the line where none does.

    A line in time that explains everything is not tested against steps: what else happens in time is a trend.
    """
    single = alone(c, contrasts, test, line.times)
    if len(line.times) < 3 or (line.days and single is not None and single.explains):
        return line, single
    courses = [(line, single), *((step, alone(c, contrasts, test, step.times)) for step in line.steps)]
    explaining = [(course, one) for course, one in courses if one is not None and one.explains]
    return max(explaining, key=lambda pair: pair[1].p_left, default=(line, single))
