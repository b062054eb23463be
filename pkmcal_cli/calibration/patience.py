"""When a fit is given up that leads nowhere soon, and when it is near enough to its end."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Patience:
    """A fit above this chi-square is given up where it needs much damping, or once it has taken so many steps.

    So is one, where chi2 is finite, that leads where most rows are lost, or in other assemblies. Finite steps are for
    data in which a gross mistake shows: then rows that cannot be predicted are not looked for.
    enough: variances of the noise, as the fit leaves it; a step that promises less is the last one. 0: as near as
    rounding lets it come. retraces: whether steps that end where rows are in other assemblies are taken once more, each
    compared with these; else the fit has not converged.
    """

    chi2: float = np.inf
    steps: float = np.inf
    enough: float = 0.0
    retraces: bool = True

    @property
    def short(self) -> bool:
        """Whether only a fit that ends soon is worth its time."""
        return self.steps < np.inf

    @property
    def choosy(self) -> bool:
        """Whether a fit that leads nowhere is given up."""
        return self.chi2 < np.inf

    def ends(self, chi2: float, steps: int) -> bool:
        """Whether so many steps were enough, where they have led to this chi-square."""
        return chi2 > self.chi2 and steps >= self.steps

    def little(self, chi2: float, count: int) -> float:
        """What the last step of a fit of so many values may promise, where it has come to this chi-square."""
        return self.enough * chi2 / count if count else 0.0


EXACT = Patience()
SHORT = Patience(retraces=False)  # of fits that are no good where something is wrong by far, and so end soon
COMPARED = Patience(enough=1e-4)  # of fits that are compared with others: no evidence or error shows as little
