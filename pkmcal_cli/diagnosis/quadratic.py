"""What grows with the square of an effect's size, in many drawn campaigns at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.rotation import Array


@dataclass(frozen=True)
class Quadratic:
    """By an effect's size: constant and linear (D,), by draws of noise, and square."""

    constant: Array
    linear: Array
    square: float

    @classmethod
    def of(cls, one: Array, other: Array) -> Quadratic:
        """Sums (D,) of products of two (m, D + 1), each its noise and, in the last column, an effect of unit size."""
        noise, effect = (one[:, :-1], other[:, :-1]), (one[:, -1:], other[:, -1:])
        linear = (noise[0] * effect[1] + effect[0] * noise[1]).sum(axis=0)
        return cls((noise[0] * noise[1]).sum(axis=0), linear, float((effect[0] * effect[1]).sum()))

    def at(self, size: float) -> Array:
        """Values (D,) at a size."""
        return np.asarray(self.constant + size * (self.linear + size * self.square))


@dataclass(frozen=True)
class Quadratics:
    """Sums of squares, each of some of m numbers: their noise (m, D), by an effect of unit size (m,), first of each."""

    noise: Array
    effect: Array
    starts: Array

    def at(self, size: float) -> Array:
        """Values (P, D) at a size."""
        if not len(self.starts):
            return np.zeros((0, self.noise.shape[1]))
        return np.add.reduceat((self.noise + size * self.effect[:, None]) ** 2, self.starts, axis=0)
