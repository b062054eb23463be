"""Diagnoses and improvements that several tests look at: computed once in a process, whatever is then made of them.

For tests of what a command prints, writes and refuses; a test of the search itself computes it.
"""

from __future__ import annotations

import hashlib
import io
import pickle
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from pathlib import Path
from types import FunctionType
from typing import Any

import pytest

import pkmcal_cli.diagnosis.closed_loop
import pkmcal_cli.workflow.diagnose
import pkmcal_cli.workflow.improve
from tests.command import Done, run

_COMPUTED = (
    (pkmcal_cli.workflow.diagnose, "diagnose"), (pkmcal_cli.workflow.improve, "improve"),
    (pkmcal_cli.diagnosis.closed_loop, "diagnose"),
)  # fmt: skip
"""The last: `improve` begins with the diagnosis that `diagnose` shows."""
_RESULTS: dict[str, Any] = {}


class _Key(pickle.Pickler):
    """Of all that a computation is given; functions by where they are written, as lambdas have no name; whole paths.

    Objects by their fields alone: what they have computed and kept meanwhile makes no other case of it.
    """

    def persistent_id(self, given: object) -> object:
        if isinstance(given, FunctionType):
            return given.__module__, given.__qualname__, given.__code__.co_firstlineno
        return str(Path(given).resolve()) if isinstance(given, str) and given.endswith(".yaml") else None

    def reducer_override(self, given: Any) -> Any:
        if isinstance(given, type) or not is_dataclass(given):
            return NotImplemented
        return _as_fields, (type(given).__qualname__, [getattr(given, f.name) for f in fields(given)])


def _as_fields(kind: str, values: list[Any]) -> tuple[str, list[Any]]:
    return kind, values


def _once(compute: Callable[..., Any]) -> Callable[..., Any]:
    def known(*given: Any, observe: Any = None, **named: Any) -> Any:
        out = io.BytesIO()
        _Key(out).dump((compute.__qualname__, given, named))  # who is told of the steps changes nothing
        key = hashlib.sha256(out.getvalue()).hexdigest()
        if key not in _RESULTS:
            _RESULTS[key] = compute(*given, **named)
        return _RESULTS[key]

    return known


def run_once(*arguments: str | Path, stdin: str | None = None) -> Done:
    """The command, with the diagnosis or improvement of another test where machine, table and options are the same."""
    with pytest.MonkeyPatch.context() as patch:
        for module, name in _COMPUTED:
            patch.setattr(module, name, _once(getattr(module, name)))
        return run(*arguments, stdin=stdin)
