"""Which things turn: an effect has other numbers there, angles instead of lengths."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

ROTARY, LINEAR = "rotary", "linear"
"""How groups end whose drives turn, and whose drives move, where a machine has both."""


@dataclass(frozen=True)
class Turning:
    """Drives that turn, or sensors that read an angle, by name; groups: of the machine file."""

    turns: Mapping[str, bool]
    groups: Mapping[str, tuple[str, ...]]

    def at(self, place: str) -> bool:
        """Whether numbers of an effect at a place are those of what turns: at one, or at all of a group.

        Groups that the file does not name are of one kind; those that turn beside others end so.
        """
        members = {*self.groups.get(place, ()), *place.split("+")} & self.turns.keys()
        if not members and ROTARY in place.split("_"):
            return True
        return bool(self.turns) and all(self.turns[name] for name in members or self.turns)
