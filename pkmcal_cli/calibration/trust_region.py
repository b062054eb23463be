"""How far a step of a fit may go: anywhere, until a far one keeps little of its promise; then within a trust region.

Its shape follows the iterate (Moré 1978): steps are measured by how far each parameter alone moves the readings, in
standard uncertainties, where it moved them most so far. So a parameter that the readings hardly feel where a step would
lead, but did before, does not run away.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.linalg import solve_triangular

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.second_order import SecondOrder

_FIRST = 3.0  # ranges of all parameters, to which a step is confined that is taken back
_POOR, _HALF, _GOOD = 0.25, 0.5, 0.75  # of the gain in chi-square that the linear problem promises
_LATE = 0.01  # of chi-square: what a step promises near the end of a fit
_NARROWER, _WIDER = 0.25, 2.0
_TIGHT = 0.01  # share of the radius by which a confined step may be shorter
_STUCK, _CREEP = 1e4, 0.01  # damping and share of chi-square: a step that needs as much for as little creeps
_FARTHEST = 1e-16  # of the largest squared singular value: the least damping that is looked at


@dataclass(frozen=True)
class Region:
    """Radius, and what a range of each parameter (p,) moves the readings, both in standard uncertainties.

    damping: weight that holds the drives' errors where they are, and in a small share the parameters; bent: what second
    derivatives add, once a step has kept little; creeping: steps in turn that were much damped and gained little.
    """

    size: Array | float = 0.0
    radius: float = np.inf
    damping: float = 0.0
    bent: SecondOrder = field(default_factory=SecondOrder)
    creeping: int = 0

    def at(self, jacobian: Array, residual: Array) -> Region:
        """Where readings, whitened, have these derivatives (m, p) by parameters in ranges, and residuals (m,)."""
        size = np.maximum(self.size, np.linalg.norm(jacobian, axis=0))
        return replace(self, size=size, bent=self.bent.at(jacobian, residual))

    def remembering(
        self, step: Array, before: tuple[Array, Array], gained: float, linear: float, shown: float
    ) -> Region:
        """With what the next place tells of second derivatives, once they matter: after a step (p,) from whitened
        derivatives and residuals `before`, and the gain that they promised. Less than `shown` shows nothing; far from
        the end, where signs of forces still change, a step that kept little tells of no curvature."""
        matters = gained < _HALF * linear and linear < _LATE * float(before[1] @ before[1])
        if linear <= shown or not (matters or self.bent.matrix is not None):
            return self
        return replace(self, bent=self.bent.after(step, *before, gained, linear))

    def length(self, step: Array) -> float:
        """Of a step (p,) in ranges."""
        return float(np.linalg.norm(self.size * step))

    def holds(self, step: Array) -> bool:
        """Whether a step (p,) may be taken whole."""
        return self.damping == 0.0 and self.length(step) <= self.radius

    def doubts(self, step: Array, kept: float) -> bool:
        """Whether to take back a step (p,) that kept this share of its promise: the first far one that kept little."""
        free = self.radius == np.inf and not self.damping
        return free and kept < _GOOD and self.length(step) > self._first

    def narrowed(self) -> Region:
        """After a step that was taken back."""
        return replace(self, radius=self._first)

    @property
    def _first(self) -> float:
        return _FIRST * float(np.linalg.norm(self.size))

    def refused(self, step: Array) -> Region:
        """After a step (p,) that leads nowhere. Without a radius, damping alone shortens steps: a machine cannot be
        predicted everywhere, and where it can be again may be far."""
        narrower = np.inf if self.radius == np.inf else _NARROWER * self.length(step)
        return replace(self, radius=narrower, damping=max(10.0 * self.damping, 1.0))

    def taken(self, step: Array, kept: float, share: float) -> Region:
        """After a step (p,) that kept this share of what it promised, and gained this share of chi-square."""
        radius, length = self.radius, self.length(step)
        if kept > _GOOD:
            radius = max(radius, _WIDER * length)
        elif kept < _POOR:
            radius = 0.5 * length
        eased = (0.1 if kept > _HALF else 1.0) * self.damping
        creeping = self.creeping + 1 if self.damping > _STUCK and share < _CREEP else 0
        return replace(self, radius=radius, damping=eased if eased >= 1.0 else 0.0, creeping=creeping)


def confined(matrix: Array, right: Array, size: Array, radius: float) -> Array:
    """Minimum (k,) of |matrix z - right| where |size z| is at most the radius; size (p, k) has independent columns."""
    from scipy.optimize import brentq  # dear to import, and few fits are ever confined

    upper = np.linalg.qr(size, mode="r")
    u, s, vt = np.linalg.svd(solve_triangular(upper, matrix.T, trans="T").T, full_matrices=False)
    along = u.T @ right

    def beyond(exponent: float) -> float:
        return float(np.linalg.norm(s * along / (s**2 + 10.0**exponent))) - (1.0 - 0.5 * _TIGHT) * radius

    low = np.log10(_FARTHEST * s[0] ** 2)
    high = np.log10(s[0] * np.linalg.norm(along) / radius) + _TIGHT  # where it is shorter for certain
    exponent = low if beyond(low) <= 0.0 else brentq(beyond, low, max(high, low), xtol=0.1 * _TIGHT)
    return np.asarray(solve_triangular(upper, vt.T @ (s * along / (s**2 + 10.0**exponent))))
