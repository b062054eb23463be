"""What measures a machine: sensors."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Annotated, Any, ClassVar, Generic, Literal

from pydantic import AfterValidator, BeforeValidator, Field, WithJsonSchema

from pkmcal_cli.base.errors import did_you_mean
from pkmcal_cli.language.fields import (
    SIGMA_IS,
    SPATIAL,
    Axis,
    Direction,
    Entity,
    Growth,
    Number,
    Point,
    SensorScale,
    SensorUnit,
    SensorValue,
    SigmaIs,
)
from pkmcal_cli.language.quantities import V, fault, kind_of
from pkmcal_cli.language.stated_sigma import StatedSigma
from pkmcal_cli.sensors import sensor_kinds


def _kind(word: str) -> str:
    if word not in sensor_kinds():
        kinds = sensor_kinds()
        hint = did_you_mean(word, kinds, "use one of " + ", ".join(f"`{k}`" for k in kinds))
        raise fault("value", f"unknown sensor kind `{word}`", hint)
    return word


def _names(raw: Any) -> Any:
    """One name, or a list of names."""
    if isinstance(raw, str):
        return (raw,)
    if isinstance(raw, list | tuple) and raw and all(isinstance(each, str) for each in raw):
        if len(set(raw)) < len(raw):
            raise fault("value", "a point is listed twice")
        return tuple(raw)
    raise fault("type", f"expected a point, found {kind_of(raw)}", "write, for example, `at: platform`")


def _reads(raw: Any) -> Any:
    """[x, y] as {x: "", y: ""}: columns by default."""
    if raw in ([], (), {}):
        raise fault("value", "no channel is listed", "write, for example, `reads: [x, y]`")
    if isinstance(raw, tuple | list):
        _check_channels(raw)
        if len(set(raw)) < len(raw):
            raise fault("value", "a channel is listed twice")
        return dict.fromkeys(raw, "")
    if isinstance(raw, dict):
        return raw
    raise fault("type", f"expected a list of channels, found {kind_of(raw)}", "write, for example, [x, y]")


def _check_channels(channels: Any) -> None:
    for channel in channels:
        if channel not in SPATIAL:
            hint = did_you_mean(str(channel), SPATIAL)
            raise fault("value", f"`{channel}` is not a channel of a sensor", hint)


def _sigma(raw: Any) -> Any:
    """One value, or values by channel."""
    by_channel = raw if isinstance(raw, dict) else {"": raw}
    for value in by_channel.values():
        if isinstance(value, dict | list | tuple):
            message = f"expected a number or text, found {kind_of(value)}"
            raise fault("type", message, "write, for example, `sigma: {x: 10 um}`")
    return by_channel


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
FRAMES = Literal["machine", "fitted", "fitted per session"]


class Sensor(Entity, Generic[V]):
    """An instrument; `sigma` is its stated standard uncertainty. The keys of each kind are in docs/instruments.md."""

    noun: ClassVar[str] = "sensor"
    in_own_unit: ClassVar[tuple[str, ...]] = ("sigma", "reading")
    renamed: ClassVar[Mapping[str, str]] = MappingProxyType({"on": "surface"})

    kind: KindOfSensor = Field(default="tcp", description="What the sensor measures")
    at: Points = Field(default=(), description="Measured body, point of a body or node; tcp: one or a list")
    to: str | None = Field(default=None, description="Other point of a distance or of a line")
    surface: str | None = Field(default=None, description="Frame whose plane is probed; the normal is z (planar: y)")
    drive: str | None = Field(default=None, description="Actuator whose force is measured")
    of: SensorValue[V] | None = Field(default=None, description="Expression of parameters measured on the bench")
    reading: SensorValue[V] | None = Field(
        default=None,
        description="Value measured on the bench; touch, distance: what it reads wherever it touches, 0 for a trigger "
        "probe",
    )
    axis: Axis[V] | None = Field(
        default=None, description="Axis of an angle in the reference configuration; default: z"
    )
    offset: Point[V] = Field(default=(), description="Tool offset in the body's axes; default: 0")
    reads: Reads = Field(default={}, description="Channels [x, y, z, rx, ry, rz], or {channel: column}")
    column: str = Field(
        default="", description="Column with the reading, if there is one; default: the name of the sensor"
    )
    unit: SensorUnit | None = Field(
        default=None, description='Unit of the column, or one of its own, {count: 0.5 um}; `"1"`: plain numbers'
    )
    sigma: Annotated[dict[str, StatedSigma[V]], BeforeValidator(_sigma), WithJsonSchema(_SIGMA)] = Field(
        description="Standard uncertainty: one value, e.g. 10 um or 10 um + 5 um/m, or by channel {x: ..., "
        "position: ..., orientation: ...}"
    )
    sigma_is: SigmaIs = Field(default="stated", description=SIGMA_IS)
    sigma_per_length: Growth[V] | None = Field(
        default=None,
        description="Growth of sigma with the distance from the instrument's origin, or with the length, e.g. 6 um/m, "
        "in quadrature",
    )
    correlation: dict[str, Number[V]] = Field(
        default={}, description="Correlation of the noise of two channels, e.g. {x_y: 0.3}"
    )
    zero: SensorValue[V] | None = Field(default=None, description="Measured value at reading 0; a parameter if unknown")
    scale: SensorScale[V] | None = Field(default=None, description="Measured value per unit of the reading")
    frame: FRAMES | None = Field(
        default=None,
        description="Frame of the coordinates: the machine's, or the instrument's own, in which the pose "
        "of the base (reading = R p + t) is identified once (fitted) or per session (no default)",
    )
