"""Joint between two connection points, guide with its drive, spring to ground.

Displacements are a_i . (x_j - x_i) along axes a_i that member i carries; rotations are sums of products f a_i . d_j of
axes that both carry, which are zero where the blocked rotation is, and its angle for small ones (the hinges of Jonker
and Meijaard 1990 are the same conditions).

Which rotations a joint blocks, and the formula of each that stays valid at any angle of its free rotations, is one
row of `JOINTS`. The joint's own axes: z is the axis of revolute, cylindrical and planar joints; x that of a prismatic
joint; a universal joint rotates about x of the first member and y of the second.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array, cross, dot, polar_angle, skew
from pkmcal_cli.elements.element import (
    DELTA,
    THETA_I,
    THETA_J,
    Element,
    LinkGeometry,
    add_product,
    outer,
    rotated,
    transpose,
)

# A rotation strain is a sum of products of a carried axis of i with one of j: (factor, axis of i, axis of j).
# For small angles it is the rotation of j against i about i's axis, with its sign (couplings depend on it).
_HALF = MappingProxyType(
    {"rx": ((0.5, 2, 1), (-0.5, 1, 2)), "ry": ((0.5, 0, 2), (-0.5, 2, 0)), "rz": ((0.5, 1, 0), (-0.5, 0, 1))}
)
_ACROSS = MappingProxyType({"rx": ((-1.0, 1, 2),), "ry": ((1.0, 0, 2),)})
_COSINES = MappingProxyType({"rx": (1, 2), "ry": (0, 2), "rz": (0, 1)})  # axes of i along those of j, where it is none
_UNIVERSAL = MappingProxyType({"rz": ((-1.0, 0, 1),)})
DISPLACEMENTS = ("x", "y", "z")


@dataclass(frozen=True)
class JointType:
    """Blocked directions of a joint and the products that measure its blocked rotations."""

    blocked: tuple[str, ...]
    rotations: MappingProxyType[str, tuple[tuple[float, int, int], ...]]
    drive: str | None = None  # the free direction that an actuator can drive


JOINTS: MappingProxyType[str, JointType] = MappingProxyType(
    {
        "fixed": JointType(("x", "y", "z", "rx", "ry", "rz"), _HALF),
        "prismatic": JointType(("y", "z", "rx", "ry", "rz"), _HALF, "x"),
        "revolute": JointType(("x", "y", "z", "rx", "ry"), _ACROSS, "rz"),
        "cylindrical": JointType(("x", "y", "rx", "ry"), _ACROSS, "z"),
        "planar": JointType(("z", "rx", "ry"), _ACROSS),
        "universal": JointType(("x", "y", "z", "rz"), _UNIVERSAL),
        "spherical": JointType(("x", "y", "z"), MappingProxyType({})),
    }
)


@dataclass(frozen=True)
class JointElement(Element):
    """Strains of a joint: relative displacements (m) in the triad of i, and rotations (rad) about its axes.

    `directions` lists those in use, out of x y z rx ry rz; `angle` is the unwrapped rotation of j about z of i, the
    strain of a rotary drive or a torsion spring.
    """

    type: str
    directions: tuple[str, ...]

    @cached_property
    def strains(self) -> tuple[str, ...]:
        return self.directions

    @property
    def gaps(self) -> NDArray[np.bool_]:
        blocked = JOINTS[self.type].blocked
        return np.array([name in DISPLACEMENTS and name in blocked for name in self.directions])

    @cached_property
    def patterns(self) -> Array:
        """One number a direction, then one for each coupling of two directions (k < l)."""
        m = len(self.directions)
        pairs = [(k, k) for k in range(m)] + [(k, l) for k in range(m) for l in range(k + 1, m)]
        out = np.zeros((len(pairs), m, m))
        for p, (k, l) in enumerate(pairs):
            out[p, k, l] = out[p, l, k] = 1.0
        return out

    def evaluate(self, link: LinkGeometry, rest: Array) -> tuple[Array, Array]:
        delta, ti, tj, _ = link
        m = len(self.directions)
        kind = np.result_type(delta, ti, tj)
        e: Array = np.zeros((*delta.shape[:-1], m), dtype=kind, order="F")
        b: Array = np.zeros((*delta.shape[:-1], m, 9), dtype=kind, order="F")
        for row, name in enumerate(self.directions):
            if name in DISPLACEMENTS:
                a = ti[..., :, DISPLACEMENTS.index(name)]
                e[..., row], b[..., row, DELTA], b[..., row, THETA_I] = dot(a, delta), a, cross(a, delta)
            elif name == "angle":
                e[..., row], b[..., row, THETA_I] = _angle(ti, tj)
                b[..., row, THETA_J] = -b[..., row, THETA_I]
            else:
                for factor, p, q in self._products(name):
                    a, d = ti[..., :, p], tj[..., :, q]
                    moment = factor * cross(a, d)
                    e[..., row] += factor * dot(a, d)
                    b[..., row, THETA_I] += moment
                    b[..., row, THETA_J] -= moment
        return _wrapped(e - rest, self.directions), b

    def upright(self, link: LinkGeometry) -> Array | None:
        """Of the blocked rotations in use: of the angle between the axes of a hinge, or about each axis."""
        rotations = JOINTS[self.type].rotations
        kept = {"rx": (2,), "ry": (2,)} if rotations is _ACROSS else _COSINES if rotations is _HALF else {}
        axes = [kept[name] for name in self.directions if name in rotations and name in kept]
        if not axes:
            return None
        aligned = [dot(link.ti[..., :, k], link.tj[..., :, k]) for k in range(3)]
        return np.stack([sum(aligned[k] for k in along) for along in axes], axis=-1)

    def _products(self, name: str) -> tuple[tuple[float, int, int], ...]:
        return JOINTS[self.type].rotations.get(name) or _HALF[name]

    def add_curvature(self, out: Array, link: LinkGeometry, stress: Array) -> None:
        delta, ti, tj, _ = link
        for row, name in enumerate(self.directions):
            s = stress[..., row]
            if name in DISPLACEMENTS:
                a = ti[..., :, DISPLACEMENTS.index(name)]
                tangent = skew(s[..., None] * a)
                out[..., DELTA, THETA_I] -= tangent
                out[..., THETA_I, DELTA] += tangent
                out[..., THETA_I, THETA_I] += rotated(s[..., None] * a, delta)
            elif name == "angle":
                _add_angle(out, ti, tj, s)
            else:
                for factor, p, q in self._products(name):
                    add_product(out, ti[..., :, p], tj[..., :, q], factor * s)


def _angle(ti: Array, tj: Array) -> tuple[Array, Array]:
    """Angle of j about z of i, and its gradient with respect to theta_i (that for theta_j is the opposite)."""
    x, y, d = ti[..., :, 0], ti[..., :, 1], tj[..., :, 0]
    sine, cosine = dot(y, d), dot(x, d)
    norm = (sine * sine + cosine * cosine)[..., None]
    gradient = (cosine[..., None] * cross(y, d) - sine[..., None] * cross(x, d)) / norm
    return polar_angle(sine, cosine), gradient


def _add_angle(out: Array, ti: Array, tj: Array, stress: Array) -> None:
    """Add `stress` times the second derivative of atan2(sine, cosine), sine = y . d and cosine = x . d."""
    x, y, d = ti[..., :, 0], ti[..., :, 1], tj[..., :, 0]
    sine, cosine = dot(y, d), dot(x, d)
    norm = sine * sine + cosine * cosine
    add_product(out, y, d, stress * cosine / norm)
    add_product(out, x, d, -stress * sine / norm)
    gradient = {}
    for name, moment in (("sine", cross(y, d)), ("cosine", cross(x, d))):
        gradient[name] = np.zeros((*moment.shape[:-1], 9), dtype=moment.dtype, order="F")
        gradient[name][..., THETA_I], gradient[name][..., THETA_J] = moment, -moment
    factor = (2 * stress * sine * cosine / norm**2)[..., None, None]
    mixed = (stress * (sine**2 - cosine**2) / norm**2)[..., None, None]
    both = outer(gradient["sine"], gradient["cosine"])
    out += factor * (outer(gradient["cosine"], gradient["cosine"]) - outer(gradient["sine"], gradient["sine"]))
    out += mixed * (both + transpose(both))


def _wrapped(e: Array, directions: tuple[str, ...]) -> Array:
    """Bring the drive angle's strain to (-pi, pi]: a drive may have made whole revolutions."""
    if "angle" in directions:
        row = directions.index("angle")
        e[..., row] -= 2 * np.pi * np.round(e[..., row].real / (2 * np.pi))
    return e
