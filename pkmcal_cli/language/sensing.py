"""What measures a machine: sensors."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

from pydantic import AfterValidator, BeforeValidator, Field, WithJsonSchema

from pkmcal_cli.base.errors import did_you_mean
from pkmcal_cli.language.fields import (
    SPATIAL,
    Axis,
    Direction,
    Entity,
    Growth,
    Number,
    Point,
    SensorScale,
    SensorSigma,
    SensorUnit,
    SensorValue,
)
from pkmcal_cli.language.quantities import fault, kind_of
from pkmcal_cli.sensors import sensor_kinds


def _kind(word: str) -> str:
    if word not in sensor_kinds():
        kinds = sensor_kinds()
        hint = did_you_mean(word, kinds, "one of " + ", ".join(f"`{k}`" for k in kinds))
        raise fault("value", f"there is no sensor of kind `{word}`", hint)
    return word


def _names(raw: Any) -> Any:
    """One name, or a list of names."""
    if isinstance(raw, str):
        return (raw,)
    if isinstance(raw, list | tuple) and raw and all(isinstance(each, str) for each in raw):
        if len(set(raw)) < len(raw):
            raise fault("value", "a point is listed twice")
        return tuple(raw)
    raise fault("type", f"a point is wanted here, not {kind_of(raw)}", "at: platform")


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
            raise fault("value", f"`{channel}` is no channel of a sensor", hint)


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
_POINTS = {"anyOf": [{"type": "string"}, {"type": "array", "items": {"type": "string"}, "minItems": 1}]}
KindOfSensor = Annotated[str, AfterValidator(_kind)]
Points = Annotated[tuple[str, ...], BeforeValidator(_names), WithJsonSchema(_POINTS)]
Reads = Annotated[dict[Direction, str], BeforeValidator(_reads), WithJsonSchema(_READS)]
SigmaByChannel = Annotated[dict[str, SensorSigma], BeforeValidator(_sigma), WithJsonSchema(_SIGMA)]
FRAMES = Literal["machine", "fitted", "fitted per session"]


class Sensor(Entity):
    """An instrument; `sigma` is its stated standard uncertainty. Which keys go with which kind: README.md."""

    noun: ClassVar[str] = "sensor"

    kind: KindOfSensor = Field(default="tcp", description="What it measures")
    at: Points = Field(default=(), description="Body, body's point or node that is measured; tcp: or a list of them")
    to: str | None = Field(default=None, description="The other point: of a distance, or of a line")
    on: str | None = Field(default=None, description="Frame whose plane, normal to its z (plane: y), is touched")
    drive: str | None = Field(default=None, description="Actuator whose force is read")
    of: SensorValue | None = Field(default=None, description="Expression of parameters measured on the bench")
    reading: SensorValue | None = Field(default=None, description="What was measured on the bench")
    axis: Axis | None = Field(default=None, description="Axis of an angle, as drawn; default z")
    offset: Point = Field(default=(), description="Tool offset in the body's axes; default 0")
    reads: Reads = Field(default={}, description="Channels [x, y, z, rx, ry, rz], or {channel: column}")
    column: str = Field(default="", description="Column of its reading where it reads one; default its name")
    unit: SensorUnit | None = Field(default=None, description='Unit of the column; `"1"`: plain numbers')
    sigma: SigmaByChannel = Field(description="A value, or by channel: {x: ..., position: ..., orientation: ...}")
    sigma_per_length: Growth | None = Field(
        default=None,
        description="Growth of sigma with the distance from the instrument's origin, or the length: 6 um/m",
    )
    correlation: dict[str, Number] = Field(default={}, description="Of the noise of two channels: {x_y: 0.3}")
    zero: SensorValue | None = Field(default=None, description="What is measured at reading 0; a parameter: unknown")
    scale: SensorScale | None = Field(default=None, description="What is measured per unit of the reading")
    frame: FRAMES | None = Field(
        default=None,
        description="Where coordinates are measured: machine, or in a frame of the instrument's own whose pose is "
        "identified, once or for every session (no default)",
    )
