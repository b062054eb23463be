"""What the commands print with `--json` on the shipped machines is what it was.

The outputs stand in `tests/reference`; `python -m tests.reference` writes them anew. They hold under any BLAS kernel:
`OPENBLAS_CORETYPE=Prescott python -m pytest tests/test_reference.py`.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.reference_cases import CASES, OUTPUTS, Case
from tests.reference_compare import differences


@pytest.mark.parametrize(
    "case", [pytest.param(c, id=c.name, marks=[pytest.mark.slow] if c.slow else []) for c in CASES]
)
def test_outputs_are_what_they_were(case: Case, tmp_path: Path) -> None:
    expected = json.loads(case.file.read_text(encoding="utf-8"))
    assert not differences(expected, case.output(tmp_path))


def test_every_output_is_compared() -> None:
    assert {c.file for c in CASES} == set(OUTPUTS.glob("*.json"))


def parameter(name: str, value: float, std: float | None) -> dict[str, Any]:
    return {"name": name, "value": value, "std": std, "reason": None}


def by_held(part: float) -> dict[str, Any]:
    return {"name": "l", "std": 1.0, "std_by_held": part}


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        ({"chi2": 1.0}, {"chi2": 1.0 + 1e-10}, True),
        ({"chi2": 1.0}, {"chi2": 1.0 + 1e-8}, False),
        ({"a": [1.0, 1e-15]}, {"a": [1.0, 3e-15]}, True),
        ({"a": [1.0, 1e-9]}, {"a": [1.0, 3e-9]}, False),
        ({"p": [parameter("l", 1.0, 0.1)]}, {"p": [parameter("l", 1.0 + 5e-8, 0.1)]}, True),
        ({"p": [parameter("l", 1.0, 0.1)]}, {"p": [parameter("l", 1.0 + 5e-7, 0.1)]}, False),
        ({"p": [parameter("l", 1.0, None)]}, {"p": [parameter("l", 1.0 + 5e-8, None)]}, False),
        ({"p": [by_held(1e-6)]}, {"p": [by_held(1e-6 + 5e-10)]}, True),
        ({"p": [by_held(1e-6)]}, {"p": [by_held(1e-6 + 5e-9)]}, False),
        ({"p": [by_held(0.1)]}, {"p": [by_held(0.1 + 1e-6)]}, False),
        ({"n": [{"name": "a"}, {"name": "b"}]}, {"n": [{"name": "b"}, {"name": "a"}]}, True),
        ({"n": [{"name": "a", "x": 1}]}, {"n": [{"name": "a", "x": 2}]}, False),
        ({"n": 1}, {"n": 1, "m": 2}, False),
        ({"n": []}, {"n": [1]}, False),
        ({"ok": True}, {"ok": False}, False),
    ],
)  # fmt: skip
def test_what_counts_as_different(one: Any, other: Any, same: bool) -> None:
    assert (not differences(one, other)) == same


def direction(kind: str, spread: float | None, **parameters: float) -> dict[str, Any]:
    return {
        "kind": kind,
        "parameters": parameters,
        "text": "...",
        "hold": [],
        "std_in_ranges": spread,
        "determined": [],
    }


def test_directions_are_compared_as_subspaces() -> None:
    plain = {"undetermined": [direction("null", None, a=1.0, b=1.0), direction("null", None, a=1.0, b=-1.0)]}
    turned = {"undetermined": [direction("null", None, a=1.0), direction("null", None, b=-1.0)]}
    less = {"undetermined": [direction("null", None, a=1.0, b=1.0)]}
    other = {"undetermined": [direction("null", None, a=1.0), direction("null", None, c=1.0)]}
    assert not differences(plain, turned)
    assert differences(plain, less) and differences(plain, other)
    weak = {"undetermined": [direction("weak", 2.0, a=1.0)]}
    assert differences(weak, {"undetermined": [direction("weak", 2.1, a=1.0)]})
    assert differences(weak, {"undetermined": [direction("null", None, a=1.0)]})
