"""Two-node beam, planar and spatial (Ecorchard 2010, eq. 1-3 and 17, in discrete-deformation form)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..rotation import Array, cross, dot
from .bar import chord_curvature
from .base import DELTA, THETA_I, THETA_J, Element, outer, turned

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

    @property
    def strains(self) -> tuple[str, ...]:
        if self.planar:
            return ("elongation", "bend_z_i", "bend_z_j")
        return ("elongation", "torsion", "bend_y_i", "bend_y_j", "bend_z_i", "bend_z_j")

    @property
    def patterns(self) -> Array:
        """EA/L, (GJ/L, EIy/L,) EIz/L: numbers of stiffness, in this order."""
        m = len(self.strains)
        names = ["elongation", "bend_z"] if self.planar else ["elongation", "torsion", "bend_y", "bend_z"]
        out = np.zeros((len(names), m, m))
        for p, name in enumerate(names):
            rows = [r for r, strain in enumerate(self.strains) if strain.startswith(name)]
            out[np.ix_([p], rows, rows)] = _BENDING if len(rows) == 2 else 1.0
        return out

    def _bending(self, ti: Array, tj: Array) -> list[tuple[Array, int]]:
        """Carried axes whose component along the chord is a bending angle, with their end, in the order of strains."""
        about_z = [(-ti[..., :, 1], 0), (-tj[..., :, 1], 1)]
        return about_z if self.planar else [(ti[..., :, 2], 0), (tj[..., :, 2], 1), *about_z]

    def evaluate(self, delta: Array, ti: Array, tj: Array, rest: Array) -> tuple[Array, Array]:
        length = np.sqrt(dot(delta, delta))[..., None]  # (N, E, 1)
        c = delta / length
        m = len(self.strains)
        e = np.empty((*c.shape[:-1], m), dtype=c.dtype)
        b = np.zeros((*c.shape[:-1], m, 9), dtype=c.dtype)
        e[..., 0], b[..., 0, DELTA] = length[..., 0], c
        first = 1
        if not self.planar:
            iy, iz, jy, jz = ti[..., :, 1], ti[..., :, 2], tj[..., :, 1], tj[..., :, 2]
            e[..., 1] = 0.5 * (dot(iy, jz) - dot(iz, jy))
            b[..., 1, THETA_I] = 0.5 * (cross(iy, jz) - cross(iz, jy))
            b[..., 1, THETA_J] = -b[..., 1, THETA_I]
            first = 2
        for row, (t, end) in enumerate(self._bending(ti, tj), first):
            e[..., row] = dot(t, c)
            b[..., row, DELTA] = (t - e[..., row, None] * c) / length
            b[..., row, _ENDS[end]] = cross(t, c)
        return e - rest, b

    def curvature(self, delta: Array, ti: Array, tj: Array, stress: Array) -> Array:
        length = np.sqrt(dot(delta, delta))[..., None]
        c = delta / length
        out = np.zeros((*c.shape[:-1], 9, 9), dtype=c.dtype)
        # Bending is linear in the carried axes: those of one end act as one vector, their sum weighted by stress.
        ends = [np.zeros_like(c), np.zeros_like(c)]
        for row, (t, end) in enumerate(self._bending(ti, tj), 1 if self.planar else 2):
            ends[end] = ends[end] + stress[..., row, None] * t
        total = ends[0] + ends[1]
        along = dot(total, c)
        dyad = outer(total, c)
        transverse = np.eye(3) - outer(c, c)
        out[..., DELTA, DELTA] = chord_curvature(c, stress[..., 0] / length[..., 0])
        out[..., DELTA, DELTA] -= (dyad + np.swapaxes(dyad, -1, -2)) / length[..., None] ** 2
        out[..., DELTA, DELTA] -= (along / length[..., 0] ** 2)[..., None, None] * (
            transverse - 2 * outer(c, c)
        )
        for port, t in zip(_ENDS, ends, strict=True):
            coupling = cross(t[..., None, :], transverse) / length[..., None]  # row k: t x (P e_k) / l
            out[..., DELTA, port] = coupling
            out[..., port, DELTA] = np.swapaxes(coupling, -1, -2)
            out[..., port, port] = turned(t, c)
        if not self.planar:
            _add_torsion(out, ti, tj, 0.5 * stress[..., 1])
        return out


def _add_torsion(out: Array, ti: Array, tj: Array, half: Array) -> None:
    """Add the second derivative of the torsion strain, times its stress (`half`: stress over two)."""
    for sign, (a, b) in ((1.0, (ti[..., :, 1], tj[..., :, 2])), (-1.0, (ti[..., :, 2], tj[..., :, 1]))):
        add_product(out, a, b, sign * half)


def add_product(out: Array, a: Array, b: Array, stress: Array) -> None:
    """Add `stress` times the second derivative of a . b, a carried by port i and b by port j."""
    weight = stress[..., None, None]
    on_i, on_j = weight * turned(a, b), weight * turned(b, a)
    out[..., THETA_I, THETA_I] += on_i
    out[..., THETA_I, THETA_J] -= np.swapaxes(on_i, -1, -2)
    out[..., THETA_J, THETA_J] += on_j
    out[..., THETA_J, THETA_I] -= np.swapaxes(on_j, -1, -2)
