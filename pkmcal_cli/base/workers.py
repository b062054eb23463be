"""Who does the tasks of a long work: this process, several, or those of a cluster; results do not depend on it.

A work is a callable of a task's number, and every task draws its random numbers from a seed of its own.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

from pkmcal_cli.base.errors import UsageError
from pkmcal_cli.base.stages import Observer, Stage, unobserved, within
from pkmcal_cli.base.tasks import Work, one_thread

Result = TypeVar("Result")


@dataclass(frozen=True)
class Workers:
    """jobs: number of processes, 1 for this one; cluster: address of a dask scheduler, whose workers do it instead."""

    jobs: int = 1
    cluster: str | None = None

    @classmethod
    def of(cls, jobs: int, cluster: str | None = None) -> Workers:
        """As options say; 0 jobs: as many as this process may use cores. Raises UsageError for both."""
        if cluster is not None and jobs != 1:
            raise UsageError("--jobs and --cluster exclude each other", hint="the cluster says how many workers it has")
        if jobs == 0:
            from joblib import cpu_count

            jobs = cpu_count()
        return cls(jobs, cluster)

    def done(
        self, work: Work[Result], numbers: Sequence[int], name: str, observe: Observer = unobserved
    ) -> Iterator[Mapping[int, Result]]:
        """Results by number, some at a time, in the order in which they are there; `name` of a task for who watches.

        Raises what a task raises, and PkmcalError where workers are lost again and again.
        """
        if self.cluster is None and (self.jobs == 1 or len(numbers) < 2):
            with one_thread():
                for k, number in enumerate(numbers):
                    stage = Stage(name, k, len(numbers))
                    observe(stage)
                    yield {number: work(number, within(observe, stage))}
            return
        from pkmcal_cli.base.processes import in_batches

        count = 0
        observe(Stage(name, count, len(numbers)))
        for results in in_batches(work, numbers, self.jobs, self.cluster):
            count += len(results)
            observe(Stage(name, min(count, len(numbers) - 1), len(numbers)))
            yield results

    def results(self, work: Work[Result], count: int, name: str, observe: Observer = unobserved) -> list[Result]:
        """Results of tasks 0 to `count` - 1, in this order. Raises as `done`."""
        by_number: dict[int, Result] = {}
        for some in self.done(work, range(count), name, observe):
            by_number.update(some)
        return [by_number[number] for number in range(count)]


ALONE = Workers()
"""This process."""
