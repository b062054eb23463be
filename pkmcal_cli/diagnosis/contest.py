"""All hypotheses that may explain an effect of one of them: sums of squares of their scores, with drawn noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.diagnosis.drawn_noise import DrawnNoise
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.quadratic import Quadratics
from pkmcal_cli.diagnosis.score import PLAUSIBLE, Score
from pkmcal_cli.diagnosis.trial import Contest

_ALIKE = 0.5  # share of an effect's statistic that another hypothesis must explain to be taken for it


@dataclass(frozen=True, kw_only=True)
class Contestants:
    """Parts of hypotheses in which something can be seen, the parts of one hypothesis side by side.

    whitened (Q, m): from products with columns to numbers of unit variance, `starts` of each part; noise (m, D).
    """

    hypotheses: tuple[Hypothesis, ...]
    parts: tuple[tuple[Hypothesis, ...], ...]  # of each hypothesis
    scores: Mapping[Hypothesis, Score]
    whitened: Array
    starts: NDArray[np.intp]
    noise: Array

    @classmethod
    def of(
        cls, hypotheses: Sequence[Hypothesis], scores: Mapping[Hypothesis, Score], drawn: DrawnNoise
    ) -> Contestants:
        """Of hypotheses, with scores of their parts."""
        parts = tuple(tuple(part for part in h.nested_parts if scores[part].count) for h in hypotheses)
        every = [part for some in parts for part in some]
        counts = [scores[part].count for part in every]
        starts = np.cumsum([0, *counts], dtype=np.intp)
        whitened = np.zeros((len(drawn.gradient), int(starts[-1])))
        for part, first, end in zip(every, starts[:-1], starts[1:], strict=True):
            score = scores[part]
            whitened[drawn.places[part], first:end] = score.basis / np.sqrt(score.information)
        return cls(
            hypotheses=tuple(hypotheses),
            parts=parts,
            scores=scores,
            whitened=whitened,
            starts=starts,
            noise=whitened.T @ drawn.gradient,
        )

    def parts_of(self, hypothesis: Hypothesis) -> tuple[Hypothesis, ...]:
        """Its parts in which something can be seen."""
        return self.parts[self.hypotheses.index(hypothesis)]

    def against(self, hypothesis: Hypothesis, effect: Array, direction: Array) -> Contest:
        """An effect of one of them, of which `effect` (Q,) are products with columns, and those that explain it."""
        shift = self.whitened.T @ effect
        first = self.hypotheses.index(hypothesis)
        ends = np.cumsum([0, *map(len, self.parts)])
        squares = np.add.reduceat(np.append(shift**2, 0.0), self.starts)[:-1]
        least = _ALIKE * squares[ends[first] : ends[first + 1]].max(initial=0.0)
        near = [k for k in range(len(self.parts)) if (squares[ends[k] : ends[k + 1]] > least).any() and k != first]
        chosen = [first, *near]
        numbers = [np.arange(ends[k], ends[k + 1]) for k in chosen]
        every = np.concatenate(numbers)
        inside = [np.arange(self.starts[j], self.starts[j + 1]) for j in every]
        at = np.concatenate(inside)
        counts = np.array([len(x) for x in inside], dtype=np.intp)
        return Contest(
            squares=Quadratics(self.noise[at], shift[at], np.cumsum([0, *counts[:-1]], dtype=np.intp)),
            count=counts,
            hypothesis=np.repeat(np.arange(len(chosen)), [len(n) for n in numbers]),
            far=np.array([self._far(part, shift[x]) for part, x in zip(self._named(chosen), inside, strict=True)]),
            preference=np.repeat(
                [self.hypotheses[k].preference - np.log(len(self.parts[k])) for k in chosen], [len(n) for n in numbers]
            ),
            groups=[self._within(k, chosen) for k in chosen],
        )

    def _named(self, chosen: Sequence[int]) -> list[Hypothesis]:
        return [part for k in chosen for part in self.parts[k]]

    def _far(self, part: Hypothesis, shift: Array) -> float:
        """Largest number, in ranges, at which a hypothesis stands that is seen far beyond its range only; else 0."""
        score = self.scores[part]
        if not score.far:
            return 0.0
        return float(np.abs(score.basis @ (shift / np.sqrt(score.information))).max()) / PLAUSIBLE

    def _within(self, k: int, chosen: Sequence[int]) -> NDArray[np.intp]:
        """Places among those chosen of the same effect at fewer places than group k."""
        group = self.hypotheses[k]
        if not group.members or k == chosen[0]:
            return np.zeros(0, dtype=np.intp)
        others = [self.hypotheses[j] for j in chosen]
        smaller = [len(h.members) < len(group.members) and h.akin(group) for h in others]
        return np.flatnonzero(smaller)
