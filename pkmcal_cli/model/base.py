"""What is fixed to the base: its places as sums of vectors that coefficients state, and the rotations of its frames."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array, exp, left_jacobian, skew
from pkmcal_cli.mechanism.coefficients import CoefficientTable

Index = NDArray[np.intp]
NONE: Index = np.zeros((0, 3), dtype=np.intp)


@dataclass(frozen=True)
class PlaceVector:
    """A vector axes (3, k) @ c[coefficients (k,)], in axes that rotations turn, the outermost first.

    A rotation is a rotation vector c[(3,)] after the orientation (3, 3) of the reference configuration.
    """

    coefficients: Index
    axes: Array
    rotations: tuple[tuple[Index, Array], ...] = ()

    def moved(self, coefficients: Array, chain: Array) -> tuple[Array, Array]:
        """The vector (3,) in base axes, m, and its derivative (3, p); chain (S, p): that of the coefficients (S,)."""
        value, change = self.axes @ coefficients[self.coefficients], self.axes @ chain[self.coefficients]
        for where, reference in reversed(self.rotations):
            theta = coefficients[where]
            turned = exp(theta) @ reference
            value = turned @ value
            change = turned @ change - skew(value) @ left_jacobian(theta) @ chain[where]
        return value, change


@dataclass(frozen=True, kw_only=True)
class Base:
    """Its places, each a sum of vectors, and coefficients of its frames' rotations (F, 3).

    only_seen_by (B,), rotations_only_seen_by (F,): sensors without which nothing depends on it; () if something stands
    on it.
    """

    places: tuple[tuple[PlaceVector, ...], ...] = ()
    rotations: Index = field(default_factory=NONE.copy)
    only_seen_by: tuple[tuple[str, ...], ...] = ()
    rotations_only_seen_by: tuple[tuple[str, ...], ...] = ()

    def felt(self, sensors: Collection[str]) -> Base:
        """What of it something stands on, or one of some sensors looks at."""
        places = [not by or not set(by).isdisjoint(sensors) for by in self.only_seen_by]
        rotating = [not by or not set(by).isdisjoint(sensors) for by in self.rotations_only_seen_by]
        kept = tuple(pulls for pulls, is_felt in zip(self.places, places, strict=True) if is_felt)
        return Base(places=kept, rotations=self.rotations[rotating])

    def targets(self, coefficients: CoefficientTable) -> frozenset[str]:
        """Parameters that place only what sensors look at, and nothing else stands on."""
        looked_at = zip(self.places, self.only_seen_by, strict=True)
        seen = {int(c) for vectors, by in looked_at if by for v in vectors for c in v.coefficients}
        placing, others = set[str](), set[str]()
        for index, formula in coefficients.formulas:
            (placing if index in seen else others).update(formula.names)
        return frozenset(placing - others)

    def positions(self, coefficients: Array) -> Array:
        """The places (B, 3) in base axes, m."""
        nothing = np.zeros((len(coefficients), 0))
        return np.array([sum(v.moved(coefficients, nothing)[0] for v in pulls) for pulls in self.places])

    def motion(self, coefficients: Array, chain: Array) -> Array:
        """Displacement (3 B + 3 F, p) of the places, then of the orientations of the frames; chain (S, p)."""
        rows = [sum(v.moved(coefficients, chain)[1] for v in pulls) for pulls in self.places]
        rows += [left_jacobian(coefficients[where]) @ chain[where] for where in self.rotations]
        return np.vstack(rows)
