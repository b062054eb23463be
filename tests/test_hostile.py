"""The hostile checks that fit a normal run: mutants apply and some are killed, file operations fail whole."""

from __future__ import annotations

import pytest

from tests.hostile import file_operations
from tests.hostile.mutants import MUTANTS, ROOT, changed, outcomes

IN_CI = (
    tuple(m for m in MUTANTS if m.test.startswith("tests/test_survivors.py::"))[:3]
    + tuple(m for m in MUTANTS if m.test.startswith("tests/test_elements.py::"))[:7]
)


def test_every_mutant_applies_and_names_tests_that_exist() -> None:
    """Its text occurs exactly once, and what is left is a program."""
    assert len(MUTANTS) >= 60
    for mutant in MUTANTS:
        file = ROOT / "pkmcal_cli" / mutant.file
        compile(changed(mutant, file.read_text(encoding="utf-8")), mutant.file, "exec")
        for test in mutant.test.split():
            path, _, name = test.partition("::")
            assert f"def {name.partition('[')[0]}" in (ROOT / path).read_text(encoding="utf-8"), test


def test_ten_mutants_are_killed() -> None:
    assert len(IN_CI) == 10
    assert {how for _, how in outcomes(IN_CI)} == {"killed"}


@pytest.mark.slow
def test_every_mutant_is_killed() -> None:
    assert {how for _, how in outcomes(MUTANTS)} == {"killed"}


@pytest.mark.slow
@pytest.mark.parametrize("command", file_operations.COMMANDS)
def test_a_file_operation_that_fails_leaves_no_torn_file(command: str) -> None:
    count, faults = file_operations.faults(command)
    assert count >= 4 * len(file_operations.HOWS) and not faults
