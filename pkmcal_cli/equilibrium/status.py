"""What became of each row: solved, or why not."""

from __future__ import annotations

from enum import IntEnum


class RowStatus(IntEnum):
    """Outcome of one row; anything but SOLVED yields no numbers."""

    SOLVED = 0
    NOT_CONVERGED = 1
    SINGULAR = 2
    OUT_OF_REACH = 3
    WRONG_MODE = 4
    SLACK = 5

    @property
    def reason(self) -> str:
        """The outcome in words."""
        return _REASONS[self]


_REASONS = {
    RowStatus.SOLVED: "solved",
    RowStatus.NOT_CONVERGED: "the equilibrium was not found (not converged)",
    RowStatus.SINGULAR: "singular position: the drives do not hold the platform there",
    RowStatus.OUT_OF_REACH: "out of reach: the mechanism does not close at these positions",
    RowStatus.WRONG_MODE: "wrong assembly mode: the drawing's assembly cannot be moved there "
    "without passing a singular position",
    RowStatus.SLACK: "slack rope",
}
