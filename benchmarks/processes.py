"""A work in two processes: what they cost together, and how long nobody works; as whole programs, start included."""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np

from .predictions import MACHINES
from .program import command_cost
from .timing import Effort, Line

_CALIBRATIONS = 200
_STUDY = ("study", str(MACHINES / "scissors.yaml"), "--points", "80", "--noise", "10 um", "-q")


def process_lines(effort: Effort) -> Iterator[Line]:
    """200 calibrations in one and in two processes, by turns."""
    count = effort.rows(_CALIBRATIONS, 2)
    rounds = range(max(effort.rounds // 3, 1))
    spent = np.array([[_spent(count, jobs) for jobs in (1, 2)] for _ in rounds])  # (rounds, jobs, processor and clock)
    cost, clock = np.moveaxis(spent, 2, 0)  # (rounds, jobs)
    what = f"{count} calibrations of the Scissors by `study` in two processes"
    note = f"by the clock {np.median(clock[:, 0]):.2g} and {np.median(clock[:, 1]):.2g} s, on an idle computer"
    idle = 1.0 - cost[:, 1] / (2.0 * clock[:, 1])
    sooner = clock[:, 0] / clock[:, 1]
    yield Line(f"{what}: processor time : that of one process", float(np.median(cost[:, 1] / cost[:, 0])), 1.1)
    yield Line(f"{what}: share of the time that they are idle", float(np.median(idle)), 0.1)
    yield Line(f"{what}: time of one process : that of two", float(np.median(sooner)), 1.8, least=True, note=note)


def _spent(count: int, jobs: int) -> tuple[float, float]:
    """Time of the processors and of a clock, s."""
    begun = time.perf_counter()
    seconds, _ = command_cost(*_STUDY, "--repeat", str(count), "--jobs", str(jobs))
    return seconds, time.perf_counter() - begun
