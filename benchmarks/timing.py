"""Times measured side by side: every round runs every case once, so that a slow spell of the computer hits all.

Times are the processor's, of one thread: what other programs take from a busy computer would hit long cases more
than short ones, and so falsify their ratio.
"""

from __future__ import annotations

import resource
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

Cases = Mapping[str, Callable[[], object]]


@dataclass(frozen=True)
class Effort:
    """How many rounds, and what share of the rows that a figure needs; at least a few."""

    rounds: int = 9
    share: float = 1.0

    def rows(self, full: int, least: int = 8) -> int:
        """Rows, or whatever is counted."""
        return max(int(full * self.share), least)

    def sizes(self, full: Sequence[int]) -> Sequence[int]:
        """Sizes over which a cost grows; the smallest two where times mean nothing."""
        return full if self.share >= 1.0 else sorted(full)[:2]


ONCE = Effort(1, 1e-3)
"""Every line once, to see that it runs; the times mean nothing."""


@dataclass(frozen=True)
class Times:
    """Times of the rounds, s, by case."""

    rounds: dict[str, list[float]]

    def median(self, case: str) -> float:
        """Median time of a case, s."""
        return float(np.median(self.rounds[case]))

    def ratio(self, case: str, unit: str) -> float:
        """Median over the rounds of the ratio of two cases of the same round."""
        pairs = zip(self.rounds[case], self.rounds[unit], strict=True)
        return float(np.median([mine / other for mine, other in pairs]))


def children_time() -> float:
    """Processor time of all programs that were started and have ended, s; finer than the ticks of os.times (10 ms)."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def side_by_side(cases: Cases, rounds: int, clock: Callable[[], float] = time.process_time) -> Times:
    """Run all cases once to warm up, then `rounds` times by turns; a single round needs no warmth."""
    for run in cases.values() if rounds > 1 else ():
        run()
    times: dict[str, list[float]] = {name: [] for name in cases}
    for _ in range(rounds):
        for name, run in cases.items():
            begin = clock()
            run()
            times[name].append(clock() - begin)
    return Times(times)


def exponent(sizes: Sequence[float], times: Sequence[float]) -> float:
    """Power of the size with which times grow: slope of the logarithms (least squares)."""
    return float(np.polyfit(np.log(sizes), np.log(times), 1)[0])


@dataclass(frozen=True)
class Line:
    """One line of the table; `limit`: the largest number allowed, or the smallest where `least`."""

    what: str
    measured: float
    limit: float | None = None
    least: bool = False
    unit: str = "x"
    note: str = ""

    @property
    def met(self) -> bool | None:
        """Whether the requirement is met; None where there is none."""
        if self.limit is None:
            return None
        return self.measured >= self.limit if self.least else self.measured <= self.limit

    def cells(self) -> tuple[str, str, str, str, str]:
        """What, measured, required, met, note."""
        unit = "" if self.unit == "x" else f" {self.unit}"
        required = "" if self.limit is None else f"{'>=' if self.least else '<='} {self.limit:g}{unit}"
        met = {None: "", True: "yes", False: "**no**"}[self.met]
        return self.what, f"{self.measured:.3g}{unit}", required, met, self.note
