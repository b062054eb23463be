"""Counts with their Wilson intervals, and tables of Markdown."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from tests.benchmark.judge import Result

Z95 = 1.959964


@dataclass(frozen=True)
class Share:
    """`hits` out of `cases`."""

    hits: int
    cases: int

    @classmethod
    def of(cls, results: Iterable[Result], good: Callable[[Result], bool]) -> Share:
        """How many results are good."""
        found = [good(r) for r in results]
        return cls(sum(found), len(found))

    @property
    def value(self) -> float:
        """The share, nan of none."""
        return self.hits / self.cases if self.cases else float("nan")

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's 95 % interval."""
        if not self.cases:
            return 0.0, 1.0
        n, p, z2 = self.cases, self.value, Z95**2
        middle = (p + z2 / (2 * n)) / (1 + z2 / n)
        half = Z95 * np.sqrt(p * (1 - p) / n + z2 / (4 * n * n)) / (1 + z2 / n)
        return max(0.0, middle - half), min(1.0, middle + half)

    def __str__(self) -> str:
        if not self.cases:
            return "not run"
        low, high = self.interval
        return f"{self.hits} of {self.cases} = {100 * self.value:.1f} % ({100 * low:.1f} to {100 * high:.1f})"


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table of Markdown."""
    lines = [" | ".join(head), " | ".join("---" for _ in head)]
    lines += [" | ".join(str(cell) for cell in row) for row in rows]
    return "\n".join(f"| {line} |" for line in lines) + "\n"


def of_test(results: Iterable[Result], *tests: str) -> list[Result]:
    """Results of some tests."""
    return [r for r in results if r.test in tests]


def median(values: Sequence[float]) -> float:
    """Median, nan of nothing."""
    return float(np.median(values)) if len(values) else float("nan")
