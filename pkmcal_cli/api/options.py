"""Options as Python has them, in the form that commands take."""

from __future__ import annotations

from collections.abc import Sequence
from numbers import Integral

from pkmcal_cli.base.errors import UsageError

Names = str | Sequence[str]
"""Names and patterns of parameters: `auto,-g*`, or a list of them."""


def names_of(select: Names) -> str:
    """One text of several names. Raises UsageError for what are no names."""
    if isinstance(select, str):
        return select
    if not isinstance(select, Sequence) or not all(isinstance(name, str) for name in select):
        raise UsageError("--select takes names", hint='give for example "auto,R_low", or ["l1", "l2"]')
    return ",".join(select)


def whole(option: str, value: object, most: int | None = None) -> int:
    """A whole number from 0. Raises UsageError for anything else."""
    number = int(value) if isinstance(value, Integral) and not isinstance(value, bool) else -1
    if number < 0 or (most is not None and number > most):
        end = "" if most is None else f" to {most}"
        raise UsageError(f"--{option}: {value!r} is not a whole number from 0{end}")
    return number
