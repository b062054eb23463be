"""What is fixed to the base: where its places are among the coefficients, and which sensors alone look at them."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Index = NDArray[np.intp]
NONE: Index = np.zeros((0, 3), dtype=np.intp)


@dataclass(frozen=True, kw_only=True)
class Base:
    """Coefficients of its places (B, 3) and of its frames' rotations (F, 3).

    only_seen_by (B,), rotations_only_seen_by (F,): sensors without which nothing depends on it; () if something stands
    on it.
    """

    places: Index = field(default_factory=NONE.copy)
    rotations: Index = field(default_factory=NONE.copy)
    only_seen_by: tuple[tuple[str, ...], ...] = ()
    rotations_only_seen_by: tuple[tuple[str, ...], ...] = ()

    def felt(self, sensors: Collection[str]) -> Base:
        """What of it something stands on, or one of some sensors looks at."""
        places = [not by or not set(by).isdisjoint(sensors) for by in self.only_seen_by]
        rotating = [not by or not set(by).isdisjoint(sensors) for by in self.rotations_only_seen_by]
        return Base(places=self.places[places], rotations=self.rotations[rotating])
