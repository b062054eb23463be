"""Every number of every shipped machine replaced by 0, -1, 1e308 and 1e-308 in turn: a result or a fault, no more."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.number_sweep import Case, cases, faults, numbers, sample, source
from tests.support import SHIPPED

LONG = ("hexapod7", "gantry")
FAST = ("biglide", "belt-router", "triglide")


def test_numbers_are_found_wherever_they_stand() -> None:
    """In values, beside units, in expressions and in lists of `each`; not in names."""
    text = source("hangprinter")
    found = {text[start:stop] for start, stop in numbers("hangprinter")}
    assert {"20", "255", "2", "1600"} <= found
    legs = source("hexapod7")
    assert not any(legs[start - 1].isalpha() or legs[start - 1] in "_{" for start, _ in numbers("hexapod7"))
    assert sum(len(numbers(name)) for name in SHIPPED) > 500


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize(
    "case",
    [
        pytest.param(c, id=str(c), marks=[pytest.mark.slow] if c.machine in LONG or k % 2 else [])
        for k, c in enumerate(sample(60))
    ],
)
def test_a_changed_number_is_told_or_computed_with(case: Case, tmp_path: Path) -> None:
    """A sample, the same every time; machines that are computed fast go through all commands."""
    assert faults(case, tmp_path, case.machine in FAST) == []


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("machine", SHIPPED)
def test_every_number_of_a_machine(machine: str, tmp_path: Path) -> None:
    found = [text for case in cases(machine) for text in faults(case, tmp_path)]
    assert found == []
