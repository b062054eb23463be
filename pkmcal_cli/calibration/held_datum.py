"""Ranges of what a datum holds: errors of parameters relative to it, not of them alone (S-transformation, Baarda 1981).

True offsets x from nominal are independent, as ranges say, those of the datum's parameters too. What a fit finds is the
same machine moved until the datum's parameters d are where they are held: x - G G_d^-1 (x_d - v), G being the freedoms
of the base. So the errors of what moves along are those of the datum besides their own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.model.model import Model


@dataclass(frozen=True)
class HeldDatum:
    """Parameters `held` as datum, and by how much others, `names`, are off for each of them that truly is: moves
    (p, g), SI."""

    held: tuple[str, ...]
    names: tuple[str, ...]
    moves: Array

    def of(self, names: Sequence[str]) -> Array:
        """The same (p', g) of some parameters, 0 for those that do not move with the base."""
        place = {n: k for k, n in enumerate(self.names)}
        out = np.zeros((len(names), len(self.held)))
        for k, name in enumerate(names):
            if name in place:
                out[k] = self.moves[place[name]]
        return out

    def in_ranges(self, model: Model, names: Sequence[str], ranges: Array) -> Array:
        """The same in ranges (P,), of the parameters and of the datum."""
        of_names, of_datum = (ranges[[model.names.index(n) for n in some]] for some in (names, self.held))
        return self.of(names) * of_datum / of_names[:, None]

    def offsets(self, model: Model, values: Array) -> Array:
        """By how much the datum (g,) is held off nominal at parameter values (P,), SI."""
        return np.asarray((values - model.nominal)[[model.names.index(n) for n in self.held]])

    def nominal(self, model: Model, values: Array) -> Array:
        """Nominal values (P,) of the machine, moved until the datum is where it has these values (P,)."""
        return np.asarray(model.nominal - self.of(model.names) @ self.offsets(model, values))


def mixing(beside: Array) -> tuple[Array, Array]:
    """Root K (p, p) of the covariance 1 + B B^T of offsets in ranges beside those of a datum, B (p, g); its inverse."""
    vectors, size, _ = np.linalg.svd(beside, full_matrices=False)
    identity, more = np.eye(len(beside)), np.sqrt(1.0 + size**2) - 1.0
    return identity + (vectors * more) @ vectors.T, identity - (vectors * (more / (1.0 + more))) @ vectors.T
