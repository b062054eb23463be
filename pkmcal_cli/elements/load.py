"""A constant force f at a point, as an element: its strains are the point's coordinates u, its prestress -f.

So the energy is -f . u, and weights and loads need no code of their own: parameters and effects reach them as the
prestress of any other element.

The weight of a span of a beam is spread along it: along a cubic curve with ends p and unit tangents t, the integral of
the place is L (p_i + p_j) / 2 + L^2 (t_i - t_j) / 12. So forces at the ends and on the tangents, times powers of the
natural length L, act as a weight per length does: exactly where loads at the ends alone bend a beam to a cubic.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.elements.element import Element, LinkGeometry


@dataclass(frozen=True)
class LoadElement(Element):
    """Coordinates u of point j relative to point i (the base); the energy is -f . u when the prestress is -f (N)."""

    uses_triads: ClassVar[bool] = False
    curved: ClassVar[bool] = False

    @cached_property
    def strains(self) -> tuple[str, ...]:
        return ("x", "y", "z")

    @cached_property
    def patterns(self) -> Array:
        """No stiffness."""
        return np.zeros((0, 3, 3))

    def evaluate(self, link: LinkGeometry, rest: Array) -> tuple[Array, Array]:
        return link.delta - rest, np.broadcast_to(np.eye(3), (*link.delta.shape, 3))

    def add_curvature(self, out: Array, link: LinkGeometry, stress: Array) -> None:
        """Coordinates are linear: nothing."""


@dataclass(frozen=True)
class SpanWeight(LoadElement):
    """Coordinates u of point j relative to point i, as a load; the energy is -L^power f . u when the prestress is -f.

    The first strain holds the natural length; nothing resists it.
    """

    uses_triads: ClassVar[bool] = True  # as far as inputs go
    curved: ClassVar[bool] = True  # in the natural length
    slides: ClassVar[bool] = True
    power: int = 1

    @property
    def load_power(self) -> int:
        return self.power

    @cached_property
    def strains(self) -> tuple[str, ...]:
        return ("length", "x", "y", "z")

    @cached_property
    def patterns(self) -> Array:
        """No stiffness."""
        return np.zeros((0, 4, 4))

    def evaluate(self, link: LinkGeometry, rest: Array) -> tuple[Array, Array]:
        e: Array = np.zeros((*link.delta.shape[:-1], 4), dtype=link.delta.dtype, order="F")
        e[..., 1:] = link.delta
        b: Array = np.zeros((*e.shape, self.inputs), order="F")
        b[..., 1:, :3] = np.eye(3)
        return e - rest, b
