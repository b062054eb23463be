"""Which cases of a parametrised test CI runs: one of each mechanism at least; those that repeat it are slow."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import pytest


def in_ci(named: Iterable[str], cases: Iterable[Any], name: Callable[..., str] = str) -> list[Any]:
    """The cases as parameters, `name` their ids, those of a tuple joined; slow are all but the named ones.

    Raises ValueError where no case has a name, as a test that nobody runs would go unseen.
    """
    wanted = set(named)
    params = []
    for case in cases:
        values = case if isinstance(case, tuple) else (case,)
        label = "-".join(map(name, values))
        marks = () if label in wanted else pytest.mark.slow
        params.append(pytest.param(*values, id=label, marks=marks))
    if unknown := wanted - {str(p.id) for p in params}:
        raise ValueError(f"no such case: {', '.join(sorted(unknown))}")
    return params
