"""Mutated inputs, each judged by a second, plain reader: `python -m tests.hostile.fuzz [N [FIRST]]`.

Of every ten, six are tables and three machine files through the readers, one is a whole command. Number k of a
kind is the same input on every computer. What fails is told with its number; the exit code is 1 then.
"""

from __future__ import annotations

import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from tests.hostile import command_fuzz, machine_fuzz, table_fuzz

SLOWEST = 20.0  # seconds that no input may take
FINE = {"refused", "agreed", "done"}
KINDS: dict[str, Callable[[int, Path], tuple[str, str]]] = {
    "tables": table_fuzz.judged,
    "machine files": machine_fuzz.judged,
    "commands": command_fuzz.judged,
}
SHARES = {"tables": 0.6, "machine files": 0.3, "commands": 0.1}


@dataclass
class Figures:
    """What became of the inputs of one kind: outcomes counted, faults in words, the longest time in seconds."""

    kind: str
    outcomes: Counter[str] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)
    longest: float = 0.0

    def text(self) -> str:
        """In a line."""
        counted = ", ".join(f"{n} {how}" for how, n in self.outcomes.most_common())
        return (
            f"{self.kind}: {self.outcomes.total()} ({counted}); {len(self.faults)} faults; longest {self.longest:.1f} s"
        )


def fuzzed(kind: str, count: int, first: int = 0) -> Figures:
    """The inputs `first` to `first + count` of a kind."""
    out, judge = Figures(kind), KINDS[kind]
    with tempfile.TemporaryDirectory() as name:
        for number in range(first, first + count):
            start = time.perf_counter()
            try:
                how, wrong = judge(number, Path(name))
            except Exception:
                how, wrong = "raised", traceback.format_exc(limit=-3)
            took = time.perf_counter() - start
            out.outcomes[how] += 1
            out.longest = max(out.longest, took)
            if how not in FINE or took > SLOWEST:
                out.faults.append(f"{kind} {number}, {took:.1f} s: {how}: {wrong}")
    return out


def main(arguments: Sequence[str]) -> int:
    """All kinds; the figures."""
    count, first = (*map(int, arguments), *(10_000, 0)[len(arguments) :])
    failed = 0
    for kind, share in SHARES.items():
        figures = fuzzed(kind, round(count * share), first)
        failed += len(figures.faults)
        print(figures.text(), *figures.faults[:20], sep="\n", flush=True)
    return int(failed > 0)


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
