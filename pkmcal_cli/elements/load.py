"""A constant force at a point, as an element: its strains are the point's coordinates, its prestress the force."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.elements.base import Element


@dataclass(frozen=True)
class Load(Element):
    """Coordinates of port j relative to port i (the base); energy -f . u when the prestress is -f (N)."""

    uses_triads: ClassVar[bool] = False
    curved: ClassVar[bool] = False

    @cached_property
    def strains(self) -> tuple[str, ...]:
        return ("x", "y", "z")

    @cached_property
    def patterns(self) -> Array:
        """No stiffness."""
        return np.zeros((0, 3, 3))

    def evaluate(self, delta: Array, ti: Array, tj: Array, rest: Array) -> tuple[Array, Array]:
        return delta - rest, np.broadcast_to(np.eye(3), (*delta.shape, 3))

    def add_curvature(self, out: Array, delta: Array, ti: Array, tj: Array, stress: Array) -> None:
        """Coordinates are linear: nothing."""
