"""Figures that pages state in their own words are those of their outputs, and one command rewrites a whole page."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.command import ROOT
from tests.coverage_page import PARTS

TABLE, _, OUTPUTS = (ROOT / "docs" / "paper.md").read_text(encoding="utf-8").partition("\n## Observability")
NUMBER = r"(?<![\w.])\d+(?:\.\d+)?(?![\w.]*\d)"
PRINTED = [float(n) for n in re.findall(NUMBER, OUTPUTS)]
COMPUTED = "mean ratio|below|more than|picture|\\[|table by position"
"""What the page prints nowhere as such."""


def rows_of_the_paper() -> list[tuple[str, str]]:
    """What, and our figures, of the page's table."""
    cells = [[c.strip() for c in line.split("|")[1:-1]] for line in TABLE.splitlines() if line.startswith("| ")][2:]
    return [(c[0], c[2]) for c in cells if not re.search(COMPUTED, c[2])]


def test_the_table_of_the_paper_is_read() -> None:
    assert len(rows_of_the_paper()) >= 10


@pytest.mark.parametrize(("what", "ours"), rows_of_the_paper())
def test_our_figures_beside_the_papers_are_printed_below(what: str, ours: str) -> None:
    """To the digits that the table states; a place ("at x = 300 mm") is no figure."""
    for number in re.findall(NUMBER, re.sub(r"at x = \d+ mm", "", ours)):
        digits = len(number.replace(".", "").lstrip("0"))
        assert any(float(f"{p:.{digits}g}") == float(number) for p in PRINTED), (what, number)


def test_one_command_writes_all_of_the_page_of_coverage() -> None:
    """Every program that writes a part of it; some only say so in their own text."""
    page = (ROOT / "docs" / "coverage.md").read_text(encoding="utf-8")
    named = set(re.findall(r"^Written by `python -m (tests\.\w+)`", page, re.MULTILINE))
    assert named == {part[0] for part in PARTS} and len(named) == 4
    assert all((Path(ROOT) / f"{name.replace('.', '/')}.py").exists() for name in named)
