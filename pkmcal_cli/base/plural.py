"""Words in messages."""

from __future__ import annotations

from collections.abc import Sequence


def with_article(noun: str) -> str:
    """A body, an actuator."""
    return f"{'an' if noun[:1].lower() in tuple('aeiou') else 'a'} {noun}"


def count(n: int, word: str) -> str:
    """1 body, 2 bodies, 1 self-stress, 3 self-stresses."""
    if n == 1:
        return f"1 {word}"
    if word.endswith("y"):
        return f"{n} {word.removesuffix('y')}ies"
    return f"{n} {word}{'es' if word.endswith('ss') else 's'}"


def listed(names: Sequence[str], most: int = 20) -> str:
    """Names with commas; of many the first ones, and how many more there are."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more
