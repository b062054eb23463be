"""Words in messages."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence

_MARK = "`"


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


def gathered(texts: Iterable[tuple[Hashable, str]]) -> list[tuple[int, str]]:
    """Texts, each with what it must share with others; those that differ in one name (in backticks) are made one.

    So entries that one line of a file stands for (`each`) are told once. Returns the place of the first of each, in
    order, and its text, with the names of the others: "... `a` (also `b`, `c`)".
    """
    groups: list[list[tuple[int, list[str]]]] = []
    known: dict[Hashable, list[list[tuple[int, list[str]]]]] = {}
    for k, (shared, text) in enumerate(texts):
        parts = text.split(_MARK)
        alike = known.setdefault((shared, *parts[::2]), [])
        for group in alike:
            if len(_different([*(each for _, each in group), parts])) == 1:
                group.append((k, parts))
                break
        else:
            groups.append([(k, parts)])
            alike.append(groups[-1])
    return [(group[0][0], _one([parts for _, parts in group])) for group in groups]


def _different(texts: list[list[str]]) -> list[int]:
    """Which parts of texts differ."""
    return [k for k, parts in enumerate(zip(*texts, strict=True)) if len(set(parts)) > 1]


def _one(texts: list[list[str]]) -> str:
    """The first text, with the names of the others."""
    first = _MARK.join(texts[0])
    others = [f"{_MARK}{text[k]}{_MARK}" for k in _different(texts) for text in texts[1:]]
    return f"{first} (also {listed(others, 9)})" if others else first
