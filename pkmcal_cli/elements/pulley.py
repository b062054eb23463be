"""Links of a rope over pulleys: in the plane, and in space over pulleys that swivel about an axis.

The length of a link is that of its free part and of what lies on the pulleys at its ends. A pulley turns freely, so the
length is stationary in the points of contact: its gradient is the unit vector of the free part, as if the rope were a
bar there, and its derivative by a radius is the angle of wrap. Where the ends are nearer than the radii allow there is
no tangent: lengths are nan.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from pkmcal_cli.base.rotation import Array, cross, dot, polar_angle
from pkmcal_cli.elements.element import DELTA, THETA_I, Element, LinkGeometry, outer, transpose

_STRAIGHT = 1e-12  # of the length: a rope that leaves its pulley along the axis has no plane of its own
_NOTHING = 1e-300
_TURNED = -0.5  # cosine of the angle of wrap beyond which formulas for small ones lose figures


@dataclass(frozen=True)
class PlanarPulleyElement(Element):
    """Rope from the pulley about point i to that about point j, in the plane; radii are signed, 0 without a pulley.

    `radius_i`, `radius_j` are positive where the centre is to the left of the rope as it runs from i to j. With the
    angle theta (counter-clockwise) of the free part from `direction`, its angle in the reference configuration, the
    length is s + radius_i (wrap + theta) - radius_j theta, s^2 = d^2 - (radius_j - radius_i)^2. So a pulley between two
    links is wrapped by `wrap` of the later one (of the sign of the radius) in the reference configuration.
    """

    uses_triads: ClassVar[bool] = False
    sizes: ClassVar[tuple[str, ...]] = ("radius_i", "radius_j", "direction", "wrap")

    @cached_property
    def strains(self) -> tuple[str, ...]:
        return ("elongation",)

    def evaluate(self, link: LinkGeometry, rest: Array) -> tuple[Array, Array]:
        tangent, free = _planar_tangent(link)
        first, last, _, wrap = _parts(link.sizes)
        theta = _turned(tangent, link.sizes)
        return (free + first * (wrap + theta) - last * theta)[..., None] - rest, tangent[..., None, :]

    def free_length(self, link: LinkGeometry) -> Array:
        """Length (N, K) of what lies on no pulley."""
        return _planar_tangent(link)[1]

    def by_sizes(self, link: LinkGeometry) -> Array:
        first, last, _, wrap = _parts(link.sizes)
        theta = _turned(_planar_tangent(link)[0], link.sizes)
        parts = np.broadcast_arrays(wrap + theta, -theta, last - first, first)
        return np.stack(parts, axis=-1)[..., None, :]

    def add_curvature(self, out: Array, link: LinkGeometry, stress: Array) -> None:
        """N n n^T / s in the plane, n across the free part."""
        tangent, free = _planar_tangent(link)
        tension = stress[..., 0] / free
        for k in range(2):
            out[..., k, k] += tension
        out -= outer(tension[..., None] * tangent, tangent)


@dataclass(frozen=True)
class ElasticPlanarPulleyElement(PlanarPulleyElement):
    """The same with ES (N) as its stiffness number, of a path of length L: ES/L."""

    per_length: ClassVar[bool] = True


def _parts(sizes: Array) -> tuple[Array, Array, Array, Array]:
    first, last, direction, wrap = np.moveaxis(sizes, -1, 0)
    return first, last, direction, wrap


def _planar_tangent(link: LinkGeometry) -> tuple[Array, Array]:
    """Unit vector (N, K, 3) and length (N, K) of the free part: delta = s t - c n, n to the right of t."""
    first, last, _, _ = _parts(link.sizes)
    x, y, apart = link.delta[..., 0], link.delta[..., 1], last - first
    square = _divisor(x * x + y * y)
    free = _root(square - apart * apart)
    tangent = np.zeros_like(link.delta, dtype=np.result_type(link.delta, free))
    tangent[..., 0], tangent[..., 1] = (free * x + apart * y) / square, (free * y - apart * x) / square
    return tangent, free


def _turned(tangent: Array, sizes: Array) -> Array:
    """Angle of the free part from its direction in the reference configuration, in (-pi, pi]."""
    direction = sizes[..., 2]
    x, y = np.cos(direction), np.sin(direction)
    return polar_angle(x * tangent[..., 1] - y * tangent[..., 0], x * tangent[..., 0] + y * tangent[..., 1])


def _divisor(square: Array) -> Array:
    """A square by which can be divided."""
    return np.where(square == 0, _NOTHING, square)


def _root(square: Array) -> Array:
    """Square root of what is positive, else nan."""
    return np.sqrt(np.where(square.real > 0, square, np.nan))


@dataclass(frozen=True)
class SwivelPulleyElement(Element):
    """Rope over a pulley that swivels, to point j: it comes along the axis u (z of the triad) to point i.

    The plane of the pulley holds the axis and point j, at the distances h = delta . u along it and rho across; the
    centre is at `radius` from the axis, towards point j. The rope is wrapped by beta in [0, 3 pi / 2), and its free
    part has the direction sin(beta) e + cos(beta) u, e across the axis (Pott 2018, Cable-Driven Parallel Robots).
    Radius 0: a straight rope.
    """

    sizes: ClassVar[tuple[str, ...]] = ("radius",)

    @cached_property
    def strains(self) -> tuple[str, ...]:
        return ("elongation",)

    def evaluate(self, link: LinkGeometry, rest: Array) -> tuple[Array, Array]:
        seen = _Swivelled.of(link)
        radius = link.sizes[..., 0]
        b: Array = np.zeros((*link.delta.shape[:-1], 1, 9), dtype=seen.tangent.dtype, order="F")
        b[..., 0, DELTA] = seen.tangent
        b[..., 0, THETA_I] = -seen.arm[..., None] * seen.across
        return (seen.free + radius * seen.wrap)[..., None] - rest, b

    def free_length(self, link: LinkGeometry) -> Array:
        """Length (N, K) of what lies on no pulley."""
        return _Swivelled.of(link).free

    def by_sizes(self, link: LinkGeometry) -> Array:
        seen = _Swivelled.of(link)
        return np.asarray((seen.wrap - seen.sine)[..., None, None])  # the centre moves with the radius

    def add_curvature(self, out: Array, link: LinkGeometry, stress: Array) -> None:
        """In the plane the rope turns about its free part, across it about the axis."""
        seen = _Swivelled.of(link)
        tension, radius, across = stress[..., 0], link.sizes[..., 0], seen.across
        normal = seen.cosine[..., None] * seen.outward - seen.sine[..., None] * seen.axis
        lever, (swing, share) = radius * seen.sine / seen.free, seen.swung(radius)
        out[..., DELTA, DELTA] += _scaled(tension / seen.free, outer(normal, normal))
        out[..., DELTA, DELTA] += _scaled(tension * swing, outer(across, across))
        mixed = _scaled(tension * share, outer(across, seen.outward))
        mixed -= _scaled(tension * lever, outer(normal, across))
        out[..., DELTA, THETA_I] += mixed
        out[..., THETA_I, DELTA] += transpose(mixed)
        turning = _scaled(tension * lever * (seen.free + radius * seen.sine), outer(across, across))
        turning += _scaled(tension * share * seen.height, outer(seen.outward, seen.outward))
        turning -= _scaled(tension * seen.arm, outer(seen.axis, seen.outward))
        out[..., THETA_I, THETA_I] += turning


@dataclass(frozen=True)
class ElasticSwivelPulleyElement(SwivelPulleyElement):
    """The same with ES (N) as its stiffness number, of a path of length L: ES/L."""

    per_length: ClassVar[bool] = True


def _scaled(factor: Array, matrix: Array) -> Array:
    return np.asarray(factor[..., None, None] * matrix)


@dataclass(frozen=True, kw_only=True)
class _Swivelled:
    """A rope and its pulley in the plane that they share, (N, K) or vectors (N, K, 3)."""

    axis: Array  # u
    outward: Array  # e, from the axis to point j
    across: Array  # u x e
    height: Array  # h
    free: Array  # s
    sine: Array  # of the angle of wrap
    cosine: Array
    wrap: Array
    arm: Array  # r (1 - cosine): lever arm of the pull about point i
    distance: Array  # rho

    @property
    def tangent(self) -> Array:
        """Unit vector of the free part."""
        return np.asarray(self.sine[..., None] * self.outward + self.cosine[..., None] * self.axis)

    def swung(self, radius: Array) -> tuple[Array, Array]:
        """sine / rho, by which the rope turns where point j steps across the plane, and arm / rho.

        rho = (s + r tan(wrap / 2)) sine, which is 0 where the rope goes straight on.
        """
        turned = self.cosine < _TURNED
        apart = np.where(turned & (self.distance > 0), self.distance, 1.0)
        bent = radius * self.sine / np.where(turned, 1.0, 1.0 + self.cosine)
        swing = np.where(turned, self.sine / apart, 1.0 / (self.free + bent))
        return swing, np.where(turned, self.arm / apart, bent * swing)

    @classmethod
    def of(cls, link: LinkGeometry) -> _Swivelled:
        """As the rope lies; nan where point j is within the pulley."""
        axis, radius = link.ti[..., :, 2], link.sizes[..., 0]
        height = dot(link.delta, axis)
        away = link.delta - height[..., None] * axis
        square = dot(away, away)
        along = np.abs(square) < (_STRAIGHT * height.real) ** 2
        rho = np.sqrt(np.where(along, 1.0, square))
        outward = np.where(along[..., None], link.ti[..., :, 0], away / rho[..., None])
        rho = np.where(along, 0.0, rho)
        beyond = rho - radius  # of the pulley's centre
        square = _divisor(beyond * beyond + height * height)
        free = _root(square - radius * radius)
        sine, cosine = (beyond * free + height * radius) / square, (height * free - beyond * radius) / square
        wrap = polar_angle(sine, cosine)
        wrap = wrap + np.where(wrap.real < -0.5 * np.pi, 2 * np.pi, 0.0)
        return cls(
            axis=axis, outward=outward, across=cross(axis, outward), height=height, free=free, sine=sine, cosine=cosine,
            distance=rho, wrap=wrap, arm=radius * (1.0 - cosine),
        )  # fmt: skip
