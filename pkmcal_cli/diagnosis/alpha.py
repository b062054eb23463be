"""The false-alarm rate of a diagnosis, and what it is spent on."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Alpha:
    """False-alarm rate of the whole diagnosis, and its parts."""

    total: float

    @property
    def catalogue(self) -> float:
        """For the effects of the catalogue."""
        return 0.6 * self.total

    @property
    def groups(self) -> float:
        """For what depends on pose, time ... and is in no catalogue."""
        return 0.2 * self.total

    @property
    def rows(self) -> float:
        """For single bad rows."""
        return 0.2 * self.total
