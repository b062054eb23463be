"""Tasks of a long work, by number."""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import Any, Protocol, TypeVar

from pkmcal_cli.base.stages import Observer, unobserved

Result_co = TypeVar("Result_co", covariant=True)


class Work(Protocol[Result_co]):
    """Tasks by number; every worker gets one copy of it."""

    def __call__(self, number: int, observe: Observer = unobserved) -> Result_co:
        """The result of a task; `observe` is told its steps where it runs in this process."""


class KeptWork(Work[Result_co], Protocol[Result_co]):
    """A work whose results are read from files, too."""

    def fits(self, result: Any) -> bool:
        """Whether this could be the result of a task."""
        ...


def one_thread() -> AbstractContextManager[object]:
    """While a task runs, linear algebra has one thread, so that sums come out the same, whoever does it."""
    from threadpoolctl import threadpool_limits

    limits: AbstractContextManager[object] = threadpool_limits(1)
    return limits
