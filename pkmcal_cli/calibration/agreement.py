"""Whether fits from several starts end in the same place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.budget import HELP
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.problem import Problem

SAME = 3.0
"""Standard uncertainties, each with what is held, within which ends are the same."""


@dataclass(frozen=True, kw_only=True)
class Agreement:
    """How many starts there were; how many ended in the best fit, in others as good, in worse ones, in none.

    spread: of those that agree, in standard uncertainties; untried: starts for which there was no time.
    """

    starts: int
    agree: int
    rivals: int
    worse: int
    failed: int
    spread: float
    untried: int = 0

    @property
    def text(self) -> str:
        """In words."""
        return self._ends + (f"; {self.untried} not tried after {HELP:g} s (`--starts N` does)" if self.untried else "")

    @property
    def _ends(self) -> str:
        if not self.agree:
            return f"starts: none of {self.starts} converges"
        parts = [f"starts: {self.agree} of {self.starts} reach the best fit (within {self.spread:.2g} std)"]
        if self.rivals:
            parts.append(f"{self.rivals} another fit that is equally good (the data cannot separate them)")
        parts += [f"{self.worse} a worse fit"] if self.worse else []
        parts += [f"{self.failed} no fit"] if self.failed else []
        return ", ".join(parts)


def apart(problem: Problem, one: Fit, best: Fit) -> float:
    """Largest difference of a parameter, in its standard uncertainty."""
    index = [problem.model.names.index(n) for n in best.selected]
    std = np.where(np.isfinite(best.std), best.std, np.inf)
    return float(np.abs((one.values - best.values)[index] / std).max(initial=0.0))


def agreement_of(problem: Problem, ends: Sequence[Fit | None], good: Sequence[Fit], best: Fit) -> Agreement:
    """Of ends of starts, those that are good, with the best."""
    distance = np.array([apart(problem, e, best) for e in good])
    same = distance <= SAME
    whole = np.array([e.failed.keys() == best.failed.keys() for e in good])
    as_good = whole & np.array([e.chi2 - best.chi2 <= SAME**2 * best.excess for e in good])
    agree, rivals = int(same.sum()), int((~same & as_good).sum())
    failed, spread = len(ends) - len(good), float(distance[same].max(initial=0.0))
    worse = len(good) - agree - rivals
    return Agreement(starts=len(ends), agree=agree, rivals=rivals, worse=worse, failed=failed, spread=spread)
