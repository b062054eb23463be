"""Residuals and Jacobian of a long table, as far as sums over its rows need them: upper triangles by QR.

[J r] = Q R with orthogonal Q, so |r - J d| = |R (-d, 1)| for every step d. A chunk is put below the R so far, and both
make the next R (Golub and Van Loan 2013, 5.2 and 6.5). Unlike sums of J^T J it loses no digits to the condition of J.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.problem import Problem


@dataclass
class Triangles:
    """Triangles R (k, p + 1) by instrument, of a problem: its whitened residuals are the last column; without priors.

    `channels`: of each instrument.
    """

    problem: Problem
    columns: int
    channels: dict[str, list[int]] = field(init=False)
    upper: dict[str, Array] = field(init=False)

    def __post_init__(self) -> None:
        self.channels = {}
        for k, channel in enumerate(self.problem.model.channels):
            self.channels.setdefault(channel.instrument, []).append(k)
        self.upper = {name: np.zeros((0, self.columns + 1)) for name in self.channels}

    def add(self, jacobian: Array, residual: Array) -> None:
        """Take in rows: whitened Jacobian (n, C, p) and residuals (n, C)."""
        table = np.concatenate([jacobian, residual[..., None]], axis=2)
        for name, channels in self.channels.items():
            below = table[:, channels].reshape(-1, self.columns + 1)
            self.upper[name] = np.asarray(np.linalg.qr(np.vstack([self.upper[name], below]), mode="r"))

    def holds(self, problem: Problem) -> bool:
        """Whether they are of this problem: the same cells, with the same weights."""
        triangulated = self.problem
        return (
            triangulated.measured is problem.measured
            and triangulated.readings is problem.readings
            and triangulated.sigma is problem.sigma
            and triangulated.weight is problem.weight
        )

    @property
    def rows(self) -> tuple[Array, Array]:
        """All triangles (n, p + 1), and a channel (n,) of the instrument that each row is of."""
        of = [np.full(len(self.upper[name]), channels[0]) for name, channels in self.channels.items()]
        return np.concatenate(list(self.upper.values())), np.concatenate(of).astype(np.intp)
