"""An explanation of a table that is grossly off."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal_cli.gross_errors.plausibility import BETTER, Hint


@dataclass(frozen=True)
class Reason:
    """An explanation: its hints, and the relative misfit before and after they are followed."""

    hints: tuple[Hint, ...]
    before: float
    after: float

    @property
    def complete(self) -> bool:
        """Whether it has something to say, and that explains all there is to explain."""
        return bool(self.hints) and bool(np.isfinite(self.after)) and self.after <= BETTER * self.before
