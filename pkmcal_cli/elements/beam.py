"""Two-node beam, planar and spatial (Ecorchard 2010, eq. 1-3 and 17, in discrete-deformation form)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pkmcal_cli.base.rotation import Array, cross, dot, skew
from pkmcal_cli.elements.base import (
    DELTA,
    THETA_I,
    THETA_J,
    Element,
    add_moments,
    add_scaled_identity,
    outer,
    transpose,
    turned,
)

_BENDING = np.array([[4.0, 2.0], [2.0, 4.0]])  # EI/L times this: bending angles at i and j to end moments
_ENDS = (THETA_I, THETA_J)


@dataclass(frozen=True)
class Beam(Element):
    """Elongation, torsion and the bending angles between the end triads and the chord.

    At rest the x axes of both triads lie along the chord. Strains (Jonker and Meijaard): l - L; the mean of the two
    half-differences of the carried y and z axes (torsion); t_z . c (rotation about y) and -t_y . c (about z) at each
    end, c the chord's unit vector. `planar` keeps elongation and bending about z only.
    """

    planar: bool = False

    @cached_property
    def strains(self) -> tuple[str, ...]:
        if self.planar:
            return ("elongation", "bend_z_i", "bend_z_j")
        return ("elongation", "torsion", "bend_y_i", "bend_y_j", "bend_z_i", "bend_z_j")

    @cached_property
    def patterns(self) -> Array:
        """EA/L, (GJ/L, EIy/L,) EIz/L: numbers of stiffness, in this order."""
        m = len(self.strains)
        names = ["elongation", "bend_z"] if self.planar else ["elongation", "torsion", "bend_y", "bend_z"]
        out = np.zeros((len(names), m, m))
        for p, name in enumerate(names):
            rows = [r for r, strain in enumerate(self.strains) if strain.startswith(name)]
            out[np.ix_([p], rows, rows)] = _BENDING if len(rows) == 2 else 1.0
        return out

    def _bending(self, ti: Array, tj: Array) -> Array:
        """Carried axes whose components along the chord are the bending angles, ends i and j by turns, (N, E, K, 3)."""
        axes = (1,) if self.planar else (2, 1)  # z for bending about y, then -y for bending about z
        out: Array = np.empty((*ti.shape[:-2], 2 * len(axes), 3), dtype=np.result_type(ti, tj), order="F")
        for row, axis in enumerate(axes):
            for end, t in enumerate((ti, tj)):
                column = t[..., :, axis]
                out[..., 2 * row + end, :] = column if axis == 2 else -column
        return out

    def evaluate(self, delta: Array, ti: Array, tj: Array, rest: Array) -> tuple[Array, Array]:
        length = np.sqrt(dot(delta, delta))[..., None]  # (N, E, 1)
        c = delta / length
        m, first = len(self.strains), 1 if self.planar else 2
        e: Array = np.empty((*c.shape[:-1], m), dtype=np.result_type(c, ti, tj), order="F")
        b: Array = np.zeros((*e.shape, 9), dtype=e.dtype, order="F")
        e[..., 0], b[..., 0, DELTA] = length[..., 0], c
        if not self.planar:
            iy, iz, jy, jz = ti[..., :, 1], ti[..., :, 2], tj[..., :, 1], tj[..., :, 2]
            e[..., 1] = 0.5 * (dot(iy, jz) - dot(iz, jy))
            b[..., 1, THETA_I] = 0.5 * (cross(iy, jz) - cross(iz, jy))
            b[..., 1, THETA_J] = -b[..., 1, THETA_I]
        t = self._bending(ti, tj)  # (N, E, K, 3)
        e[..., first:] = angles = dot(t, c[..., None, :])
        b[..., first:, DELTA] = (t - angles[..., None] * c[..., None, :]) / length[..., None]
        moments = cross(t, c[..., None, :])
        b[..., first::2, THETA_I], b[..., first + 1 :: 2, THETA_J] = moments[..., ::2, :], moments[..., 1::2, :]
        return e - rest, b

    def add_curvature(self, out: Array, delta: Array, ti: Array, tj: Array, stress: Array) -> None:
        """Elongation and bending: derivatives of components of carried axes in the chord's direction c."""
        length = np.sqrt(dot(delta, delta))
        c = delta / length[..., None]
        # Bending is linear in the carried axes: those of one end act as one vector, their sum weighted by stress.
        weighted = stress[..., 1 if self.planar else 2 :, None] * self._bending(ti, tj)  # (N, E, K, 3)
        ends = [weighted[..., end::2, :].sum(axis=-2) for end in (0, 1)]
        total = ends[0] + ends[1]
        along, tension = dot(total, c) / length**2, stress[..., 0] / length
        half = (1.5 * along - 0.5 * tension)[..., None] * c - total / (length**2)[..., None]
        dyad = outer(half, c)
        out[..., DELTA, DELTA] += dyad + transpose(dyad)
        add_scaled_identity(out[..., DELTA, DELTA], tension - along)
        for port, t in zip(_ENDS, ends, strict=True):
            out[..., port, port] += turned(t, c)
            per_length = t / length[..., None]
            coupling = skew(per_length) + outer(c, cross(per_length, c))
            out[..., DELTA, port] -= coupling
            out[..., port, DELTA] -= transpose(coupling)
        if not self.planar:
            _add_torsion(out, ti, tj, 0.5 * stress[..., 1])


def _add_torsion(out: Array, ti: Array, tj: Array, half: Array) -> None:
    """Add the second derivative of the torsion strain, times its stress (`half`: stress over two)."""
    weight = half[..., None]
    on_i = turned(weight * ti[..., :, 1], tj[..., :, 2])
    on_i -= turned(weight * ti[..., :, 2], tj[..., :, 1])
    add_moments(out, on_i)
