"""Bar, rope, belt, pinned rod, telescopic leg without bending: one strain, the elongation e = |delta| - L.

Its gradient is the unit vector n of the chord, its curvature (I - n n^T) / |delta|: the stress term of the tangent
(geometric stiffness). Stiffness is ES/L or k (Ecorchard 2010, eq. 1-3, first row; Besseling 1974).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from pkmcal_cli.base.rotation import Array, dot
from pkmcal_cli.elements.element import Element, LinkGeometry, add_scaled_identity, outer


@dataclass(frozen=True)
class BarElement(Element):
    """Elongation l - L of the chord between the connection points; stiffness ES/L or k (N/m)."""

    uses_triads: ClassVar[bool] = False

    @cached_property
    def strains(self) -> tuple[str, ...]:
        return ("elongation",)

    def evaluate(self, link: LinkGeometry, rest: Array) -> tuple[Array, Array]:
        length = np.sqrt(dot(link.delta, link.delta))[..., None]
        return length - rest, (link.delta / length)[..., None, :]

    def free_length(self, link: LinkGeometry) -> Array:
        """Length (N, E) of what lies on no pulley."""
        return np.asarray(np.sqrt(dot(link.delta, link.delta)))

    def add_curvature(self, out: Array, link: LinkGeometry, stress: Array) -> None:
        """(I - c c^T) N/l: the string stiffness of a member under tension N."""
        delta, length = link.delta, np.sqrt(dot(link.delta, link.delta))
        tension = stress[..., 0] / length
        out -= outer((tension / length**2)[..., None] * delta, delta)
        add_scaled_identity(out, tension)


@dataclass(frozen=True)
class ElasticBarElement(BarElement):
    """A bar whose stiffness number is ES (N): what a drive winds or extends changes its stiffness ES/L too."""

    per_length: ClassVar[bool] = True
