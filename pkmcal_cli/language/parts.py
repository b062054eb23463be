"""The parts of a machine that stand or move: parameters, frames, guides, nodes, bodies, loads."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field, PrivateAttr

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
    Place,
    Point,
    RotationalStiffness,
    RotationCoupling,
    SecondMoment,
    TemperatureUnit,
    TimeUnit,
    Torque,
    TranslationCoupling,
    Turn,
    UnitText,
)
from pkmcal_cli.language.quantities import Measure
from pkmcal_cli.units.dimensions import NUMBER, Dimension
from pkmcal_cli.units.file_units import FileUnits


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
        return FileUnits.of(self.model_dump())


class Ranges(Entity):
    """Default ranges of parameters by dimension (half-width about nominal = 2 std)."""

    length: Length | None = Field(default=None, description="Range of every length, e.g. 0.1 mm")
    angle: Angle | None = Field(default=None, description="Range of every angle, e.g. 1e-4 rad")
    scale: Number | None = Field(default=None, description="Range of every plain number, e.g. 1e-3")
    stiffness: LinearStiffness | None = Field(default=None, description="Range of force/length")
    rotational_stiffness: RotationalStiffness | None = Field(default=None, description="Range of torque/angle")
    coupling_stiffness: MixedCoupling | None = Field(default=None, description="Range of force/angle")
    bending_stiffness: BendingStiffness | None = Field(default=None, description="Range of EI and GJ")
    modulus: Modulus | None = Field(default=None, description="Range of E and G")
    force: Force | None = Field(default=None, description="Range of forces and of EA")
    torque: Torque | None = Field(default=None, description="Range of moments")
    mass: Mass | None = Field(default=None, description="Range of masses")
    density: Density | None = Field(default=None, description="Range of densities")
    area: Area | None = Field(default=None, description="Range of areas")
    second_moment: SecondMoment | None = Field(default=None, description="Range of second moments")
    acceleration: Acceleration | None = Field(default=None, description="Range of accelerations")


ParameterValue = Annotated[float, Measure(NUMBER)]
"""Read as a quantity of numbers only; a float (SI) after reading."""


class Parameter(Entity):
    """A number of the machine that can be identified; all values SI after reading."""

    noun: ClassVar[str] = "parameter"
    for_others: ClassVar[bool] = True
    shorthand: ClassVar[str | None] = "nominal"

    nominal: ParameterValue = Field(description="Nominal value, from the drawing")
    range: ParameterValue = Field(
        default=0.0,
        description="Half-width about nominal, 2 std of the prior; default from `ranges`",
    )
    unit: UnitText = Field(default="", description="Unit of bare numbers here, and for display: N/mm")
    bounds: tuple[ParameterValue, ParameterValue] | None = Field(
        default=None, description="[min, max] that a fit respects"
    )
    identify: bool = Field(default=True, description="false: a fit leaves it alone unless selected")
    per: Literal["session"] | None = Field(default=None, description="session: one for every session (sensors only)")
    note: str | None = Field(default=None, description="A remark for people")
    _dimension: Dimension = PrivateAttr(NUMBER)

    @property
    def dimension(self) -> Dimension:
        """What it is: a length, an angle, a stiffness ..."""
        return self._dimension


class Frame(Entity):
    """A frame fixed to the base; it may depend on parameters."""

    noun: ClassVar[str] = "frame"
    for_others: ClassVar[bool] = True

    at: Point = Field(default=(), description="Origin in base axes; default 0")
    turn: Turn = Field(
        default=(),
        description="Angle (planar) or rotation vector [rx, ry, rz] (spatial); default 0",
    )


class Stiffness(Entity):
    """Stiffness by direction; unnamed ones are ideal. A bare value: all blocked translations."""

    shorthand: ClassVar[str | None] = "radial"

    radial: LinearStiffness | None = Field(default=None, description="Of every blocked translation")
    x: LinearStiffness | None = Field(default=None, description="Along x")
    y: LinearStiffness | None = Field(default=None, description="Along y")
    z: LinearStiffness | None = Field(default=None, description="Along z")
    rx: RotationalStiffness | None = Field(default=None, description="About x")
    ry: RotationalStiffness | None = Field(default=None, description="About y")
    rz: RotationalStiffness | None = Field(default=None, description="About z")
    x_y: TranslationCoupling | None = Field(default=None, description="Coupling of x and y")
    x_z: TranslationCoupling | None = Field(default=None, description="Coupling of x and z")
    x_rx: MixedCoupling | None = Field(default=None, description="Coupling of x and rx")
    x_ry: MixedCoupling | None = Field(default=None, description="Coupling of x and ry")
    x_rz: MixedCoupling | None = Field(default=None, description="Coupling of x and rz")
    y_z: TranslationCoupling | None = Field(default=None, description="Coupling of y and z")
    y_rx: MixedCoupling | None = Field(default=None, description="Coupling of y and rx")
    y_ry: MixedCoupling | None = Field(default=None, description="Coupling of y and ry")
    y_rz: MixedCoupling | None = Field(default=None, description="Coupling of y and rz")
    z_rx: MixedCoupling | None = Field(default=None, description="Coupling of z and rx")
    z_ry: MixedCoupling | None = Field(default=None, description="Coupling of z and ry")
    z_rz: MixedCoupling | None = Field(default=None, description="Coupling of z and rz")
    rx_ry: RotationCoupling | None = Field(default=None, description="Coupling of rx and ry")
    rx_rz: RotationCoupling | None = Field(default=None, description="Coupling of rx and rz")
    ry_rz: RotationCoupling | None = Field(default=None, description="Coupling of ry and rz")


class Guide(Entity):
    """A straight guide of the base on which carriages travel; axes of its frame."""

    noun: ClassVar[str] = "guide"
    for_others: ClassVar[bool] = True

    frame: str | None = Field(default=None, description="Frame that it lies in; default the base")
    at: Point = Field(default=(), description="Where travel 0 is, in the frame's axes; default 0")
    along: Axis = Field(default="x", description="Direction of travel: x, y, z, -x ... or a vector")
    stiffness: Stiffness | None = Field(
        default=None, description="Of guidance, by direction in the frame's axes; default ideal"
    )


class Node(Entity):
    """A free point of the structure; its place in the drawing."""

    noun: ClassVar[str] = "node"
    for_others: ClassVar[bool] = True
    shorthand: ClassVar[str | None] = "at"

    at: Point = Field(description="Place in the drawing, base axes, near enough")
    mass: Mass | None = Field(default=None, description="Mass at the point")
    fixed: Fixed = Field(default=(), description="Held directions: true (all) or [x, y, z, rx, ry, rz]")


class Body(Entity):
    """A rigid platform, or a carriage `on` a guide, with points at fixed offsets."""

    noun: ClassVar[str] = "body"
    driven_by: ClassVar[tuple[str, ...]] = ("moves", "turns")

    at: Place = Field(description="Place of its origin in the drawing; on a guide: the travel")
    turn: Turn = Field(default=(), description="Orientation in the drawing; default 0")
    on: str | None = Field(default=None, description="Guide that it rides")
    points: dict[Name, Point] = Field(default={}, description="Its points, in its own axes")
    mass: Mass | None = Field(default=None, description="Mass")
    centre: Point = Field(default=(), description="Centre of mass, in its own axes; default 0")
    fixed: Fixed = Field(default=(), description="Held directions: true (all) or [x, y, z, rx, ry, rz]")


class Load(Entity):
    """A force and a moment at a point, base axes."""

    noun: ClassVar[str] = "load"

    at: str = Field(description="Node, body or body's point")
    force: ForceVector = Field(default=(), description="Force in base axes")
    moment: Moment = Field(default=(), description="Moment: a number (planar) or a vector (spatial)")
