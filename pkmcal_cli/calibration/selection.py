"""Which parameters a command works on: `auto`, `all`, names and patterns."""

from __future__ import annotations

from fnmatch import fnmatchcase

from pkmcal_cli.base.errors import UsageError, did_you_mean
from pkmcal_cli.effects.unexplained import UNEXPLAINED
from pkmcal_cli.model.model import Model

_WORDS = ("auto", "all")
_EXAMPLE = "name parameters of the machine file, which `check` lists, or write `auto` or `all`"


def select(model: Model, text: str, option: str = "--select") -> tuple[str, ...]:
    """Parameter names for a `--select` text, in the machine file's order.

    A comma-separated list of names and patterns (`l*`); `auto`: all but those declared `identify: false`; `all`: every
    declared parameter, and numbers of effects as `auto`. `auto,R_low` adds to auto; a leading minus removes
    (`auto,-gamma`). One that is `fixed: true` is never chosen. A number of an effect that is `identify: false`
    is freed by its own name only; where some numbers of an effect are named, the others are left alone. Weights of a
    shape without a name go together: `unexplained@q1` frees them. Raises UsageError.
    """
    chosen: set[str] = set()
    matched: set[str] = set()  # by names and patterns
    for part in (p.strip() for p in text.split(",")):
        remove = part.startswith("-")
        pattern = part[1:] if remove else part
        if not remove:
            _refuse_exact(model, pattern, option)
        matching = _matching(model, pattern, remove)
        if matching is None:
            raise UsageError(
                f"{option}: the machine has no parameter `{pattern}`",
                hint=did_you_mean(pattern, [*model.names, *_WORDS], _EXAMPLE),
            )
        chosen = chosen - matching if remove else chosen | matching
        if not remove and pattern not in _WORDS:
            matched |= matching
    for effect in model.effects:
        of_effect = set(effect.parameters)
        if of_effect & matched:
            chosen -= of_effect - matched
    return tuple(n for n in model.names if n in chosen)


def _refuse_exact(model: Model, pattern: str, option: str) -> None:
    """Raise UsageError where a parameter has an exact value: it is declared so, or known of an effect."""
    if not any(p.fixed and pattern in (p.name, p.shared_name) for p in model.parameters):
        return
    place, _, number = pattern.rpartition(".")
    if any(pattern in e.parameters for e in model.effects):
        message = f"{option}: the value of `{pattern}` is exact"
        raise UsageError(
            message, hint=f"write `{number}: {{identify: true}}` at `{place}` in `effects:` to identify it"
        )
    message = f"{option}: `{pattern}` is declared `fixed: true`: its value is exact"
    raise UsageError(message, hint="delete `fixed: true` in the machine file to identify it")


def named(model: Model, text: str) -> frozenset[str]:
    """Parameters that a `--select` text names one by one: each must turn out determined."""
    return frozenset(p.strip() for p in text.split(",")) & frozenset(model.names)


def _matching(model: Model, pattern: str, remove: bool) -> set[str] | None:
    """Parameters that a word, a name or a pattern means; None where there is no such parameter."""
    held = {n for e in model.effects for n in e.parameters} & {p.name for p in model.parameters if not p.identify}
    free = [p for p in model.parameters if not p.fixed]
    if pattern in _WORDS:
        return {p.name for p in free if p.identify or (pattern == "all" and p.name not in held)}
    shapes = {e.name: set(e.parameters) for e in model.effects if e.effect.keyword == UNEXPLAINED}
    of_shapes = [
        members
        for name, members in shapes.items()
        if fnmatchcase(name, pattern.removesuffix(".*")) or members & {pattern}
    ]
    if "@" in pattern and of_shapes:
        return set().union(*of_shapes)
    by_name = {p.name for p in free if pattern in (p.name, p.shared_name)}
    by_pattern = {p.name for p in free if any(fnmatchcase(n, pattern) for n in (p.name, p.shared_name))}
    exact = [n for p in model.parameters if p.fixed for n in (p.name, p.shared_name)]
    if not by_name | by_pattern and not any(fnmatchcase(n, pattern) for n in exact):
        return None
    return by_name | (by_pattern if remove else by_pattern - held)
