"""Bar, rope, belt, pinned rod, telescopic leg without bending: one strain, the elongation."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from pkmcal_cli.base.rotation import Array, dot
from pkmcal_cli.elements.base import Element, add_scaled_identity, outer


@dataclass(frozen=True)
class Bar(Element):
    """Elongation l - L of the chord between the ports; stiffness ES/L or k (N/m)."""

    uses_triads: ClassVar[bool] = False

    @cached_property
    def strains(self) -> tuple[str, ...]:
        return ("elongation",)

    def evaluate(self, delta: Array, ti: Array, tj: Array, rest: Array) -> tuple[Array, Array]:
        length = np.sqrt(dot(delta, delta))[..., None]
        return length - rest, (delta / length)[..., None, :]

    def add_curvature(self, out: Array, delta: Array, ti: Array, tj: Array, stress: Array) -> None:
        """(I - c c^T) N/l: the string stiffness of a member under tension N."""
        length = np.sqrt(dot(delta, delta))
        tension = stress[..., 0] / length
        out -= outer((tension / length**2)[..., None] * delta, delta)
        add_scaled_identity(out, tension)


@dataclass(frozen=True)
class ElasticBar(Bar):
    """A bar whose stiffness number is ES (N): what a drive winds or extends changes its stiffness ES/L too."""

    per_length: ClassVar[bool] = True
