"""Orientation of a body as a rotation vector: what holds single components of it, for inverse positions.

The strains are components of w = log(T_i^T T_j), T the triads of the ends, and d w = J^-1(w) T_i^T (theta_j - theta_i)
with J the left Jacobian of the exponential map. So one component can be held exactly while the others go where the
mechanism takes them, which the products of axes of a joint cannot.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pkmcal_cli.base.rotation import Array, dot, log, log_jacobian
from pkmcal_cli.elements.element import THETA_I, THETA_J, Element, LinkGeometry

_STEP = 1e-30


@dataclass(frozen=True)
class OrientationElement(Element):
    """Rotation vector of j against i in the triad of i, rad; `directions`: rz in the plane, rx, ry, rz in space."""

    directions: tuple[str, ...]

    @cached_property
    def strains(self) -> tuple[str, ...]:
        return self.directions

    def evaluate(self, link: LinkGeometry, rest: Array) -> tuple[Array, Array]:
        _, ti, tj, _ = link
        vector = _nearest(log(np.einsum("...ji,...jk->...ik", ti, tj)), self._whole(rest))
        used = ["xyz".index(name[1]) for name in self.directions]
        rows = np.einsum("...ij,...kj->...ik", log_jacobian(vector), ti)[..., used, :]
        b = np.zeros((*vector.shape[:-1], len(used), 9), dtype=np.result_type(*link[:3]), order="F")
        b[..., THETA_J], b[..., THETA_I] = rows, -rows
        return vector[..., used] - rest, b

    def _whole(self, rest: Array) -> Array:
        """The rest values as a rotation vector."""
        out = np.zeros((*rest.shape[:-1], 3), dtype=rest.dtype)
        out[..., ["xyz".index(name[1]) for name in self.directions]] = rest
        return out

    def add_curvature(self, out: Array, link: LinkGeometry, stress: Array) -> None:
        for triad, where in ((link.ti, THETA_I), (link.tj, THETA_J)):
            for k in range(3):
                turned = triad.astype(complex)
                turned += 1j * _STEP * np.cross(np.eye(3)[k], triad, axisb=-2, axisc=-2)
                stepped = link._replace(ti=turned) if triad is link.ti else link._replace(tj=turned)
                slopes = self.evaluate(stepped, np.zeros_like(stress))[1].imag / _STEP
                out[..., where.start + k] += np.einsum("...m,...mi->...i", stress, slopes)


def _nearest(vector: Array, reference: Array) -> Array:
    """The rotation vector (..., 3) of the same orientation, whole turns about its axis added, nearest to another."""
    angle = np.sqrt(dot(vector, vector))
    still = np.abs(angle) < 1e-8
    along = np.where(still[..., None], reference, vector)
    size = np.sqrt(dot(along, along))
    unit = along / np.where(np.abs(size) < 1e-300, 1.0, size)[..., None]
    turns = np.round(dot(reference - vector, unit).real / (2 * np.pi))
    return np.asarray(vector + (2 * np.pi * turns)[..., None] * unit)
