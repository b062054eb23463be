"""What joins the parts of a machine: materials, sections, beams, bars, ropes, joints."""

from __future__ import annotations

from typing import Any, ClassVar, Generic, Literal

from pydantic import Field

from pkmcal_cli.language.fields import (
    Area,
    AxialStiffness,
    Axis,
    BendingStiffness,
    Density,
    Entity,
    LeastForce,
    LinearStiffness,
    Mass,
    Modulus,
    Name,
    Number,
    SecondMoment,
    SectionSize,
    Size,
)
from pkmcal_cli.language.parts import Stiffness
from pkmcal_cli.language.quantities import V

JointType = Literal["revolute", "prismatic", "universal", "spherical", "cylindrical", "planar", "fixed"]
PLANAR_JOINTS: tuple[JointType, ...] = ("revolute", "prismatic", "fixed")
Two = tuple[str, str]


class Material(Entity, Generic[V]):
    """A material."""

    noun: ClassVar[str] = "material"
    for_others: ClassVar[bool] = True

    E: Modulus[V] = Field(description="Young's modulus, e.g. 210 GPa")
    nu: Number[V] | None = Field(default=None, description="Poisson's ratio")
    G: Modulus[V] | None = Field(default=None, description="Shear modulus; default: E/(2(1 + nu))")
    density: Density[V] | None = Field(default=None, description="Density, e.g. 7850 kg/m^3")


class Section(Entity, Generic[V]):
    """A cross-section: exactly one of square, rectangle, round, tube, or area with moments."""

    noun: ClassVar[str] = "section"
    for_others: ClassVar[bool] = True

    square: SectionSize[V] | None = Field(default=None, description="Side")
    rectangle: tuple[SectionSize[V], SectionSize[V]] | None = Field(
        default=None, description="[b, h]: width along the beam's y, height along its z"
    )
    round: SectionSize[V] | None = Field(default=None, description="Diameter")
    tube: tuple[SectionSize[V], SectionSize[V]] | None = Field(default=None, description="[outer, inner] diameter")
    area: Area[V] | None = Field(default=None, description="Area")
    Iy: SecondMoment[V] | None = Field(default=None, description="Second moment about the beam's y")
    Iz: SecondMoment[V] | None = Field(default=None, description="Second moment about the beam's z")
    J: SecondMoment[V] | None = Field(default=None, description="Torsion constant")


class End(Entity, Generic[V]):
    """How a beam end is connected to its node."""

    shorthand: ClassVar[str | None] = "joint"

    joint: JointType = Field(default="fixed", description="Type of the joint")
    axis: Axis[V] | None = Field(default=None, description="Axis in the reference configuration, base axes")
    axes: tuple[Axis[V], Axis[V]] | None = Field(default=None, description="The two axes of a universal joint")
    stiffness: Stiffness[V] | None = Field(default=None, description="Stiffness of the blocked directions")


FIXED_ENDS: Any = (End(), End())
"""Default of a beam's ends at any stage of reading."""


class Beam(Entity, Generic[V]):
    """A beam between two points; a deformation without a stiffness is rigid."""

    noun: ClassVar[str] = "beam"

    between: Two = Field(description="The two points that it connects")
    ends: tuple[End[V], End[V]] = Field(default=FIXED_ENDS, description="Joints at its ends")
    section: str | None = Field(default=None, description="Name of the section")
    material: str | None = Field(default=None, description="Name of the material")
    EA: AxialStiffness[V] | None = Field(default=None, description="Axial stiffness")
    EI: BendingStiffness[V] | None = Field(default=None, description="Bending stiffness (all directions)")
    EIy: BendingStiffness[V] | None = Field(default=None, description="Bending stiffness about the beam's y")
    EIz: BendingStiffness[V] | None = Field(default=None, description="Bending stiffness about the beam's z")
    GJ: BendingStiffness[V] | None = Field(default=None, description="Torsional stiffness")
    length: Size[V] | None = Field(
        default=None, description="Unstressed length; default: as in the reference configuration"
    )
    mass: Mass[V] | None = Field(default=None, description="Mass; default: from section and density")
    up: tuple[Number[V], ...] = Field(
        default=(), description="Vector in the x-z plane of the beam, base axes (spatial only)"
    )
    pieces: int = Field(default=1, ge=1, le=100, description="Number of elements that the beam is divided into")


class Axial(Entity, Generic[V]):
    """What carries axial force only; rigid without EA or k."""

    between: tuple[str, ...] = Field(description="The points that it connects")
    length: Size[V] | None = Field(
        default=None, description="Unstressed length; default: as in the reference configuration"
    )
    EA: AxialStiffness[V] | None = Field(default=None, description="Axial stiffness EA (force)")
    k: LinearStiffness[V] | None = Field(default=None, description="Stiffness (force/length)")
    mass: Mass[V] | None = Field(default=None, description="Mass, half at each end")


class Bar(Axial[V], Generic[V]):
    """A bar pinned at both ends."""

    noun: ClassVar[str] = "bar"
    driven_by: ClassVar[tuple[str, ...]] = ("drives",)

    between: Two = Field(description="The two points that it connects")
    spring: bool = Field(
        default=False,
        description="A spring: holds nothing in place, and need not be unstressed in the reference configuration",
    )


class Pulley(Entity, Generic[V]):
    """A pulley over which a rope runs; it turns freely."""

    radius: Size[V] = Field(description="Radius to the middle of the rope")
    side: Literal["left", "right"] | None = Field(
        default=None, description="In the plane: side of the rope on which its centre is, in the order of `between`"
    )
    axis: Axis[V] | None = Field(
        default=None,
        description="In space: axis about which it swivels, along the rope on its fixed side, towards the pulley; in "
        "the reference configuration, base axes",
    )


class Rope(Axial[V], Generic[V]):
    """A rope, belt or wire over two points or more: carries no compression."""

    noun: ClassVar[str] = "rope"
    driven_by: ClassVar[tuple[str, ...]] = ("winds",)

    between: tuple[str, ...] = Field(
        min_length=2, description="The points over which it runs, in order; a point may occur several times"
    )
    mass: Mass[V] | None = Field(default=None, description="Mass, spread over its points by length")
    pulleys: dict[Name, Pulley[V]] = Field(default={}, description="Pulleys of finite radius at its points")
    t_min: LeastForce[V] | None = Field(default=None, description="Least tension; less is a warning")


class Joint(Entity, Generic[V]):
    """A joint between two points that coincide in the reference configuration."""

    noun: ClassVar[str] = "joint"
    driven_by: ClassVar[tuple[str, ...]] = ("drives", "turns")

    between: Two = Field(description="The two points that it connects")
    type: JointType = Field(description="Type of the joint: which motions are free")
    axis: Axis[V] | None = Field(
        default=None, description="Axis in the reference configuration, base axes: x, y, z or a vector"
    )
    axes: tuple[Axis[V], Axis[V]] | None = Field(
        default=None, description="Universal joint: the axes carried by the first and the second point"
    )
    stiffness: Stiffness[V] | None = Field(
        default=None, description="Stiffness of the blocked directions; default: ideal"
    )
