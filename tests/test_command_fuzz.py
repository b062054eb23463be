"""Mutated inputs and mistyped command lines through whole commands: `python -m tests.hostile.fuzz N` has more."""

from __future__ import annotations

import pytest

from pkmcal_cli.commands._group import names
from tests.hostile.command_lines import MACHINE, OPTIONS, PARAMETERS, TABLE
from tests.hostile.fuzz import fuzzed
from tests.in_ci import in_ci

PARTS, COUNT = 6, 500
IN_CI = ("1", "4")  # of the parts


@pytest.mark.parametrize("part", in_ci(IN_CI, range(PARTS)))
def test_a_command_ends_as_documented(part: int) -> None:
    figures = fuzzed("commands", COUNT, part * COUNT)
    assert not figures.faults, figures.faults[:3]
    assert figures.outcomes["done"] > 0.2 * COUNT  # not all is refused


@pytest.mark.slow
def test_nor_otherwise_in_a_hundred_thousand() -> None:
    assert not fuzzed("commands", 100_000, first=100_000).faults


def test_every_subcommand_is_tried() -> None:
    assert {line.split()[0] for lines in (TABLE, MACHINE, PARAMETERS, OPTIONS) for line in lines} == set(names())
