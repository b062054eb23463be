"""The reference configuration of a machine: the nominal one of its file, closed."""

from __future__ import annotations

from dataclasses import dataclass, field

from pkmcal_cli.base.rotation import Array


@dataclass(frozen=True)
class ReferenceConfiguration:
    """Travels (m) and orientations (3, 3) by name that replace those of the file."""

    translations: dict[str, float] = field(default_factory=dict)
    orientations: dict[str, Array] = field(default_factory=dict)
