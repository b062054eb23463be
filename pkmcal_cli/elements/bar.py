"""Bar, rope, belt, pinned rod, telescopic leg without bending: one strain, the elongation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..rotation import Array, dot
from .base import Element, outer


@dataclass(frozen=True)
class Bar(Element):
    """Elongation l - L of the chord between the ports; stiffness ES/L or k (N/m)."""

    uses_triads: ClassVar[bool] = False

    @property
    def strains(self) -> tuple[str, ...]:
        return ("elongation",)

    def evaluate(self, delta: Array, ti: Array, tj: Array, rest: Array) -> tuple[Array, Array]:
        length = np.sqrt(dot(delta, delta))[..., None]
        return length - rest, (delta / length)[..., None, :]

    def curvature(self, delta: Array, ti: Array, tj: Array, stress: Array) -> Array:
        length = np.sqrt(dot(delta, delta))[..., None]
        return chord_curvature(delta / length, stress[..., 0] / length[..., 0])


@dataclass(frozen=True)
class ElasticBar(Bar):
    """A bar whose stiffness number is ES (N): what a drive winds or extends changes its stiffness ES/L too."""

    per_length: ClassVar[bool] = True


def chord_curvature(c: Array, tension_per_length: Array) -> Array:
    """(I - c c^T) N/l: the string stiffness of a member under tension N, (..., 3, 3)."""
    return np.asarray(tension_per_length[..., None, None] * (np.eye(3) - outer(c, c)))
