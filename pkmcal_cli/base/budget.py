"""A limit to the processor time of attempts that may be in vain."""

from __future__ import annotations

import time
from collections.abc import Callable

HELP = 20.0
"""Seconds of processor time that help may take which nobody asked for."""


class OutOfTime(Exception):
    """An attempt is given up, as the time is over."""


class Budget:
    """Seconds of processor time, counted from now on; `clock`: seconds so far."""

    def __init__(self, seconds: float = HELP, clock: Callable[[], float] = time.process_time) -> None:
        self._clock, self._end = clock, clock() + seconds

    @property
    def spent(self) -> bool:
        """Whether the time is over."""
        return self._clock() >= self._end

    def check(self, *_: object) -> None:
        """Raises OutOfTime when the time is over; takes what steps of a fit tell of themselves."""
        if self.spent:
            raise OutOfTime
