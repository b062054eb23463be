"""The parts of a machine that stand or move: parameters, frames, guides, nodes, bodies, loads."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from types import MappingProxyType
from typing import Annotated, Any, ClassVar, Generic, Literal, TypeAlias

from pydantic import BeforeValidator, Field, PrivateAttr, WithJsonSchema

from pkmcal_cli.language.fields import (
    Acceleration,
    Angle,
    AngleUnit,
    Area,
    Axis,
    BendingStiffness,
    Density,
    Entity,
    Fixed,
    Force,
    ForceUnit,
    ForceVector,
    Length,
    LengthUnit,
    LinearStiffness,
    Mass,
    MassUnit,
    MixedCoupling,
    Modulus,
    Moment,
    Name,
    Number,
    Point,
    PointOrTravel,
    RotationalStiffness,
    RotationCoupling,
    RotationVector,
    SecondMoment,
    TemperatureUnit,
    TimeUnit,
    Torque,
    TranslationCoupling,
    UnitText,
)
from pkmcal_cli.language.quantities import F, Measure, V, WrittenNumber, fault
from pkmcal_cli.units.dimensions import NUMBER, Dimension
from pkmcal_cli.units.file_units import BASE_DIMENSIONS, FileUnits


def _adjustable(raw: Any) -> Any:
    """`true` as a word, `false` as nothing; else what is adjusted, in one line."""
    if isinstance(raw, str) and raw and not (raw.strip() and raw.isprintable()):
        raise fault("value", "`adjustable` does not say in one line what is adjusted", 'write, e.g. "rail A, left end"')
    return ("true" if raw else "") if isinstance(raw, bool) else raw


Adjustable = Annotated[
    str, BeforeValidator(_adjustable), WithJsonSchema({"anyOf": [{"type": "boolean"}, {"type": "string"}]})
]


class Units(Entity):
    """The units of bare numbers in this file; derived units follow (stiffness = force/length)."""

    length: LengthUnit = Field(default="m", description="Unit of bare lengths: m, mm, um ...")
    angle: AngleUnit = Field(default="rad", description="Unit of bare angles: rad, deg, mrad ...")
    force: ForceUnit = Field(default="N", description="Unit of bare forces: N, kN ...")
    mass: MassUnit = Field(default="kg", description="Unit of bare masses: kg, g, t")
    time: TimeUnit = Field(default="s", description="Unit of bare times: s, ms, min, h")
    temperature: TemperatureUnit = Field(default="degC", description="Unit of bare temperatures: degC, K")

    @property
    def table(self) -> FileUnits:
        """The units as objects, with the derived ones."""
        return _table(*(getattr(self, key) for key in BASE_DIMENSIONS))


@lru_cache(maxsize=64)
def _table(*texts: str) -> FileUnits:
    """That of unit texts in the order of `BASE_DIMENSIONS`: asked for with every column of every table."""
    return FileUnits.of(dict(zip(BASE_DIMENSIONS, texts, strict=True)))


class Ranges(Entity, Generic[V]):
    """Default ranges of parameters by dimension (half-width about nominal = 2 std)."""

    length: Length[V] | None = Field(default=None, description="Range of every length, e.g. 0.1 mm")
    angle: Angle[V] | None = Field(default=None, description="Range of every angle, e.g. 1e-4 rad")
    scale: Number[V] | None = Field(default=None, description="Range of every plain number, e.g. 1e-3")
    stiffness: LinearStiffness[V] | None = Field(default=None, description="Range of force/length")
    rotational_stiffness: RotationalStiffness[V] | None = Field(default=None, description="Range of torque/angle")
    coupling_stiffness: MixedCoupling[V] | None = Field(default=None, description="Range of force/angle")
    bending_stiffness: BendingStiffness[V] | None = Field(default=None, description="Range of EI and GJ")
    modulus: Modulus[V] | None = Field(default=None, description="Range of E and G")
    force: Force[V] | None = Field(default=None, description="Range of forces and of EA")
    torque: Torque[V] | None = Field(default=None, description="Range of moments")
    mass: Mass[V] | None = Field(default=None, description="Range of masses")
    density: Density[V] | None = Field(default=None, description="Range of densities")
    area: Area[V] | None = Field(default=None, description="Range of areas")
    second_moment: SecondMoment[V] | None = Field(default=None, description="Range of second moments")
    acceleration: Acceleration[V] | None = Field(default=None, description="Range of accelerations")


NONE: Any = 0.0
"""Default of a number of any stage of reading."""
ParameterValue = Annotated[F, Measure(NUMBER)]
"""Read as a quantity of numbers only; a float (SI) after reading."""


class Parameter(Entity, Generic[F]):
    """A parameter that can be identified; its values are in SI units after reading."""

    noun: ClassVar[str] = "parameter"
    for_others: ClassVar[bool] = True
    shorthand: ClassVar[str | None] = "nominal"

    nominal: ParameterValue[F] = Field(description="Nominal value, from the drawing")
    range: ParameterValue[F] = Field(
        default=NONE,
        description="Half-width about nominal, 2 std of the prior; default: from `ranges`",
    )
    unit: UnitText = Field(default="", description="Unit of bare numbers here and of displayed values, e.g. N/mm")
    bounds: tuple[ParameterValue[F], ParameterValue[F]] | None = Field(
        default=None, description="[min, max] that a fit respects"
    )
    identify: bool = Field(default=True, description="false: held fixed in a fit unless selected")
    fixed: bool = Field(default=False, description="true: exact; never identified, and it adds no uncertainty")
    per: Literal["session"] | None = Field(
        default=None, description="session: one value per session (sensors, zeros of drives)"
    )
    adjustable: Adjustable = Field(
        default="",
        description='What shims or screws change, e.g. "rail A, left end"; true: itself; for `correct --as adjust`',
    )
    note: str | None = Field(default=None, description="Comment")
    _dimension: Dimension = PrivateAttr(default_factory=lambda: NUMBER)  # itself: a default would be copied deeply

    @property
    def dimension(self) -> Dimension:
        """What it is: a length, an angle, a stiffness ..."""
        return self._dimension


WrittenParameter: TypeAlias = "Parameter[WrittenNumber]"


_FIXED = "Fixed directions: true (all) or [x, y, z, rx, ry, rz]: components of its place and rotation vector"


class Frame(Entity, Generic[V]):
    """A frame fixed to the base or to a body; it may depend on parameters."""

    noun: ClassVar[str] = "frame"
    for_others: ClassVar[bool] = True

    body: str | None = Field(default=None, description="Body that carries the frame; default: the base")
    at: Point[V] = Field(default=(), description="Origin in the axes of the base or body; default: 0")
    turn: RotationVector[V] = Field(
        default=(),
        description="Angle (planar) or rotation vector [rx, ry, rz] (spatial); default: 0",
    )


class Stiffness(Entity, Generic[V]):
    """Stiffness by direction; directions not given are ideal. A bare value applies to all blocked translations."""

    shorthand: ClassVar[str | None] = "radial"

    radial: LinearStiffness[V] | None = Field(default=None, description="Stiffness of every blocked translation")
    x: LinearStiffness[V] | None = Field(default=None, description="Along x")
    y: LinearStiffness[V] | None = Field(default=None, description="Along y")
    z: LinearStiffness[V] | None = Field(default=None, description="Along z")
    rx: RotationalStiffness[V] | None = Field(default=None, description="About x")
    ry: RotationalStiffness[V] | None = Field(default=None, description="About y")
    rz: RotationalStiffness[V] | None = Field(default=None, description="About z")
    x_y: TranslationCoupling[V] | None = Field(default=None, description="Coupling of x and y")
    x_z: TranslationCoupling[V] | None = Field(default=None, description="Coupling of x and z")
    x_rx: MixedCoupling[V] | None = Field(default=None, description="Coupling of x and rx")
    x_ry: MixedCoupling[V] | None = Field(default=None, description="Coupling of x and ry")
    x_rz: MixedCoupling[V] | None = Field(default=None, description="Coupling of x and rz")
    y_z: TranslationCoupling[V] | None = Field(default=None, description="Coupling of y and z")
    y_rx: MixedCoupling[V] | None = Field(default=None, description="Coupling of y and rx")
    y_ry: MixedCoupling[V] | None = Field(default=None, description="Coupling of y and ry")
    y_rz: MixedCoupling[V] | None = Field(default=None, description="Coupling of y and rz")
    z_rx: MixedCoupling[V] | None = Field(default=None, description="Coupling of z and rx")
    z_ry: MixedCoupling[V] | None = Field(default=None, description="Coupling of z and ry")
    z_rz: MixedCoupling[V] | None = Field(default=None, description="Coupling of z and rz")
    rx_ry: RotationCoupling[V] | None = Field(default=None, description="Coupling of rx and ry")
    rx_rz: RotationCoupling[V] | None = Field(default=None, description="Coupling of rx and rz")
    ry_rz: RotationCoupling[V] | None = Field(default=None, description="Coupling of ry and rz")


class Guide(Entity, Generic[V]):
    """A guide for carriages: straight, on the base, a frame or a body, in its axes; or a beam, which bends."""

    noun: ClassVar[str] = "guide"
    for_others: ClassVar[bool] = True

    frame: str | None = Field(default=None, description="Frame of the guide; default: the base")
    body: str | None = Field(default=None, description="Body that carries the guide")
    beam: str | None = Field(default=None, description="Beam that is the guide; travel is the way from its first point")
    at: Point[V] = Field(default=(), description="Position at travel 0, in the axes of frame or body; default: 0")
    along: Axis[V] = Field(default="x", description="Direction of travel: x, y, z, -x ... or a vector")
    stiffness: Stiffness[V] | None = Field(
        default=None, description="Stiffness by direction, in the axes of frame, body or beam; default: ideal"
    )

    @property
    def on_base(self) -> bool:
        """Whether it is fixed to the base, in its axes."""
        return self.frame is None and self.body is None and self.beam is None


class Node(Entity, Generic[V]):
    """A free point of the structure, given by its position in the reference configuration."""

    noun: ClassVar[str] = "node"
    for_others: ClassVar[bool] = True
    shorthand: ClassVar[str | None] = "at"

    at: Point[V] = Field(description="Approximate position in the reference configuration, base axes")
    mass: Mass[V] | None = Field(default=None, description="Mass at the point")
    fixed: Fixed = Field(default=(), description=_FIXED)


class Body(Entity, Generic[V]):
    """A rigid platform, or a carriage on a `guide`, with points at fixed offsets."""

    noun: ClassVar[str] = "body"
    driven_by: ClassVar[tuple[str, ...]] = ("moves", "turns")
    renamed: ClassVar[Mapping[str, str]] = MappingProxyType({"on": "guide"})

    at: PointOrTravel[V] = Field(
        description="Position of the origin in the reference configuration; on a guide: the travel"
    )
    turn: RotationVector[V] = Field(default=(), description="Orientation in the reference configuration; default: 0")
    guide: str | None = Field(default=None, description="Guide on which the body is a carriage")
    points: dict[Name, Point[V]] = Field(default={}, description="Points of the body, in its own axes")
    mass: Mass[V] | None = Field(default=None, description="Mass")
    centre: Point[V] = Field(default=(), description="Centre of mass, in its own axes; default: 0")
    fixed: Fixed = Field(default=(), description=_FIXED)


class Load(Entity, Generic[V]):
    """A force and a moment at a point, base axes."""

    noun: ClassVar[str] = "load"

    at: str = Field(description="Node, body or point of a body")
    force: ForceVector[V] = Field(default=(), description="Force in base axes")
    moment: Moment[V] = Field(default=(), description="Moment: a number (planar) or a vector (spatial)")
