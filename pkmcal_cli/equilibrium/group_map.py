"""A group of elements in one kind of solution: its links, and how each of its strains acts."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.equilibrium.links import LinkMap
from pkmcal_cli.mechanism.topology import Group, Index


@dataclass(frozen=True)
class GroupMap:
    """A group of elements in a system."""

    group: Group
    map: LinkMap
    elastic: Array  # (E, m) 1 where the strain acts through its stiffness
    stressed: Array  # (E, m) 1 where the prestress acts
    rigid: tuple[Index, Index]  # element and strain of each constraint
    rows: slice  # global constraint numbers

    @property
    def yields(self) -> bool:
        """Whether any strain acts through a stiffness."""
        return bool(self.elastic.any())

    @cached_property
    def inputs(self) -> Index:
        """The element's inputs that can be non-zero, (I,)."""
        inputs = self.group.element.inputs
        return self.map.layout.inputs[self.map.layout.inputs < inputs]
