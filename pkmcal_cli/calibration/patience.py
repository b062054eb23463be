"""When a fit is given up that leads nowhere soon, and when it is near enough to its end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

_CREEPING, _LITTLE = 3, 0.02  # steps, and the share of chi-square by which they must lower it where more is hoped for

@dataclass(frozen=True)
class Patience:
    """A fit above this chi-square is given up where it needs much damping, or once it has taken so many steps.

    So is one, where chi2 is finite, that leads where most rows are lost, or in other assemblies. Finite steps are for
    data in which a gross mistake shows: then rows that cannot be predicted are not looked for.
    hoped: a fit above this chi-square is given up where steps hardly lower it any more.
    enough: variances of the noise, as the fit leaves it; a step that promises less is the last one. 0: as near as
    rounding lets it come. retraces: whether steps that end where rows are in other assemblies are taken once more, each
    compared with these; else the fit has not converged.
    """

    chi2: float = np.inf
    steps: float = np.inf
    hoped: float = np.inf
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

    def ends(self, chi2: Sequence[float]) -> bool:
        """Whether steps that led from one chi-square to the next were enough."""
        crept = len(chi2) > _CREEPING and chi2[-1] > max(self.hoped, (1.0 - _LITTLE) * chi2[-1 - _CREEPING])
        return crept or (chi2[-1] > self.chi2 and len(chi2) > self.steps)

    def little(self, chi2: float, count: int) -> float:
        """What the last step of a fit of so many values may promise, where it has come to this chi-square."""
        return self.enough * chi2 / count if count else 0.0


EXACT = Patience()
SHORT = Patience(retraces=False)  # of fits that are no good where something is wrong by far, and so end soon
COMPARED = Patience(enough=1e-4)  # of fits that are compared with others: no evidence or error shows as little
