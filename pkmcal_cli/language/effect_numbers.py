"""Numbers of an effect, as a machine file writes them and in SI; angles instead of lengths where things turn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Generic, TypeAlias

from pydantic import Field

from pkmcal_cli.language.fields import Entity
from pkmcal_cli.language.parts import NONE, ParameterValue
from pkmcal_cli.language.quantities import F, WrittenNumber

ROTARY, LINEAR = "rotary", "linear"
"""How groups end whose drives turn, and whose drives move, where a machine has both."""


class EffectNumber(Entity, Generic[F]):
    """A parameter or constant of an effect: a value, or an interval [from, to]."""

    shorthand: ClassVar[str | None] = "value"

    value: ParameterValue[F] = Field(default=NONE, description="Estimate; 0: no effect")
    std: ParameterValue[F] | None = Field(
        default=None, description="Standard uncertainty of the estimate (for information only)"
    )
    range: ParameterValue[F] | None = Field(
        default=None, description="Half-width, 2 std of the prior; default: plausible range"
    )
    bounds: tuple[ParameterValue[F], ParameterValue[F]] | None = Field(
        default=None, description="[min, max] that a fit respects"
    )
    interval: tuple[ParameterValue[F], ParameterValue[F]] | None = Field(
        default=None, description="Interval [from, to]"
    )
    numbers: tuple[ParameterValue[F], ...] | None = Field(
        default=None, description="Numbers, one for each knot of a shape without a name"
    )
    matrix: tuple[tuple[ParameterValue[F], ...], ...] | None = Field(
        default=None, description="Covariance of the values at the knots, by rows"
    )
    identify: bool | None = Field(
        default=None, description="false: held fixed in a fit unless selected; default: true, unless its value is known"
    )
    note: str | None = Field(default=None, description="Comment")

    @classmethod
    def expanded(cls, raw: Any) -> Any:
        """The map that a bare value stands for: a list is an interval, or numbers, or rows of a matrix."""
        if not isinstance(raw, list | tuple):
            return super().expanded(raw)
        if raw and all(isinstance(row, list | tuple) for row in raw):
            return {"matrix": tuple(tuple(row) for row in raw)}
        return {"interval" if len(raw) == 2 else "numbers": tuple(raw)}


Entries = dict[str, EffectNumber]
WrittenEntries: TypeAlias = "Mapping[str, EffectNumber[WrittenNumber]]"


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
