"""What every element is: generalised strains of the relative position and the two triads of its ends.

The discrete-deformation form of finite elements for mechanisms (Besseling; van der Werff; Jonker and Meijaard).
An element joins two ports i and j. Its strains depend on `delta`, the vector from port i to port j (m, base axes),
and on the triads `ti`, `tj` of the ports (columns: carried unit axes, base axes). They vanish in the unstressed
state and under every rigid motion. Inputs of the gradient are [delta (3), theta_i (3), theta_j (3)], the
rotations being increments from the left in base axes; an element that ignores the triads has the first three only.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array

DELTA, THETA_I, THETA_J = slice(0, 3), slice(3, 6), slice(6, 9)


@dataclass(frozen=True)
class Element(ABC):
    """One kind of element; instances differ only in which of its strains they use."""

    uses_triads: ClassVar[bool] = True
    curved: ClassVar[bool] = True  # the strains have second derivatives
    per_length: ClassVar[bool] = False  # stiffness numbers are divided by the first rest value, a natural length

    @cached_property
    @abstractmethod
    def strains(self) -> tuple[str, ...]:
        """Names of the m strains."""

    @cached_property
    def patterns(self) -> Array:
        """Constant matrices (P, m, m): the stiffness is the sum of P stiffness numbers times these."""
        m = len(self.strains)
        return np.eye(m)[:, :, None] * np.eye(m)[:, None, :]

    @property
    def inputs(self) -> int:
        """Length of the gradient's input: 3 (delta) or 9 (delta, theta_i, theta_j)."""
        return 9 if self.uses_triads else 3

    @property
    def gaps(self) -> NDArray[np.bool_]:
        """Which strains (m,) are distances between parts that belong together; angles and free springs are none."""
        return np.array([name in ("elongation", "x", "y", "z") for name in self.strains])

    @abstractmethod
    def evaluate(self, delta: Array, ti: Array, tj: Array, rest: Array) -> tuple[Array, Array]:
        """Strains (N, E, m) and their gradient (N, E, m, inputs).

        delta (N, E, 3); ti, tj (N, E, 3, 3); rest (N or 1, E, m): natural length, commanded travel, ...
        Strains in m and rad. Must accept complex arrays (derivatives by complex step).
        """

    def curvature(self, delta: Array, ti: Array, tj: Array, stress: Array) -> Array:
        """Second derivative of the strains contracted with `stress` (N, E, m): (N, E, inputs, inputs).

        The derivative of gradient^T stress with respect to the inputs; the rotational part is that of the moment,
        hence not symmetric away from equilibrium.
        """
        shape, kind = (*delta.shape[:-1], self.inputs, self.inputs), np.result_type(delta, ti, tj, stress)
        out: Array = np.zeros(shape, dtype=kind, order="F")
        self.add_curvature(out, delta, ti, tj, stress)
        return out

    @abstractmethod
    def add_curvature(self, out: Array, delta: Array, ti: Array, tj: Array, stress: Array) -> None:
        """Add the curvature to `out` (N, E, inputs, inputs)."""


def outer(a: Array, b: Array) -> Array:
    """Dyads a b^T, (..., 3, 3)."""
    return np.asarray(a[..., :, None] * b[..., None, :])


def turned(a: Array, h: Array) -> Array:
    """Derivative of the moment a x h with respect to a rotation that carries a: a h^T - (a . h) I."""
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
    """Matrices of the last two axes transposed, a view."""
    return np.swapaxes(a, -1, -2)


def add_product(out: Array, a: Array, b: Array, stress: Array) -> None:
    """Add `stress` (N, E) times the second derivative of a . b, a carried by port i and b by port j."""
    add_moments(out, turned(stress[..., None] * a, b))


def add_moments(out: Array, on_i: Array) -> None:
    """Add the derivatives of opposite moments of products of carried axes; `on_i`: of that on i by theta_i."""
    on_j = transpose(on_i)
    out[..., THETA_I, THETA_I] += on_i
    out[..., THETA_I, THETA_J] -= on_j
    out[..., THETA_J, THETA_J] += on_j
    out[..., THETA_J, THETA_I] -= on_i
