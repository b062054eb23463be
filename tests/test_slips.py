"""An engineer's slips, written before any answer was looked at: `python -m tests.hostile.slips.texts` lists them."""

from __future__ import annotations

import pytest

from tests.hostile.slips.texts import first_of_each, slips, wrong
from tests.in_ci import in_ci

LEAST = {"machines": (355, 355), "tables": (179, 179)}
"""How many there are, and how many get the message that was expected at least; the others get another, or none."""


@pytest.mark.parametrize("name", in_ci(["tables"], LEAST))
def test_slips_get_the_message_that_is_expected(name: str) -> None:
    every, least = LEAST[name]
    missed = wrong(name)
    assert len(slips(name)) == every and every - len(missed) >= least, missed


def test_slips_of_each_kind_in_machines_get_the_message_that_is_expected() -> None:
    some = first_of_each("machines", 3)
    assert len(some) > 60 and not wrong("machines", some)
