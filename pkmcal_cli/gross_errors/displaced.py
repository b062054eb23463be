"""Readings of a place or of a point that the machine file does not mean, and how they are put back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pkmcal_cli.gross_errors.frame_turns import orientations, turned_back
from pkmcal_cli.gross_errors.plausibility import FloatArray

Names = tuple[str, ...]


@dataclass(frozen=True)
class OtherPlace:
    """Channels of points and of rotation vectors that were read from another place, by name.

    rotation (d, d) and shift (d,), m, lead from what was read to what would have been read from the stated place.
    """

    points: tuple[Names, ...]
    turns: tuple[Names, ...]
    rotation: FloatArray
    shift: FloatArray

    @property
    def turned(self) -> bool:
        """Whether it is more than a shift."""
        return not np.array_equal(self.rotation, np.eye(len(self.rotation)))

    def put_back(self, readings: FloatArray, names: Sequence[str]) -> FloatArray:
        """Readings (N, C) of channels of these names as they would have been from the stated place."""
        out = readings.copy()
        for point in self.points:
            here = [(names.index(n), k) for k, n in enumerate(point) if n in names]
            if self.turned and len(here) == len(point):
                columns = [c for c, _ in here]
                out[:, columns] = readings[:, columns] @ self.rotation.T + self.shift
            elif not self.turned:
                for column, k in here:
                    out[:, column] += self.shift[k]
        for vector in self.turns if self.turned else ():
            if all(n in names for n in vector):
                columns = [names.index(n) for n in vector]
                out[:, columns] = turned_back(readings[:, columns], readings[:, columns], self.rotation)
        return out


@dataclass(frozen=True)
class OtherPoint:
    """Channels of points that were read at another point of a body whose rotation vector was read too, by name.

    offset (d,): from the stated to the other point, in the axes of the body, m.
    """

    points: tuple[Names, ...]
    vector: Names
    offset: FloatArray

    def put_back(self, readings: FloatArray, names: Sequence[str]) -> FloatArray:
        """Readings (N, C) of channels of these names as they would have been at the stated point."""
        out = readings.copy()
        if not all(n in names for n in self.vector):
            return out
        away = orientations(readings[:, [names.index(n) for n in self.vector]]) @ self.offset  # (N, d)
        for point in self.points:
            for k, name in enumerate(point):
                if name in names:
                    out[:, names.index(name)] -= away[:, k]
        return out
