"""What sensors see of a compiled machine, and how their channels follow from it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from pkmcal_cli.mechanism.topology import Index
from pkmcal_cli.sensors import SensorKind, Sight


@dataclass(frozen=True)
class View:
    """A quantity of the structure: a coordinate of a point or an orientation, the reading or the force of a drive."""

    quantity: Literal["position", "orientation", "drive", "force"]
    index: int  # point, rotation or drive
    component: int = 0


@dataclass(frozen=True)
class Given:
    """Numbers that a law is given: views of the structure, or slots; -1 where a number is neither, that is 0."""

    views: Index  # (w,)
    slots: Index  # (w,)


@dataclass(frozen=True, kw_only=True)
class PlacedSensor:
    """A sensor at one point: its channels in the model, and which of the readings of its kind they are.

    given: what the law is given; empty where the channels are views as they are. point, rotation: -1 without.
    """

    name: str
    kind: SensorKind
    channels: Index  # (c,)
    outputs: Index  # (c,)
    given: Mapping[Sight, Given]
    point: int = -1
    rotation: int = -1

    @property
    def places(self) -> tuple[tuple[int, int], ...]:
        """(channel, component) of the coordinates of a point."""
        return tuple(p for p in self._components if p[1] < 3)

    @property
    def turns(self) -> tuple[tuple[int, int], ...]:
        """(channel, component) of the rotation vector of a body."""
        return tuple((c, k - 3) for c, k in self._components if k >= 3)

    @property
    def _components(self) -> tuple[tuple[int, int], ...]:
        if "motion" not in self.kind.sees:
            return ()
        return tuple((int(c), int(k)) for c, k in zip(self.channels, self.outputs, strict=True))
