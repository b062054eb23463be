"""A Ctrl-C is an exception between two steps of Python: where C code asks Python and drops the answer, it is lost."""

from __future__ import annotations

import sys
from types import FrameType
from typing import Any

import pytest

from pkmcal_cli.app import run
from tests.command import MACHINES


@pytest.mark.parametrize(
    "arguments",
    [
        pytest.param(("diagnose", "scissors.yaml", "scissors-shopfloor.csv", "-q"), marks=pytest.mark.slow),
        ("calibrate", "hexapod7.yaml", "hexapod7.csv", "-q", "--holdout", "none"),
    ],
)
def test_numpy_asks_no_enumeration(arguments: tuple[str, ...]) -> None:
    """Of 3000 signals at any time of a calibration 43 were lost in `EnumType.__getattr__`, which comparisons called."""
    asked = set()

    def watch(frame: FrameType, event: str, _: Any) -> None:
        code, by = frame.f_code, frame.f_back
        if event == "call" and code.co_name == "__getattr__" and code.co_filename.endswith("enum.py"):
            asked.add(f"{by.f_code.co_filename}:{by.f_lineno}" if by else "?")

    command, *files = arguments
    sys.setprofile(watch)
    try:
        run([command, *(str(MACHINES / word) if "." in word else word for word in files)])
    finally:
        sys.setprofile(None)
    assert not {where for where in asked if "pkmcal_cli" in where}
