"""Which parameters a command works on: `auto`, `all`, names and patterns."""

from __future__ import annotations

from fnmatch import fnmatchcase

from pkmcal_cli.errors import UsageError, did_you_mean
from pkmcal_cli.model import Model


def select(model: Model, text: str, option: str = "--select") -> tuple[str, ...]:
    """Parameter names for a `--select` text, in the machine file's order.

    A comma-separated list of names and patterns (`l*`); `auto`: all but those declared `identify: false`; `all`:
    every parameter. `auto,R_low` adds to auto; a leading minus removes (`auto,-gamma`). Raises UsageError.
    """
    chosen: set[str] = set()
    for part in (p.strip() for p in text.split(",")):
        remove = part.startswith("-")
        pattern = part[1:] if remove else part
        found = _matching(model, pattern)
        if not found:
            raise UsageError(
                f"{option}: the machine has no parameter `{pattern}`",
                hint=did_you_mean(pattern, [*model.names, "auto", "all"]),
            )
        chosen = chosen - found if remove else chosen | found
    return tuple(n for n in model.names if n in chosen)


def named(model: Model, text: str) -> frozenset[str]:
    """Parameters that a `--select` text names one by one: each must turn out determined."""
    return frozenset(p.strip() for p in text.split(",")) & frozenset(model.names)


def _matching(model: Model, pattern: str) -> set[str]:
    if pattern == "all":
        return set(model.names)
    if pattern == "auto":
        return {p.name for p in model.parameters if p.identify}
    names = {p.name: (p.name, p.shared_name) for p in model.parameters}
    return {n for n, known in names.items() if any(k == pattern or fnmatchcase(k, pattern) for k in known)}
