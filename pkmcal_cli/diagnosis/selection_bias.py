"""Sizes of what was found are too large at the limit, where it was found because noise made it larger.

An effect is told with a chance that depends on the size z at which it appears, in standard uncertainties; so sizes of
what is told follow a normal distribution times that chance. Median and 95 % interval by this distribution are right
whatever the true size is (Weinstein, Fithian and Benjamini 2013); of an effect with several numbers, nearly so.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.rotation import Array

_HALVINGS = 40
_BEYOND = 6.0  # standard uncertainties, that a size is off by at most
_STEP = 0.02
_MATTERS = 0.05  # standard uncertainties by which sizes differ, from which on it is told
LARGEST = 15.0  # standard uncertainties, beyond which being found makes nothing larger
_RARE = 0.02  # chance of being told below which nothing can be said of what was


@dataclass(frozen=True)
class SelectedSize:
    """A size corrected for selection and its 95 % interval, as multiples of the estimate."""

    factor: float
    low: float
    high: float

    def widened(self, share: float) -> SelectedSize:
        """The same where the standard uncertainty is so many times as large as that by which effects are selected."""
        more = max(share, 1.0)
        low, high = (self.factor + more * (x - self.factor) for x in (self.low, self.high))
        return SelectedSize(self.factor, max(low, 0.0), high)


@dataclass(frozen=True)
class Acceptance:
    """Chance (n,) that an effect is told that appears at sizes (n,), ascending, in standard uncertainties."""

    sizes: Array
    chance: Array

    def at(self, sizes: Array) -> Array:
        """The chance at sizes of any sign."""
        return np.interp(np.abs(sizes), self.sizes, self.chance)

    def corrected(self, size: float) -> SelectedSize | None:
        """Of an estimate, in standard uncertainties; None where it does not matter, or nothing can be said."""
        if size > LARGEST or float(self.at(np.array(size))) < _RARE:
            return None
        middle, low, high = (self._true_size(size, share) for share in (0.5, 0.025, 0.975))
        return None if size - middle < _MATTERS else SelectedSize(middle / size, low / size, high / size)

    def _true_size(self, size: float, share: float) -> float:
        """The true size of which a share of those told would be larger than this one; 0 where it is more of any."""
        low, high = 0.0, size + _BEYOND
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self._beyond(size, middle) < share else (low, middle)
        return low

    def _beyond(self, size: float, true: float) -> float:
        """Share of what is told of an effect of this true size that is larger."""
        z = np.arange(-true - _BEYOND, true + 2 * _BEYOND, _STEP)
        density = self.at(z) * np.exp(-0.5 * (z - true) ** 2)
        return float(density[np.abs(z) > size].sum() / max(float(density.sum()), 1e-300))
