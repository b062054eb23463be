"""What every element is: generalised strains of the relative position and the two triads of its ends.

The discrete-deformation form of finite elements for mechanisms (Besseling; van der Werff; Jonker and Meijaard).
An element joins two connection points i and j. Its strains depend on `delta`, the vector from point i to
point j (m, base axes), and on the triads `ti`, `tj` of the connection points (columns: carried unit axes,
base axes). They vanish in the unstressed state and under every rigid motion. Inputs of the gradient are [delta (3),
theta_i (3), theta_j (3)], the rotations being increments from the left in base axes; an element that ignores the
triads has the first three only. One whose natural length L follows travels (a span of a beam on which a carriage runs)
has L as its tenth.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array

DELTA, THETA_I, THETA_J, ENDS = slice(0, 3), slice(3, 6), slice(6, 9), slice(0, 9)
NATURAL_LENGTH = 9


class LinkGeometry(NamedTuple):
    """What an element sees of its links: `delta` (N, E, 3), triads `ti`, `tj` (N, E, 3, 3), sizes (N or 1, E, p)."""

    delta: Array
    ti: Array
    tj: Array
    sizes: Array


@dataclass(frozen=True)
class Element(ABC):
    """One kind of element; instances differ only in which of its strains they use."""

    uses_triads: ClassVar[bool] = True
    curved: ClassVar[bool] = True  # the strains have second derivatives
    per_length: ClassVar[bool] = False  # stiffness numbers are divided by the first rest value, a natural length
    slides: ClassVar[bool] = False  # travels add to that natural length
    sizes: ClassVar[tuple[str, ...]] = ()  # the p numbers that shape a link besides its vector: radii of pulleys

    @property
    def load_power(self) -> int:
        """Power of the natural length by which the prestress is multiplied."""
        return 0

    @cached_property
    @abstractmethod
    def strains(self) -> tuple[str, ...]:
        """Names of the m strains."""

    @cached_property
    def patterns(self) -> Array:
        """Constant matrices (P, m, m): the stiffness is the sum of P stiffness numbers times these."""
        m = len(self.strains)
        return np.eye(m)[:, :, None] * np.eye(m)[:, None, :]

    @cached_property
    def energy_terms(self) -> tuple[tuple[int, int, int, float], ...]:
        """Energies 1/2 e^T pattern e per unit of number p of the stiffness: sums of terms (p, k, l, factor)."""
        places = zip(*np.nonzero(np.triu(self.patterns)), strict=True)
        return tuple((p, k, l, float(self.patterns[p, k, l]) * (0.5 if k == l else 1.0)) for p, k, l in places)

    @property
    def inputs(self) -> int:
        """Length of the gradient's input: 3 (delta), 9 (delta, theta_i, theta_j) or 10 (natural length)."""
        return 10 if self.slides else 9 if self.uses_triads else 3

    @property
    def lengths(self) -> NDArray[np.bool_]:
        """Which strains (m,) are lengths, not angles."""
        return np.array([name in ("elongation", "length", "x", "y", "z") for name in self.strains])

    @property
    def gaps(self) -> NDArray[np.bool_]:
        """Which strains (m,) are distances between parts that belong together; angles and free springs are none."""
        return self.lengths

    @abstractmethod
    def evaluate(self, link: LinkGeometry, rest: Array) -> tuple[Array, Array]:
        """Strains (N, E, m) and their gradient (N, E, m, inputs).

        rest (N or 1, E, m): natural length, commanded travel, ... Strains in m and rad. Must accept complex arrays
        (derivatives by complex step).
        """

    @property
    def turns_over(self) -> bool:
        """Whether some strains vanish too where an end is turned over."""
        return type(self).upright is not Element.upright

    def upright(self, link: LinkGeometry) -> Array | None:
        """Cosines (N, E, k) that are below 0 where an end is turned over, which strains do not tell; None without."""
        return None

    def by_sizes(self, link: LinkGeometry) -> Array:
        """Derivative of the strains with respect to the sizes, (N, E, m, p)."""
        return np.zeros((*link.delta.shape[:-1], len(self.strains), 0))

    def curvature(self, link: LinkGeometry, stress: Array) -> Array:
        """Second derivative of the strains contracted with `stress` (N, E, m): (N, E, inputs, inputs).

        The derivative of gradient^T stress with respect to the inputs; the rotational part is that of the moment,
        hence not symmetric away from equilibrium.
        """
        shape, kind = (*link.delta.shape[:-1], self.inputs, self.inputs), np.result_type(*link[:3], stress)
        out: Array = np.zeros(shape, dtype=kind, order="F")
        self.add_curvature(out, link, stress)
        return out

    @abstractmethod
    def add_curvature(self, out: Array, link: LinkGeometry, stress: Array) -> None:
        """Add the curvature to `out` (N, E, inputs, inputs)."""


def outer(a: Array, b: Array) -> Array:
    """Compute dyads a b^T, (..., 3, 3)."""
    return np.asarray(a[..., :, None] * b[..., None, :])


def rotated(a: Array, h: Array) -> Array:
    """Differentiate the moment a x h by a rotation that carries a: a h^T - (a . h) I."""
    out = outer(a, h)
    trace = out[..., 0, 0] + out[..., 1, 1] + out[..., 2, 2]
    for k in range(3):
        out[..., k, k] -= trace
    return out


def add_scaled_identity(out: Array, factor: Array) -> None:
    """Add factor (N, E) times the identity to `out` (N, E, 3, 3)."""
    for k in range(3):
        out[..., k, k] += factor


def transpose(a: Array) -> Array:
    """Transpose the matrices of the last two axes, as a view."""
    return np.swapaxes(a, -1, -2)


def add_product(out: Array, a: Array, b: Array, stress: Array) -> None:
    """Add `stress` (N, E) times the second derivative of a . b, a carried by point i and b by point j."""
    add_moments(out, rotated(stress[..., None] * a, b))


def add_moments(out: Array, on_i: Array) -> None:
    """Add the derivatives of opposite moments of products of carried axes; `on_i`: of that on i by theta_i."""
    on_j = transpose(on_i)
    out[..., THETA_I, THETA_I] += on_i
    out[..., THETA_I, THETA_J] -= on_j
    out[..., THETA_J, THETA_J] += on_j
    out[..., THETA_J, THETA_I] -= on_i
