"""What the effect sites of a machine are collected from."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.compiler.drives import PlacedDrive
from pkmcal_cli.compiler.structure import Structure
from pkmcal_cli.mechanism.topology import Group, Index, Topology
from pkmcal_cli.model.effect_sites import EffectSite
from pkmcal_cli.model.observed import PlacedSensor

Named = Iterator[tuple[str, tuple[EffectSite, ...]]]
"""Names of places, and the effect sites of each."""
ONE = np.ones((1, 1))


@dataclass(frozen=True)
class SiteCollector:
    """A structure that is put together, with its drives and sensors."""

    structure: Structure
    topology: Topology
    drives: Sequence[PlacedDrive]
    sensors: Sequence[PlacedSensor]
    reference: Array  # (S,) coefficients with the drives at the reference configuration
    tool: str  # what a payload is at: the sensor that sees the tool point, else the point

    @property
    def axes(self) -> int:
        return 2 if self.topology.planar else 3

    def offset(self, kind: str, name: str) -> Index:
        """Coefficients (3,) of an anchored offset vector."""
        return np.array(self.structure.builder.offsets[self.structure.anchors[kind, name]], dtype=np.intp)

    def places_of(self, element: str) -> Iterator[tuple[int, int, Group]]:
        """Places of an element of this name, of its pieces NAME.0, NAME.1 ..., or of the cable that it is part of."""
        for g, group in enumerate(self.topology.groups):
            for e, name in enumerate(group.names):
                stem, _, piece = name.partition(".")
                if name == element or (stem == element and piece.isdigit()) or element in name.split("+"):
                    yield g, e, group

    @property
    def gravity(self) -> Array:
        """Unit vector of gravity in base axes, at nominal parameters; zero without."""
        parts = [q.number(self.structure.nominal) for q in self.structure.machine.gravity]
        vector = np.array(parts + [0.0] * (3 - len(parts)))
        size = float(np.sqrt(vector @ vector))
        return vector / size if size else vector


def coefficients_at(*numbers: int) -> Index:
    """Their indices as an array."""
    return np.array(numbers, dtype=np.intp)
