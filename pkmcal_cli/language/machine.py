"""The machine as its file says it: frozen models, one-to-one with the YAML.

`Machine` is what `machine_yaml.read_machine` gives: every `Quantity` bound, every parameter
resolved to SI floats with a range and a dimension, every default that depends on the machine
(zero vectors, columns, kinds of actuators, sigma by channel) filled in.
"""

from __future__ import annotations

from typing import Generic, TypeAlias

from pydantic import Field, PrivateAttr

from pkmcal_cli.base.errors import Fault
from pkmcal_cli.language.effect_entries import EffectName
from pkmcal_cli.language.effect_numbers import EffectNumber
from pkmcal_cli.language.fields import Axis, Entity, Gravity, Letter, Name, Point, Space
from pkmcal_cli.language.instruments import Actuator, DriveForce
from pkmcal_cli.language.members import Axial, Bar, Beam, End, Joint, JointType, Material, Pulley, Rope, Section
from pkmcal_cli.language.parts import Body, Frame, Guide, Load, Node, Parameter, Ranges, Stiffness, Units
from pkmcal_cli.language.quantities import F, Quantity, V, Written, WrittenNumber
from pkmcal_cli.language.sensing import Sensor
from pkmcal_cli.language.workspace import Workspace
from pkmcal_cli.units.file_units import FileUnits
from pkmcal_cli.yaml_source.tree import SourceMap

__all__ = [
    "Actuator", "Axial", "Axis", "Bar", "Beam", "Body", "DriveForce", "End", "Frame", "Guide", "Joint",
    "JointType", "Load", "Machine", "Material", "Node", "Parameter", "Pulley", "Ranges", "Rope",
    "Section", "Sensor", "Stiffness", "Units", "Workspace", "axis_vector",
]  # fmt: skip


class Machine(Entity, Generic[V, F]):
    """A machine: what stands, what moves, what joins, drives, loads and measures it."""

    extends: str | None = Field(default=None, description="Machine file that this file extends")
    units: Units = Field(default=Units(), description="Units of bare numbers")
    space: Space = Field(description="planar or spatial")
    gravity: Gravity[V] = Field(
        default=(), description="Acceleration in base axes, m/s^2, e.g. [0, -9.81]; default: none"
    )
    own_weight: bool = Field(default=True, description="Whether gravity acts on the masses")
    ranges: Ranges[V] = Field(default=Ranges(), description="Default ranges of parameters by dimension")
    parameters: dict[Name, Parameter[F]] = Field(default={}, description="Parameters that can be identified")
    datum: tuple[str, ...] = Field(
        default=(),
        description="Parameters held fixed at nominal if the data do not determine the pose of the base or the scale",
    )
    ground: dict[Name, Point[V]] = Field(default={}, description="Points fixed to the base")
    frames: dict[Name, Frame[V]] = Field(default={}, description="Frames fixed to the base")
    guides: dict[Name, Guide[V]] = Field(default={}, description="Guides on which carriages travel")
    nodes: dict[Name, Node[V]] = Field(default={}, description="Free points")
    bodies: dict[Name, Body[V]] = Field(default={}, description="Carriages and platforms with their points")
    materials: dict[Name, Material[V]] = Field(default={}, description="Materials of sections")
    sections: dict[Name, Section[V]] = Field(default={}, description="Cross-sections of beams")
    beams: dict[Name, Beam[V]] = Field(default={}, description="Beams with bending, torsion and elongation")
    bars: dict[Name, Bar[V]] = Field(default={}, description="Bars pinned at both ends")
    ropes: dict[Name, Rope[V]] = Field(default={}, description="Ropes, belts and wires")
    joints: dict[Name, Joint[V]] = Field(default={}, description="Joints between points")
    actuators: dict[Name, Actuator[V]] = Field(default={}, description="Actuators")
    loads: dict[Name, Load[V]] = Field(default={}, description="Forces and moments at points")
    sensors: dict[Name, Sensor[V]] = Field(default={}, description="Sensors")
    tool_point: str | None = Field(
        default=None,
        description="Point that poses, grids, sensitivities and error maps mean: node, body or point of a body; "
        "default: that of the first `tcp` sensor",
    )
    workspace: Workspace[V] | None = Field(
        default=None, description="Where measurements may be planned, in coordinates of the tool point"
    )
    effects: dict[EffectName, dict[str, EffectNumber[F]]] = Field(
        default={}, description="Effects, KEYWORD@PLACE: {PARAMETER: value}"
    )

    groups: dict[Name, tuple[str, ...]] = Field(
        default={}, description="Drives, members, guides, sensors that err alike, {upper: [q1, q2]}: a place of effects"
    )

    _source: SourceMap = PrivateAttr(default_factory=SourceMap)
    _files: tuple[tuple[str, str], ...] = PrivateAttr(())
    _warnings: tuple[Fault, ...] = PrivateAttr(())

    @property
    def source(self) -> SourceMap:
        """The place in the file of every value, by its path ("bars", "rod1", "length")."""
        return self._source

    @property
    def files(self) -> tuple[tuple[str, str], ...]:
        """(path, sha256) of the file and of those that it extends."""
        return self._files

    @property
    def warnings(self) -> tuple[Fault, ...]:
        """What is suspicious but no error."""
        return self._warnings

    @property
    def file_units(self) -> FileUnits:
        """The units of bare numbers."""
        return self.units.table

    @property
    def dimensions(self) -> int:
        """2 in the plane, 3 in space."""
        return 2 if self.space == "planar" else 3

    @property
    def has_gravity(self: Machine[Quantity, float]) -> bool:
        """Whether there is a gravity, at nominal parameters."""
        values = self.nominal_values()
        return any(q.number(values) != 0.0 for q in self.gravity)

    def nominal_values(self: Machine[V, float]) -> dict[str, float]:
        """The nominal values of all parameters, SI."""
        return {name: parameter.nominal for name, parameter in self.parameters.items()}


WrittenMachine: TypeAlias = "Machine[Written, WrittenNumber]"
"""A machine whose values are as the file writes them, not yet with units; defaults have theirs."""


def axis_vector(axis: Axis, dimensions: int) -> tuple[Quantity, ...]:
    """An axis as a vector of quantities; a letter as a constant unit vector."""
    if not isinstance(axis, str):
        return axis
    letter: Letter = axis
    component = "xyz".index(letter[-1])
    sign = -1.0 if letter.startswith("-") else 1.0
    return tuple(Quantity.constant(sign if i == component else 0.0) for i in range(dimensions))
