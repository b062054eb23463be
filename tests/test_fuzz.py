"""Mutated tables, machine files and parameter files, judged by a second reader: `python -m tests.hostile.fuzz N`."""

from __future__ import annotations

import pytest

from tests.hostile.fuzz import KINDS, fuzzed

COUNTS = {"tables": 2000, "machine files": 300, "commands": 40}


@pytest.mark.parametrize("kind", KINDS)
def test_no_traceback_and_no_silent_shift(kind: str) -> None:
    figures = fuzzed(kind, COUNTS[kind])
    assert not figures.faults, figures.faults[:3]
    assert figures.outcomes["agreed"] + figures.outcomes["done"] > 0.2 * COUNTS[kind]  # not all is refused


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "count"), [("tables", 600_000), ("machine files", 300_000), ("commands", 100_000)])
def test_no_traceback_in_a_million(kind: str, count: int) -> None:
    assert not fuzzed(kind, count, first=10_000).faults
