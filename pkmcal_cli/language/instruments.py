"""What drives and measures a machine: actuators and sensors."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

from pydantic import BeforeValidator, Field, WithJsonSchema

from pkmcal_cli.errors import did_you_mean
from pkmcal_cli.language.dimensions import ANGLE, LENGTH, Dimension
from pkmcal_cli.language.fields import (
    SPATIAL,
    Direction,
    DriveForceValue,
    DriveStiffness,
    Entity,
    Length,
    Number,
    Point,
    ReadingUnit,
    Scale,
    Sigma,
    Size,
    Travel,
    Zero,
)
from pkmcal_cli.language.quantities import Quantity, fault, kind_of
from pkmcal_cli.language.unit_text import parse_unit

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
    scale: Number = Field(default=ONE, description="Force (file's unit) per number of the column")


class Actuator(Entity):
    """A drive: exactly one of moves, drives, turns, winds names what it acts on.

    Position: travel = zero + scale * ratio * reading (spool: rope length with its radius).
    """

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
    control: Literal["position", "force"] = Field(default="position", description="What is commanded")
    force: DriveForce | None = Field(default=None, description="Force: a number or {column, otherwise}")
    stiffness: DriveStiffness | None = Field(default=None, description="Of the drive; default ideal")
    limits: tuple[Travel, Travel] | None = Field(default=None, description="[low, high] of the reading")
    scale: Scale = Field(default=ONE, description="Travel per unit of reading")
    ratio: Number = Field(default=ONE, description="Transmission ratio")
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


def _reads(raw: Any) -> Any:
    """[x, y] as {x: "", y: ""}: columns by default."""
    if isinstance(raw, tuple | list):
        _check_channels(raw)
        if len(set(raw)) < len(raw):
            raise fault("value", "a channel is listed twice")
        return dict.fromkeys(raw, "")
    if isinstance(raw, dict):
        return raw
    raise fault("type", f"a list of channels is wanted here, not {kind_of(raw)}", "[x, y]")


def _check_channels(channels: Any) -> None:
    for channel in channels:
        if channel not in SPATIAL:
            hint = did_you_mean(str(channel), SPATIAL)
            raise fault("value", f"`{channel}` is no channel of a TCP sensor", hint)


def _sigma(raw: Any) -> Any:
    return raw if isinstance(raw, dict) else {"": raw}


_CHANNELS = {"enum": list(SPATIAL)}
_QUANTITY = {"type": ["number", "string"]}
_READS = {
    "anyOf": [
        {"type": "array", "items": _CHANNELS, "minItems": 1, "uniqueItems": True},
        {
            "type": "object",
            "propertyNames": _CHANNELS,
            "additionalProperties": {"type": "string"},
            "minProperties": 1,
        },
    ]
}
_SIGMA = {
    "anyOf": [
        _QUANTITY,
        {
            "type": "object",
            "propertyNames": {"enum": ["position", "orientation", *SPATIAL]},
            "additionalProperties": _QUANTITY,
        },
    ]
}
Reads = Annotated[dict[Direction, str], BeforeValidator(_reads), WithJsonSchema(_READS)]
SigmaByChannel = Annotated[dict[str, Sigma], BeforeValidator(_sigma), WithJsonSchema(_SIGMA)]


class Sensor(Entity):
    """An instrument; `sigma` is its stated standard uncertainty."""

    kind: Literal["tcp"] = Field(default="tcp", description="tcp: coordinates and orientation of a point")
    at: str = Field(description="Body, body's point or node that is measured")
    offset: Point = Field(default=(), description="Tool offset in the body's axes; default 0")
    reads: Reads = Field(description="Channels [x, y, z, rx, ry, rz], or {channel: column}")
    sigma: SigmaByChannel = Field(description="A value, or by channel: {x: ..., position: ..., orientation: ...}")
    frame: Literal["machine", "fitted"] = Field(
        description="Where it measures: machine, or in a frame of its own whose pose is identified (no default)"
    )
