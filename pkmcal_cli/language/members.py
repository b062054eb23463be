"""What joins the parts of a machine: materials, sections, beams, bars, ropes, joints."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field

from pkmcal_cli.language.fields import (
    Area,
    AxialStiffness,
    Axis,
    BendingStiffness,
    Density,
    Entity,
    LinearStiffness,
    Mass,
    Modulus,
    Number,
    SecondMoment,
    SectionSize,
    Size,
)
from pkmcal_cli.language.parts import Stiffness

JointType = Literal["revolute", "prismatic", "universal", "spherical", "cylindrical", "planar", "fixed"]
PLANAR_JOINTS: tuple[JointType, ...] = ("revolute", "prismatic", "fixed")
Two = tuple[str, str]


class Material(Entity):
    """A material."""

    noun: ClassVar[str] = "material"
    for_others: ClassVar[bool] = True

    E: Modulus = Field(description="Young's modulus, e.g. 210 GPa")
    nu: Number | None = Field(default=None, description="Poisson's ratio")
    G: Modulus | None = Field(default=None, description="Shear modulus; default E/(2(1 + nu))")
    density: Density | None = Field(default=None, description="Density, e.g. 7850 kg/m^3")


class Section(Entity):
    """A cross-section: exactly one of square, rectangle, round, tube, or area with moments."""

    noun: ClassVar[str] = "section"
    for_others: ClassVar[bool] = True

    square: SectionSize | None = Field(default=None, description="Side")
    rectangle: tuple[SectionSize, SectionSize] | None = Field(
        default=None, description="[b, h]: width along the beam's y, height along its z"
    )
    round: SectionSize | None = Field(default=None, description="Diameter")
    tube: tuple[SectionSize, SectionSize] | None = Field(default=None, description="[outer, inner] diameter")
    area: Area | None = Field(default=None, description="Area")
    Iy: SecondMoment | None = Field(default=None, description="Second moment about the beam's y")
    Iz: SecondMoment | None = Field(default=None, description="Second moment about the beam's z")
    J: SecondMoment | None = Field(default=None, description="Torsion constant")


class End(Entity):
    """How a beam's end is joined to its node."""

    shorthand: ClassVar[str | None] = "joint"

    joint: JointType = Field(default="fixed", description="Type of the joint")
    axis: Axis | None = Field(default=None, description="Its axis in the drawing's base axes")
    axes: tuple[Axis, Axis] | None = Field(default=None, description="The two axes of a universal joint")
    stiffness: Stiffness | None = Field(default=None, description="Of its blocked directions")


class Beam(Entity):
    """A beam between two points; a deformation without stiffness is rigid."""

    noun: ClassVar[str] = "beam"

    between: Two = Field(description="The two points that it joins")
    ends: tuple[End, End] = Field(default=(End(), End()), description="Joints at its ends")
    section: str | None = Field(default=None, description="Name of the section")
    material: str | None = Field(default=None, description="Name of the material")
    EA: AxialStiffness | None = Field(default=None, description="Axial stiffness")
    EI: BendingStiffness | None = Field(default=None, description="Bending stiffness (all directions)")
    EIy: BendingStiffness | None = Field(default=None, description="Bending stiffness about its y")
    EIz: BendingStiffness | None = Field(default=None, description="Bending stiffness about its z")
    GJ: BendingStiffness | None = Field(default=None, description="Torsional stiffness")
    length: Size | None = Field(default=None, description="Unstressed length; default the drawing's")
    mass: Mass | None = Field(default=None, description="Mass; default from section and density")
    up: tuple[Number, ...] = Field(
        default=(), description="Vector in the plane of its x and z axes (spatial), base axes"
    )
    pieces: int = Field(default=1, ge=1, le=1000, description="Elements that it is divided into")


class Bar(Entity):
    """A bar between two points, pinned at both: axial only; without EA or k rigid."""

    noun: ClassVar[str] = "bar"
    driven_by: ClassVar[tuple[str, ...]] = ("drives",)

    between: Two = Field(description="The two points that it joins")
    length: Size | None = Field(default=None, description="Unstressed length; default the drawing's")
    EA: AxialStiffness | None = Field(default=None, description="Axial stiffness EA (force)")
    k: LinearStiffness | None = Field(default=None, description="Stiffness (force/length)")
    mass: Mass | None = Field(default=None, description="Mass, half at each end")


class Rope(Bar):
    """A rope, belt or wire between two points: carries no compression."""

    noun: ClassVar[str] = "rope"
    driven_by: ClassVar[tuple[str, ...]] = ("winds",)


class Joint(Entity):
    """A joint between two points, at the same place in the drawing."""

    noun: ClassVar[str] = "joint"
    driven_by: ClassVar[tuple[str, ...]] = ("drives", "turns")

    between: Two = Field(description="The two points that it joins")
    type: JointType = Field(description="Which motions are free")
    axis: Axis | None = Field(default=None, description="Axis in the drawing's base axes: x, y, z or a vector")
    axes: tuple[Axis, Axis] | None = Field(
        default=None, description="Universal: the axes carried by the first and the second point"
    )
    stiffness: Stiffness | None = Field(default=None, description="Of its blocked directions; else ideal")
