"""Mutated tables and machine files through the readers, judged by a second one: `python -m tests.hostile.fuzz N`."""

from __future__ import annotations

import pytest

from tests.hostile.fuzz import fuzzed
from tests.in_ci import in_ci

PARTS = {"tables": (4, 5000), "machine files": (4, 1750)}
"""How many parts, and how many inputs in each: 27,000 in all, of which CI reads 8,500."""
CASES = [(kind, part) for kind, (parts, _) in PARTS.items() for part in range(parts)]
IN_CI = ("tables-3", "machine files-0", "machine files-1")


@pytest.mark.parametrize(("kind", "part"), in_ci(IN_CI, CASES))
def test_no_traceback_and_no_silent_shift(kind: str, part: int) -> None:
    count = PARTS[kind][1]
    figures = fuzzed(kind, count, part * count)
    assert not figures.faults, figures.faults[:3]
    assert figures.outcomes["agreed"] > 0.2 * count  # not all is refused


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "count"), [("tables", 600_000), ("machine files", 300_000)])
def test_nor_in_nine_hundred_thousand(kind: str, count: int) -> None:
    assert not fuzzed(kind, count, first=100_000).faults
