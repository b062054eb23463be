"""Each row has a status: solved, or why not.

Solved is a row whose force balance g(u) = 0 holds, whose tangent dg/du is positive definite on the freedoms (a stable
equilibrium: Lagrange and Dirichlet's theorem) and whose assembly is the machine's; each other status says what fails.
"""

from __future__ import annotations

from typing import Final


class RowStatus:
    """Outcome of one row; anything but SOLVED yields no numbers.

    Plain integers: numpy asks a member of an enumeration for attributes that it lacks, and drops what that raises, a
    KeyboardInterrupt too.
    """

    SOLVED: Final = 0
    NOT_CONVERGED: Final = 1
    SINGULAR: Final = 2
    OUT_OF_REACH: Final = 3
    WRONG_MODE: Final = 4
    UNSTABLE: Final = 5
    AMBIGUOUS: Final = 6


def reason_of(status: int) -> str:
    """An outcome in words."""
    return _REASONS[status]


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
