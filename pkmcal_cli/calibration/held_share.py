"""What of the residuals parameters explain that are not identified, if they are off nominal as their ranges allow.

An offset h of such a parameter leaves (H - J T H) h in the residuals, where the fit follows it by T H h. Whitened
residuals r are then no noise of covariance 1, but of 1 + A V A^T with A = H - J T H and variances V of the offsets; and
r^T (1 + A V A^T)^-1 r is the least of |r - A h|^2 + h^T V^-1 h: chi-square, where nothing else is wrong.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.range_scales import Evidence

_REST = 0.1  # share of the chi-square that held parameters explain which those that are named may leave
_NAMED = 4
_BEYOND = 1e-3  # chance of offsets so large if ranges are right


@dataclass(frozen=True)
class HeldShare:
    """Whitened residuals of G instruments and what offsets of h held parameters, in their standard deviations, leave.

    squares (G,): of the residuals; information (G, h, h): A^T A; score (G, h): A^T r.
    """

    names: tuple[str, ...]
    squares: Array
    information: Array
    score: Array

    @cached_property
    def within(self) -> bool:
        """Whether offsets need not be larger than ranges allow, in the directions that they move more than noise does.

        Among all equations together, few directions in which they are far too large would not show.
        """
        size, vectors = np.linalg.eigh(self.information.sum(axis=0))
        seen = size > 1.0
        along = (vectors.T @ self.score.sum(axis=0))[seen] ** 2 / (size[seen] * (1.0 + size[seen]))
        return bool(chdtrc(max(len(along), 1), along.sum()) >= _BEYOND)

    @property
    def left(self) -> Array:
        """Squares (G,) of the residuals of each instrument that no offsets within ranges explain."""
        if not self.within:
            return self.squares
        parts = zip(self.squares, self.information, self.score, strict=True)
        return np.array([square - _explained(a, b) for square, a, b in parts])

    def left_of_all(self) -> float:
        """The same of all instruments together, for which offsets are the same."""
        return float(self.squares.sum()) - (self._by(range(len(self.names))) if self.within else 0.0)

    def named(self) -> tuple[str, ...]:
        """The few parameters that explain most of what all of them explain, one after the other; () for none."""
        whole, chosen = self._by(range(len(self.names))), list[int]()
        while whole > 0 and len(chosen) < min(_NAMED, len(self.names)):
            others = [k for k in range(len(self.names)) if k not in chosen]
            chosen.append(max(others, key=lambda k: self._by([*chosen, k])))
            if self._by(chosen) >= (1.0 - _REST) * whole:
                break
        return tuple(self.names[k] for k in chosen)

    def _by(self, some: range | list[int]) -> float:
        """What some of the parameters explain of all residuals."""
        index: NDArray[np.intp] = np.array(some, dtype=np.intp)
        return _explained(self.information.sum(axis=0)[np.ix_(index, index)], self.score.sum(axis=0)[index])


def _explained(information: Array, score: Array) -> float:
    """By how much offsets with a prior of variance 1 lower chi-square."""
    return float(score @ np.linalg.solve(np.eye(len(score)) + information, score))


def held_share(names: tuple[str, ...], said: Evidence, gain: Array) -> HeldShare:
    """Of h held parameters `names`, by what instruments say of p identified ones and, after them, of these.

    gain (p, p): of the fit, by which J^T y gives its estimate, in half ranges. Ranges are those that are stated: what
    the model lacks throws identified parameters off, and would widen those of the held ones, which then explain it.
    """
    p = len(gain)
    follow = -gain @ said.information.sum(axis=0)[:p, p:]  # (p, h)
    way = np.vstack([follow, np.eye(len(names))])  # (q, h): of all parameters with a held one
    return HeldShare(names, said.squares, way.T @ said.information @ way, said.score @ way)
