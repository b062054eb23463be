"""When a fit is given up that leads nowhere soon."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Patience:
    """A fit above this chi-square is given up where it needs much damping, or once it has taken so many steps.

    Finite steps are for data in which a gross mistake shows: then rows that cannot be predicted are not looked for.
    """

    chi2: float = np.inf
    steps: float = np.inf

    @property
    def short(self) -> bool:
        """Whether only a fit that ends soon is worth its time."""
        return self.steps < np.inf

    def ends(self, chi2: float, steps: int) -> bool:
        """Whether so many steps were enough, where they have led to this chi-square."""
        return chi2 > self.chi2 and steps >= self.steps
