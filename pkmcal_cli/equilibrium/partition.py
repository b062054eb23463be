"""Fronts of a symmetric pattern: which unknowns are eliminated together, and which later ones they touch.

Legs do not touch one another but through the platform, so each can be eliminated by itself; a long chain falls apart
where any of its links is held. Both follow from the graph of the unknowns: in every round those of least degree that do
not touch each other leave together (multiple minimum degree: Liu 1985), and the unknowns that a front touches form a
clique among what is left. Small fronts go together with the one that follows: a call costs more than the arithmetic.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.mechanism.topology import Index

LEAST = 40  # unknowns and multipliers from which on fronts are looked for: below, one dense matrix is faster
_GAIN = 0.3  # share of the arithmetic of one dense matrix that fronts must not exceed to be worth their calls
_TOGETHER = 16  # unknowns up to which a front joins the next one
_LEAVING = 2  # degrees up to this times the least leave in one round


@dataclass(frozen=True)
class Front:
    """Unknowns (s) and multipliers (m) that are eliminated together, and the unknowns (r) left that they touch."""

    unknowns: Index
    multipliers: Index
    border: Index
    level: int  # 0: no other front comes before it

    @property
    def own(self) -> Index:
        """All that is eliminated: unknowns, then multipliers."""
        return np.concatenate([self.unknowns, self.multipliers])


def fronts_of(pattern: NDArray[np.bool_], unknowns: int) -> tuple[Front, ...]:
    """Divide a pattern (n + c, n + c) into fronts, in the order of elimination; none where one matrix is as fast."""
    if len(pattern) < LEAST:
        return ()
    touches = pattern[unknowns:, :unknowns]  # (c, n)
    among = pattern[:unknowns, :unknowns] | (touches.T.astype(np.float32) @ touches.astype(np.float32) > 0)
    tree = _Tree(_eliminated(among), touches)
    tree.merge()
    fronts = tree.fronts()
    work = sum(_work(len(front.own), len(front.border) + 1) for front in fronts)
    return fronts if work < _GAIN * _work(len(pattern), 1) else ()


def _work(size: int, right: int) -> float:
    """Arithmetic of the solution of a system of `size` unknowns for `right` right-hand sides."""
    return size**2 * (size / 3 + right)


def _eliminated(among: NDArray[np.bool_]) -> list[tuple[list[int], set[int]]]:
    """Unknowns that leave together and what they touch then, in the order in which they leave."""
    count = len(among)
    touching = [set(np.nonzero(row)[0].tolist()) - {k} for k, row in enumerate(among)]
    members = {k: [k] for k in range(count)}
    _join(members, touching, range(count))
    out = []
    while members:
        for k in _leaving(members, touching):
            border = touching[k]
            out.append((members.pop(k), {u for b in border for u in members[b]}))
            for b in border:
                touching[b] |= border
                touching[b] -= {k, b}
            _join(members, touching, sorted(border))
    return out


def _leaving(members: dict[int, list[int]], touching: list[set[int]]) -> list[int]:
    """Of what is left, those of least degree that do not touch each other."""
    degree = {k: sum(len(members[b]) for b in touching[k]) for k in members}
    limit = _LEAVING * min(degree.values())
    out: list[int] = []
    blocked: set[int] = set()
    for k in sorted(members, key=lambda k: (degree[k], k)):
        if degree[k] > limit:
            break
        if k not in blocked:
            out.append(k)
            blocked |= touching[k]
    return out


def _join(members: dict[int, list[int]], touching: list[set[int]], among: Iterable[int]) -> None:
    """Make one of those that touch the same and each other."""
    first: dict[frozenset[int], int] = {}
    alike = [(k, first.setdefault(frozenset(touching[k] | {k}), k)) for k in among]
    for k, kept in alike:
        if k != kept:
            members[kept] += members.pop(k)
            for b in touching[k]:
                touching[b].discard(k)


class _Tree:
    """Fronts under construction: each hands on to the one in which the first of its border leaves."""

    def __init__(self, eliminated: list[tuple[list[int], set[int]]], touches: NDArray[np.bool_]) -> None:
        self.own = [own for own, _ in eliminated]
        self.border = [border for _, border in eliminated]
        self.of = {u: k for k, own in enumerate(self.own) for u in own}
        self.held: list[list[int]] = [[] for _ in eliminated]
        for c, row in enumerate(touches):
            self.held[min((self.of[int(u)] for u in np.nonzero(row)[0]), default=len(self.own) - 1)].append(c)
        self.left = set(range(len(self.own)))

    def parent(self, k: int) -> int | None:
        """The front that follows."""
        return min((self.of[u] for u in self.border[k]), default=None)

    def merge(self) -> None:
        """Join fronts with more multipliers than unknowns, and small ones, to those that follow."""
        for k in sorted(self.left):
            parent = self.parent(k)
            if parent is not None and len(self.held[k]) > len(self.own[k]):
                self._join_to(parent, [k])
        for k in sorted(self.left):
            children = [child for child in sorted(self.left) if self.parent(child) == k]
            if children and sum(map(self.size, children)) + self.size(k) <= _TOGETHER:
                self._join_to(k, children)

    def size(self, k: int) -> int:
        """Unknowns and multipliers of a front."""
        return len(self.own[k]) + len(self.held[k])

    def _join_to(self, k: int, children: list[int]) -> None:
        for child in children:
            self.left.remove(child)
            self.of.update(dict.fromkeys(self.own[child], k))
            self.own[k] = self.own[child] + self.own[k]
            self.held[k] = self.held[child] + self.held[k]

    def fronts(self) -> tuple[Front, ...]:
        """The fronts by level."""
        level = dict.fromkeys(self.left, 0)
        for k in sorted(self.left):
            parent = self.parent(k)
            if parent is not None:
                level[parent] = max(level[parent], level[k] + 1)
        unknowns, out = len(self.of), []
        for k in sorted(self.left, key=lambda k: (level[k], k)):
            own, held = (np.array(sorted(x), dtype=np.intp) for x in (self.own[k], self.held[k]))
            border = np.array(sorted(self.border[k]), dtype=np.intp)
            out.append(Front(own, held + unknowns, border, level[k]))
        return tuple(out)
