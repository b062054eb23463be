"""How the freedoms of a mechanism move its tool point, and which of its coordinates say where the mechanism is.

At the reference configuration, with all drives released, the point moves by the columns of J (coordinates by
freedoms), lengths in sizes of the machine, angles in rad. U, an orthonormal basis of these columns, has a row for each
coordinate: coordinates S are independent if the smallest singular value of U_S is not zero. Its inverse says how far
the others go at most while these go by one.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np

from pkmcal_cli.base.rotation import Array

DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
_DEPENDENT = 1e-3  # coordinates that hold the others no better than this are not independent
_AS_GOOD = 0.1  # a set is as good as the best one if it holds the others this well
_RANK = 1e-8  # singular values below this share of the largest are zero


@dataclass(frozen=True)
class AimedPoint:
    """A point that poses can be asked for at: its number among those that are read, its rotation (0: none).

    aims: groups of `Topology.aims` that hold it; reference (6,): its pose at the assembled reference configuration.
    """

    point: int
    rotation: int
    aims: tuple[int, ...]
    reference: Array


@dataclass(frozen=True)
class ToolMotion:
    """Coordinates that a point has, in the order x ... rz, and how they move by the mechanism's freedoms.

    freedoms: of the mechanism; the point may show fewer.
    """

    names: tuple[str, ...]
    basis: Array  # (k, r) orthonormal, of what the tool point shows of the freedoms
    freedoms: int

    @classmethod
    def of(cls, names: tuple[str, ...], jacobian: Array) -> ToolMotion:
        """From the coordinates' motion (k, f) by the freedoms."""
        left, size, _ = np.linalg.svd(jacobian, full_matrices=False)
        shown = size > _RANK * max(float(size.max(initial=0.0)), 1.0)
        return cls(names, left[:, shown], jacobian.shape[1])

    @property
    def shown(self) -> int:
        """How many freedoms the tool point shows."""
        return int(self.basis.shape[1])

    def moves(self, name: str) -> bool:
        """Whether a coordinate moves at all."""
        return self._holding((name,)) > 0

    @cached_property
    def only_turns(self) -> bool:
        """Whether the point stays in its place, and its body turns about it: errors of such machines are angles."""
        return self.shown > 0 and not any(self.moves(name) for name in self.names if name in DIRECTIONS[:3])

    def independent(self, names: Collection[str]) -> bool:
        """Whether some coordinates move each without the others."""
        return not names or self._holding(tuple(names)) > 0

    def _holding(self, names: tuple[str, ...]) -> float:
        """How well coordinates are held apart and hold the others, at most 1; 0 if they are not independent."""
        rows = self.basis[[self.names.index(n) for n in names if n in self.names]]
        if len(rows) < len(names) or len(names) > self.shown:
            return 0.0
        least = float(np.linalg.svd(rows, compute_uv=False)[-1])
        return least if least > _DEPENDENT else 0.0

    @cached_property
    def sets(self) -> tuple[tuple[str, ...], ...]:
        """All sets of coordinates that say where the tool point is, those first that hold it well, in order x ... rz.

        The first one is the usual one.
        """
        every: list[tuple[str, ...]] = list(combinations(self.names, self.shown))
        held = {s: self._holding(s) if s else 1.0 for s in every}
        enough = _AS_GOOD * max(held.values())
        return tuple(sorted((s for s in held if held[s] > 0), key=lambda s: held[s] < enough))

    def with_all(self, names: Collection[str]) -> tuple[str, ...] | None:
        """The usual set that contains some coordinates; None where they are not independent.

        Who asks for an orientation has others of it kept, not places: of a head that tilts, not where its tip goes.
        """
        turning = any(n.startswith("r") for n in names)
        sets = [s for s in self.sets if set(names) <= set(s)]
        return max(sets, key=lambda s: sum(n.startswith("r") for n in s) if turning else 0, default=None)

    def out_of(self, names: Collection[str]) -> tuple[str, ...] | None:
        """The usual set made of some coordinates only; None where these do not say where the tool point is."""
        return next((s for s in self.sets if set(s) <= set(names)), None)

    def most_of(self, names: Collection[str]) -> tuple[str, ...]:
        """The usual set with as many of some coordinates as are independent."""
        return max(self.sets, key=lambda s: len(set(s) & set(names)), default=())
