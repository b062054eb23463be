"""How much noise there is, by which statistics become p values."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import betaincinv, chdtri, fdtrc

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.diagnosis.score import Score, p_of_part

_CERTAIN = 0.01
_MANY = 1e9  # degrees of freedom of a sigma that is known


@dataclass(frozen=True)
class Scale:
    """Square of the factor on the stated sigma, and its degrees of freedom.

    checked: degrees of freedom of the estimate that the statement was compared with; `whole`: whether what effects do
    counts as noise in it; `rough`: whether what no smooth group explains does; `part`: whether statistics are
    parts of the sum of squares that it was estimated from.
    """

    variance: float = 1.0
    dof: float = _MANY
    checked: float = _MANY
    whole: bool = False
    part: bool = False
    rough: bool = False

    @property
    def doubted(self) -> bool:
        """Whether the stated sigma is too small beyond doubt (at 1 %)."""
        return self.dof < _MANY and self.variance > float(chdtri(self.dof, _CERTAIN)) / self.dof

    def p_value(self, statistic: Array, count: Array) -> Array:
        """Of statistics T with so many degrees of freedom each: chi-square, or F where sigma is estimated."""
        if self.part and self.dof < _MANY:
            return p_of_part(statistic, count, self.variance, self.dof)
        return np.asarray(fdtrc(count, self.dof, statistic / (self.variance * count)))

    def least_statistics(self, count: NDArray[np.intp], p: float) -> tuple[Array, Array]:
        """Statistics (P,) over the variance, from which on p values are below p, of so many numbers (P,) each: with
        the noise as it is stated, and as it is estimated; inf: never.
        """
        stated = chdtri(count, p)
        if self.checked >= _MANY:
            return stated, stated
        rest = self.checked - count if self.whole or self.rough else np.full(len(count), self.checked)
        left = betaincinv(0.5 * np.maximum(rest, 1), 0.5 * count, p)  # share of the sum that the statistic leaves
        estimated = (1.0 - left) * (self.checked if self.whole else rest / left)
        return stated, np.where(rest > 0, estimated, np.inf)

    def p_of(self, score: Score) -> float:
        """Of one score; 1 where nothing of it can be seen."""
        return float(self.p_value(np.array(score.statistic), np.array(score.count))) if score.count else 1.0
