"""docs/verification.md: what stands there lies within the bounds beside it, and is what the code measures."""

from __future__ import annotations

import re
from itertools import pairwise

import pytest

from tests import verification
from tests.command import ROOT
from tests.in_ci import in_ci
from tests.verification_row import Row, holds, read

PAGE = (ROOT / "docs" / "verification.md").read_text(encoding="utf-8")
LINES = PAGE.split("|---|---|---|\n")[1].splitlines()
QUICK = (
    verification.frames,
    verification.bending,
    verification.poses,
    verification.ropes,
    verification.paper_triglide,
    verification.paper_scissors,
)


@pytest.mark.parametrize("line", LINES)
def test_numbers_of_the_page_lie_within_their_bounds(line: str) -> None:
    assert holds(read(line))


def test_every_number_that_is_only_shown_stands_beside_one_that_must_hold() -> None:
    rows = [read(line) for line in LINES]
    assert rows[0].required != "shown"
    assert not any(a.required == b.required == "shown" for a, b in pairwise(rows))


@pytest.mark.parametrize(
    "part",
    in_ci(["frames", "bending", "paper_triglide", "paper_scissors"], QUICK, lambda part: str(part.__name__)),
)
def test_the_page_is_what_the_code_measures(part) -> None:  # type: ignore[no-untyped-def]
    """Names and bounds as on the page; what is now measured holds, numbers above rounding to four digits."""
    told = {row.name: row for row in map(read, LINES)}
    for row in part():
        assert holds(row) and told[row.name].required == row.required
        if float(row.measured) > 1e-4:
            assert float(told[row.name].measured) == pytest.approx(float(row.measured), rel=1e-4)


@pytest.mark.slow
def test_every_row_of_the_page() -> None:
    rows = [row for part in verification.PARTS for row in part()]
    assert [(r.name, r.required) for r in rows] == [(r.name, r.required) for r in map(read, LINES)]
    assert [r for r in rows if not holds(r)] == []


@pytest.mark.parametrize(
    ("required", "inside", "outside"),
    [
        ("< 1e-9", "6.3517e-11", "1.0001e-9"),
        ("> 0.1", "0.23238", "0.1"),
        ("3 to 13", "12.252", "2.2876"),
        ("14 to 16", "14", "16.015"),
        ("282 (1 %)", "281.65", "279"),
        ("1 +- 0.03", "0.99563", "0.96"),
        ("60.06", "60.057", "60.067"),
        ("3139", "3139.1", "3139.6"),
        ("94 to 96", "94.9 +- 0.5", "93.9 +- 0.5"),
        ("> 91", "92.8 (l1)", "90.9 (l1)"),
        ("`l1, xb1r`", "l1, xb1r", "l1"),
    ],
)
def test_bounds_are_read(required: str, inside: str, outside: str) -> None:
    assert holds(Row("", required, inside))
    assert not holds(Row("", required, outside))


@pytest.mark.parametrize(("required", "measured"), [("tiny", "0.1"), ("< rigid / 3", "1"), ("< 1", "small"), ("", "1")])
def test_words_are_no_bound(required: str, measured: str) -> None:
    with pytest.raises(ValueError, match=re.escape("no ")):
        holds(Row("", required, measured))
