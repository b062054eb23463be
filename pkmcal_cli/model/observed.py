"""What sensors see of a compiled machine, and how their channels follow from it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from pkmcal_cli.mechanism.topology import Index
from pkmcal_cli.sensors import SensorKind, Variable


@dataclass(frozen=True)
class KnownValues:
    """Where the values of a variable come from: an observed quantity, or a coefficient; -1: neither, the value is 0."""

    observed: Index  # (w,)
    coefficients: Index  # (w,)


@dataclass(frozen=True, kw_only=True)
class PlacedSensor:
    """A sensor at one point: its channels in the model, and which of the readings of its kind they are.

    known: values of the observation equation; empty where the channels are observed quantities. point, rotation: -1
    without.
    """

    name: str
    kind: SensorKind
    channels: Index  # (c,)
    outputs: Index  # (c,)
    known: Mapping[Variable, KnownValues]
    point: int = -1
    rotation: int = -1

    @property
    def places(self) -> tuple[tuple[int, int], ...]:
        """(channel, component) of the coordinates of a point."""
        return tuple(p for p in self._components if p[1] < 3)

    @property
    def rotates(self) -> tuple[tuple[int, int], ...]:
        """(channel, component) of the rotation vector of a body."""
        return tuple((c, k - 3) for c, k in self._components if k >= 3)

    @property
    def _components(self) -> tuple[tuple[int, int], ...]:
        if not self.kind.reads_coordinates:
            return ()
        return tuple((int(c), int(k)) for c, k in zip(self.channels, self.outputs, strict=True))
