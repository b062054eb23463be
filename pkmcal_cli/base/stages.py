"""Where a long work has come to, told to whoever watches: the work itself prints nothing and does not depend on it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace


@dataclass(frozen=True)
class Stage:
    """A step of a long work: how much of it is done, of how much; `total` is None where nobody can know.

    inside: the larger step that it is a part of.
    """

    name: str
    done: int = 0
    total: int | None = None
    inside: Stage | None = None

    @property
    def whole(self) -> tuple[Stage, ...]:
        """It and what it is a part of, the largest step first."""
        return (*(() if self.inside is None else self.inside.whole), self)


Observer = Callable[[Stage], None]


def unobserved(stage: Stage) -> None:
    """Nobody watches."""


def within(observe: Observer, larger: Stage) -> Observer:
    """Tells the steps that a larger one consists of."""

    def observe_inner(stage: Stage) -> None:
        first, *inner = stage.whole
        out = replace(first, inside=larger)
        for part in inner:
            out = replace(part, inside=out)
        observe(out)

    return observe_inner
