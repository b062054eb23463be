"""What drives a machine: actuators."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Generic, Literal

from pydantic import BeforeValidator, Field, WithJsonSchema

from pkmcal_cli.language.fields import (
    SIGMA_IS,
    DriveForceValue,
    DriveStiffness,
    Entity,
    Factor,
    ForceLimit,
    Length,
    Multiple,
    Name,
    ReadingUnit,
    Scale,
    Sigma,
    SigmaIs,
    Size,
    Travel,
    Zero,
)
from pkmcal_cli.language.quantities import Quantity, V, fault, kind_of
from pkmcal_cli.units.dimensions import ANGLE, LENGTH, Dimension
from pkmcal_cli.units.unit_text import parse_unit

ONE: Any = Quantity.constant(1.0)
AT_ZERO: Any = Quantity.constant(0.0, LENGTH)
"""Defaults of values of any stage of reading."""
ActuatorKind = Literal["carriage", "leg", "crank", "spool"]
KINDS: dict[str, ActuatorKind] = {
    "moves": "carriage", "drives": "leg", "turns": "crank", "winds": "spool",
}  # fmt: skip
"""The kind that each key of an actuator implies."""


def _weighted(raw: Any) -> Any:
    """A name stands for itself, once."""
    if isinstance(raw, str):
        return {raw: 1}
    if not isinstance(raw, dict):
        hint = "write `winds: rope1`, or `winds: {rope1: 1, rope2: 2}` for a weighted sum"
        raise fault("type", f"expected a name, or names with weights, found {kind_of(raw)}", hint)
    return raw


_WEIGHTED = {
    "anyOf": [
        {"type": "string"},
        {"type": "object", "minProperties": 1, "additionalProperties": {"type": ["number", "string"]}},
    ]
}
Weighted = Annotated[dict[Name, Multiple[V]], BeforeValidator(_weighted), WithJsonSchema(_WEIGHTED)]


class DriveForce(Entity, Generic[V]):
    """Force of an actuator: from a column, otherwise a constant."""

    shorthand: ClassVar[str | None] = "otherwise"

    column: str | None = Field(default=None, description="Column with the force")
    otherwise: DriveForceValue[V] | None = Field(default=None, description="Force where the column gives none")
    scale: Factor[V] = Field(default=ONE, description="Force (file's unit) per unit of the column")


class Actuator(Entity, Generic[V]):
    """An actuator: exactly one of moves, drives, turns, winds names what it acts on.

    Position: travel = zero + scale * ratio * reading (spool: rope length with its radius and its folds).
    """

    noun: ClassVar[str] = "actuator"
    in_own_unit: ClassVar[tuple[str, ...]] = ("limits", "sigma", "period")

    moves: str | None = Field(default=None, description="Body on a guide (carriage)")
    drives: str | None = Field(default=None, description="Bar or prismatic joint (telescopic leg)")
    turns: str | None = Field(default=None, description="Body or revolute joint (crank)")
    winds: Weighted[V] | None = Field(
        default=None, description="Rope (spool), or ropes whose weighted sum of lengths it sets: {rope1: 1, rope2: 2}"
    )
    kind: ActuatorKind = Field(
        default="carriage",
        description="Implied by moves, drives, turns, winds",
        json_schema_extra={"default": None},
    )
    redundant: bool = Field(default=False, description="Not part of the non-redundant substructure")
    control: Literal["position", "force", "passive"] = Field(
        default="position", description="What is commanded; passive: nothing, the encoder is only read"
    )
    force: DriveForce[V] | None = Field(default=None, description="Force: a number or {column, otherwise}")
    stiffness: DriveStiffness[V] | None = Field(default=None, description="Stiffness of the actuator; default: ideal")
    force_limit: ForceLimit[V] | None = Field(
        default=None, description="Largest force (crank: torque) of the actuator; more is a warning"
    )
    limits: tuple[Travel[V], Travel[V]] | None = Field(
        default=None, description="Travel limits [low, high] of the reading"
    )
    scale: Scale[V] = Field(default=ONE, description="Travel per unit of reading")
    ratio: Factor[V] = Field(default=ONE, description="Transmission ratio")
    radius: Size[V] | None = Field(default=None, description="Radius of a spool")
    folds: Multiple[V] | None = Field(
        default=None, description="Strands of a tackle: line that a spool winds per travel of its rope; default: 1"
    )
    zero: Zero[V] = Field(
        default=AT_ZERO,
        description="Travel (leg, spool: length) at reading 0; `home`: unstressed in the reference configuration",
    )
    offset: Length[V] | None = Field(default=None, description="Leg: length = offset + travel")
    column: str = Field(default="", description="Column with the reading; default: the name of the actuator")
    unit: ReadingUnit | None = Field(
        default=None, description="Unit of the column, e.g. deg or mm, or one of its own, {step: 1.25 um}"
    )
    sigma: Sigma[V] | None = Field(default=None, description="Standard uncertainty of the reading, as travel")
    sigma_is: SigmaIs = Field(default="stated", description=SIGMA_IS)
    period: Sigma[V] | None = Field(
        default=None,
        description=(
            "Lead of the screw, turn of a motor or wave generator, or period of the encoder, as travel; "
            "default: of a drum one turn, else none"
        ),
    )

    @property
    def holds(self) -> bool:
        """Whether it holds its position; the reading of one that does not is a measurement."""
        return self.control == "position"

    @property
    def target(self) -> str:
        """The name of what it acts on; of several ropes that are one cable, all names."""
        return self.moves or self.drives or self.turns or "+".join(self.winds or ())

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
