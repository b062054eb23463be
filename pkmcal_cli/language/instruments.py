"""What drives a machine: actuators."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field

from pkmcal_cli.language.fields import (
    DriveForceValue,
    DriveStiffness,
    Entity,
    Factor,
    Length,
    ReadingUnit,
    Scale,
    Sigma,
    Size,
    Travel,
    Zero,
)
from pkmcal_cli.language.quantities import Quantity
from pkmcal_cli.units.dimensions import ANGLE, LENGTH, Dimension
from pkmcal_cli.units.unit_text import parse_unit

ONE = Quantity.constant(1.0)
ActuatorKind = Literal["carriage", "leg", "crank", "spool"]
KINDS: dict[str, ActuatorKind] = {
    "moves": "carriage", "drives": "leg", "turns": "crank", "winds": "spool",
}  # fmt: skip
"""The kind that each key of an actuator implies."""


class DriveForce(Entity):
    """A drive's force: from a column, else a constant."""

    shorthand: ClassVar[str | None] = "otherwise"

    column: str | None = Field(default=None, description="Column of the force")
    otherwise: DriveForceValue | None = Field(default=None, description="Force where there is no column")
    scale: Factor = Field(default=ONE, description="Force (file's unit) per number of the column")


class Actuator(Entity):
    """A drive: exactly one of moves, drives, turns, winds names what it acts on.

    Position: travel = zero + scale * ratio * reading (spool: rope length with its radius).
    """

    noun: ClassVar[str] = "actuator"

    moves: str | None = Field(default=None, description="Body on a guide (carriage)")
    drives: str | None = Field(default=None, description="Bar or prismatic joint (telescopic leg)")
    turns: str | None = Field(default=None, description="Body or revolute joint (crank)")
    winds: str | None = Field(default=None, description="Rope (spool)")
    kind: ActuatorKind = Field(
        default="carriage",
        description="Implied by moves, drives, turns, winds",
        json_schema_extra={"default": None},
    )
    redundant: bool = Field(default=False, description="Outside the non-redundant substructure")
    control: Literal["position", "force", "passive"] = Field(
        default="position", description="What is commanded; passive: nothing, its encoder is read"
    )
    force: DriveForce | None = Field(default=None, description="Force: a number or {column, otherwise}")
    stiffness: DriveStiffness | None = Field(default=None, description="Of the drive; default ideal")
    limits: tuple[Travel, Travel] | None = Field(default=None, description="[low, high] of the reading")
    scale: Scale = Field(default=ONE, description="Travel per unit of reading")
    ratio: Factor = Field(default=ONE, description="Transmission ratio")
    radius: Size | None = Field(default=None, description="Radius of a spool")
    zero: Zero = Field(
        default=Quantity.constant(0.0, LENGTH),
        description="Travel (leg, spool: length) at reading 0, or `home`: unstressed there",
    )
    offset: Length | None = Field(default=None, description="Leg: length = offset + travel")
    column: str = Field(default="", description="Column of its reading; default its name")
    unit: ReadingUnit | None = Field(default=None, description="Unit of the column: deg, mm")
    sigma: Sigma | None = Field(default=None, description="Standard uncertainty of the reading, as travel")
    period: Sigma | None = Field(default=None, description="Lead of its screw or period of its encoder, as travel")

    @property
    def holds(self) -> bool:
        """Whether it holds its position; the reading of one that does not is a measurement."""
        return self.control == "position"

    @property
    def target(self) -> str:
        """The name of what it acts on."""
        return self.moves or self.drives or self.turns or self.winds or ""

    @property
    def travel_dimension(self) -> Dimension:
        """Angle for a crank, else length."""
        return ANGLE if self.turns is not None else LENGTH

    @property
    def reading_dimension(self) -> Dimension:
        """Of the reading: of its `unit`, else angle for a spool with radius, else of the travel."""
        if self.unit is not None:
            return parse_unit(self.unit).dimension
        return ANGLE if self.radius is not None else self.travel_dimension
