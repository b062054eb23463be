"""Words in messages."""

from __future__ import annotations


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
