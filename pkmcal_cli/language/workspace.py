"""Where a machine may be sent: limits of the tool point's coordinates and of drives."""

from __future__ import annotations

from typing import Any, Generic

from pydantic import Field

from pkmcal_cli.language.fields import Angle, Axis, Entity, Length, Name, Point, Size, Travel
from pkmcal_cli.language.quantities import V

ALONG_Z: Any = "z"


class Box(Entity, Generic[V]):
    """Limits [low, high] of coordinates of the tool point."""

    x: tuple[Length[V], Length[V]] | None = Field(default=None, description="[low, high]")
    y: tuple[Length[V], Length[V]] | None = Field(default=None, description="[low, high]")
    z: tuple[Length[V], Length[V]] | None = Field(default=None, description="[low, high]")
    rx: tuple[Angle[V], Angle[V]] | None = Field(default=None, description="[low, high] of the rotation vector")
    ry: tuple[Angle[V], Angle[V]] | None = Field(default=None, description="[low, high] of the rotation vector")
    rz: tuple[Angle[V], Angle[V]] | None = Field(
        default=None, description="[low, high] of the rotation vector; in the plane of the angle"
    )


class Cylinder(Entity, Generic[V]):
    """A cylinder in which the tool point stays; in the plane a circle."""

    radius: Size[V] = Field(description="Radius")
    at: Point[V] = Field(default=(), description="Centre of its base; default: 0")
    axis: Axis[V] = Field(default=ALONG_Z, description="Direction from its base (spatial only)")
    height: Size[V] | None = Field(default=None, description="Height above its base (spatial only); default: unlimited")


class Workspace(Entity, Generic[V]):
    """Limits that hold all together; those of the actuators' `limits` hold besides."""

    box: Box[V] | None = Field(default=None, description="Limits of coordinates")
    cylinder: Cylinder[V] | None = Field(default=None, description="Cylinder around an axis; in the plane a circle")
    drives: dict[Name, tuple[Travel[V], Travel[V]]] = Field(
        default={}, description="Limits [low, high] of readings, by actuator, narrower than its `limits`"
    )
