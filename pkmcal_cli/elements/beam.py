"""Two-node beam, planar and spatial (Ecorchard 2010, eq. 1-3 and 17, in discrete-deformation form).

Angles against the chord are strains to first order only. A bent beam is longer than its chord, bending about both axes
twists it, and a twisted one bends about other axes: quadratic terms, with which a beam under axial force or torque is
as stiff as its differential equation says (Jonker and Meijaard 2013), and one element does where else many are needed.
Spans on which carriages run have them; other beams do without, which is faster.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from pkmcal_cli.base.rotation import Array, cross, dot, skew
from pkmcal_cli.elements.element import (
    DELTA,
    ENDS,
    NATURAL_LENGTH,
    THETA_I,
    THETA_J,
    Element,
    LinkGeometry,
    add_moments,
    add_scaled_identity,
    outer,
    rotated,
    transpose,
)

_BENDING = np.array([[4.0, 2.0], [2.0, 4.0]])  # EI/L times this: bending angles at i and j to end moments
_ENDS = (THETA_I, THETA_J)


@dataclass(frozen=True)
class BeamElement(Element):
    """Elongation, torsion and the bending angles between the end triads and the chord.

    At rest the x axes of both triads lie along the chord. Strains (Jonker and Meijaard): l - L; the mean of the two
    half-differences of the carried y and z axes (torsion); t_z . c (rotation about y) and -t_y . c (about z) at each
    end, c the chord's unit vector.

    `planar` keeps elongation and bending about z only.
    """

    planar: bool = False

    @cached_property
    def strains(self) -> tuple[str, ...]:
        if self.planar:
            return ("elongation", "bend_z_i", "bend_z_j")
        return ("elongation", "torsion", "bend_y_i", "bend_y_j", "bend_z_i", "bend_z_j")

    @cached_property
    def alike(self) -> tuple[tuple[str, ...], ...]:
        """Strains that share one number of stiffness, in the order of these."""
        kinds = ["elongation", "bend_z"] if self.planar else ["elongation", "torsion", "bend_y", "bend_z"]
        return tuple(tuple(s for s in self.strains if s.startswith(kind)) for kind in kinds)

    @cached_property
    def patterns(self) -> Array:
        """EA/L, (GJ/L, EIy/L,) EIz/L: numbers of stiffness, in this order."""
        m = len(self.strains)
        out = np.zeros((len(self.alike), m, m))
        for p, names in enumerate(self.alike):
            rows = [self.strains.index(name) for name in names]
            out[np.ix_([p], rows, rows)] = _BENDING if len(rows) == 2 else 1.0
        return out

    def _bending(self, ti: Array, tj: Array) -> Array:
        """Carried axes (N, E, K, 3) whose components along the chord are the bending angles, ends i and j
        alternately.
        """
        axes = (1,) if self.planar else (2, 1)  # z for bending about y, then -y for bending about z
        out: Array = np.empty((*ti.shape[:-2], 2 * len(axes), 3), dtype=np.result_type(ti, tj), order="F")
        for row, axis in enumerate(axes):
            for end, t in enumerate((ti, tj)):
                column = t[..., :, axis]
                out[..., 2 * row + end, :] = column if axis == 2 else -column
        return out

    def evaluate(self, link: LinkGeometry, rest: Array) -> tuple[Array, Array]:
        e, b = self._against_chord(link)
        return e - rest, b

    def upright(self, link: LinkGeometry) -> Array:
        """Of the angles between the chord and both ends' x axes, times its length; in space also of the twist."""
        cosines = [dot(t[..., :, 0], link.delta) for t in (link.ti, link.tj)]
        if not self.planar:
            cosines.append(dot(link.ti[..., :, 1], link.tj[..., :, 1]) + dot(link.ti[..., :, 2], link.tj[..., :, 2]))
        return np.stack(cosines, axis=-1)

    def _against_chord(self, link: LinkGeometry) -> tuple[Array, Array]:
        """Length of the chord and angles (N, E, m), and their gradient (N, E, m, 9)."""
        delta, ti, tj, _ = link
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
        return e, b

    def add_curvature(self, out: Array, link: LinkGeometry, stress: Array) -> None:
        """Elongation and bending: derivatives of components of carried axes in the chord's direction c."""
        delta, ti, tj, _ = link
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
        for connection, t in zip(_ENDS, ends, strict=True):
            out[..., connection, connection] += rotated(t, c)
            per_length = t / length[..., None]
            coupling = skew(per_length) + outer(c, cross(per_length, c))
            out[..., DELTA, connection] -= coupling
            out[..., connection, DELTA] -= transpose(coupling)
        if not self.planar:
            _add_torsion(out, ti, tj, 0.5 * stress[..., 1])


@dataclass(frozen=True)
class SpanElement(BeamElement):
    """A span of a beam on which carriages run: its natural length L follows their travels.

    Strains of bending and torsion are quadratic, with ends i and j:

    - elongation l (1 + (2 y_i^2 - y_i y_j + 2 y_j^2 + 2 z_i^2 - z_i z_j + 2 z_j^2) / 30) - L, along the bent beam;
    - torsion t - y_i z_j + z_i y_j; bending y - t (z_i - z_j) / 6 and z + t (y_i - y_j) / 6 at both ends.

    Its stiffness numbers are EA, (GJ, EIy,) EIz.
    """

    per_length: ClassVar[bool] = True
    slides: ClassVar[bool] = True

    @cached_property
    def _quadratic(self) -> Array:
        """Second derivatives (m, m, m) of the strains (first) by those to first order; elongation's over l."""
        m = len(self.strains)
        planes = [(1, 2)] if self.planar else [(2, 3), (4, 5)]
        upper = [(0, k, l, -1 / 30) for k, l in planes] + [(0, k, k, 4 / 30) for plane in planes for k in plane]
        if not self.planar:
            upper += [(1, 2, 5, -1.0), (1, 3, 4, 1.0)]
            upper += [(end, 1, other, sign / 6) for end in (2, 3) for other, sign in ((4, -1.0), (5, 1.0))]
            upper += [(end, 1, other, sign / 6) for end in (4, 5) for other, sign in ((2, 1.0), (3, -1.0))]
        out = np.zeros((m, m, m))
        for strain, k, l, value in upper:
            out[strain, k, l] = out[strain, l, k] = value
        return out

    def _second_order(self, e: Array) -> tuple[Array, Array]:
        """Strains (N, E, m), elongation still with L, and their derivative (N, E, m, m) by those to first order."""
        slope = _contracted(self._quadratic, e)
        out = 0.5 * np.einsum("nekl,nel->nek", slope, e)
        slope[..., 0, :] *= e[..., :1]
        slope[..., 0, 0] = out[..., 0]
        out[..., 0] *= e[..., 0]
        for k in range(len(self.strains)):
            slope[..., k, k] += 1.0
        return out + e, slope

    def evaluate(self, link: LinkGeometry, rest: Array) -> tuple[Array, Array]:
        first, of_ends = self._against_chord(link)
        e, slope = self._second_order(first)
        b: Array = np.zeros((*e.shape, self.inputs), dtype=of_ends.dtype, order="F")
        b[..., ENDS], b[..., 0, NATURAL_LENGTH] = np.einsum("nekl,neli->neki", slope, of_ends), -1.0
        return e - rest, b

    def add_curvature(self, out: Array, link: LinkGeometry, stress: Array) -> None:
        e, b = self._against_chord(link)
        _, slope = self._second_order(e)
        weight = stress.copy(order="F")
        weight[..., 0] *= e[..., 0]
        bent = _contracted(np.moveaxis(self._quadratic, 0, 2), weight)  # stress times the second derivative
        stretched = stress[..., :1] / e[..., :1] * slope[..., 0, 1:]
        bent[..., 0, 1:] += stretched
        bent[..., 1:, 0] += stretched
        out[..., ENDS, ENDS] += np.einsum("neki,nekj->neij", b, np.einsum("nekl,nelj->nekj", bent, b))
        super().add_curvature(out, link, np.einsum("nekl,nek->nel", slope, stress))


def _contracted(of: Array, x: Array) -> Array:
    """Of a constant (m, m, m), its last axis with x (N, E, m): (N, E, m, m), rows last in memory."""
    n, count, m = x.shape
    flat = np.swapaxes(of, 0, 1).reshape(m * m, m) @ x.T.reshape(m, -1)
    out: Array = flat.reshape(m, m, count, n).T
    return out


def _add_torsion(out: Array, ti: Array, tj: Array, half: Array) -> None:
    """Add the second derivative of the torsion strain, times its stress (`half`: stress over two)."""
    weight = half[..., None]
    on_i = rotated(weight * ti[..., :, 1], tj[..., :, 2])
    on_i -= rotated(weight * ti[..., :, 2], tj[..., :, 1])
    add_moments(out, on_i)
