"""A group of elements in one kind of solution: its links, and how each of its strains acts.

A strain is elastic (stress S e), rigid (e = 0 with a multiplier) or released (no stress), as in the formulation by
generalised strains (Besseling 1974; Jonker and Meijaard 1990): masks, not code, tell them apart, so that all groups
take the same array operations.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.equilibrium.links import LinkMap
from pkmcal_cli.equilibrium.path_map import PathMap
from pkmcal_cli.mechanism.topology import Group, Index


@dataclass(frozen=True, kw_only=True)
class GroupMap:
    """A group of elements in a system."""

    group: Group
    map: LinkMap
    elastic: Array  # (E, m) 1 where the strain acts through its stiffness
    stressed: Array  # (E, m) 1 where the prestress acts
    rigid: tuple[Index, Index]  # element and strain of each constraint
    rows: slice  # global constraint numbers
    ropes: NDArray[np.bool_] | None  # (E,) elements that pull through their stiffness and never push; None: none does

    @cached_property
    def paths(self) -> PathMap | None:
        """What couples the links of paths; None where every element has one link."""
        return None if self.group.path is None else PathMap.of(self.group, self.map, self.inputs)

    @property
    def yields(self) -> bool:
        """Whether any strain acts through a stiffness."""
        return bool(self.elastic.any())

    @cached_property
    def inputs(self) -> Index:
        """The element's inputs that can be non-zero, (I,)."""
        inputs = self.group.element.inputs
        return self.map.topology.inputs[self.map.topology.inputs < inputs]
