"""Each row has a status: solved, or why not.

Solved is a row whose force balance g(u) = 0 holds, whose tangent dg/du is positive definite on the freedoms (a stable
equilibrium: Lagrange and Dirichlet's theorem) and whose assembly is the machine's; each other status says what fails.
"""

from __future__ import annotations

from enum import IntEnum


class RowStatus(IntEnum):
    """Outcome of one row; anything but SOLVED yields no numbers."""

    SOLVED = 0
    NOT_CONVERGED = 1
    SINGULAR = 2
    OUT_OF_REACH = 3
    WRONG_MODE = 4
    UNSTABLE = 5
    AMBIGUOUS = 6

    @property
    def reason(self) -> str:
        """The outcome in words."""
        return _REASONS[self]


_REASONS = {
    RowStatus.SOLVED: "solved",
    RowStatus.NOT_CONVERGED: "no equilibrium found (not converged)",
    RowStatus.SINGULAR: "singular pose: the actuators do not constrain the platform",
    RowStatus.OUT_OF_REACH: "out of reach: the mechanism cannot be assembled at these actuator positions",
    RowStatus.WRONG_MODE: "wrong assembly mode: the reference configuration cannot move there "
    "without passing a singular pose",
    RowStatus.UNSTABLE: "unstable equilibrium: the platform would not stay there",
    RowStatus.AMBIGUOUS: "two assemblies fit: the actuator positions agree equally well with two poses",
}
