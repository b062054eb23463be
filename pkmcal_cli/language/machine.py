"""The machine as its file says it: frozen models, one-to-one with the YAML.

`Machine` is what `machine_yaml.read_machine` gives: every `Quantity` bound, every parameter
resolved to SI floats with a range and a dimension, every default that depends on the machine
(zero vectors, columns, kinds of actuators, sigma by channel) filled in.
"""

from __future__ import annotations

from pydantic import Field, PrivateAttr

from pkmcal_cli.base.errors import Fault
from pkmcal_cli.language.effect_entries import EffectName, Entries
from pkmcal_cli.language.fields import Axis, Entity, Gravity, Letter, Name, Point, Space
from pkmcal_cli.language.instruments import Actuator, DriveForce
from pkmcal_cli.language.members import Bar, Beam, End, Joint, JointType, Material, Rope, Section
from pkmcal_cli.language.parts import Body, Frame, Guide, Load, Node, Parameter, Ranges, Stiffness, Units
from pkmcal_cli.language.quantities import Quantity
from pkmcal_cli.language.sensing import Sensor
from pkmcal_cli.units.file_units import FileUnits
from pkmcal_cli.yaml_source.tree import SourceMap

__all__ = [
    "Actuator", "Axis", "Bar", "Beam", "Body", "DriveForce", "End", "Frame", "Guide", "Joint",
    "JointType", "Load", "Machine", "Material", "Node", "Parameter", "Ranges", "Rope", "Section",
    "Sensor", "Stiffness", "Units", "axis_vector",
]  # fmt: skip


class Machine(Entity):
    """A machine: what stands, what moves, what joins, drives, loads and measures it."""

    extends: str | None = Field(default=None, description="Machine file that this one overlays")
    units: Units = Field(default=Units(), description="Units of bare numbers")
    space: Space = Field(description="planar or spatial")
    gravity: Gravity = Field(default=(), description="Acceleration in base axes, m/s^2: [0, -9.81]; default none")
    own_weight: bool = Field(default=True, description="Whether masses weigh (with gravity)")
    ranges: Ranges = Field(default=Ranges(), description="Default ranges of parameters by dimension")
    parameters: dict[Name, Parameter] = Field(default={}, description="Numbers that can be identified")
    datum: tuple[str, ...] = Field(
        default=(), description="Parameters held at nominal where the data leave the base's place, or the scale, free"
    )
    ground: dict[Name, Point] = Field(default={}, description="Points fixed to the base")
    frames: dict[Name, Frame] = Field(default={}, description="Frames fixed to the base")
    guides: dict[Name, Guide] = Field(default={}, description="Guides on which carriages travel")
    nodes: dict[Name, Node] = Field(default={}, description="Free points")
    bodies: dict[Name, Body] = Field(default={}, description="Carriages and platforms with their points")
    materials: dict[Name, Material] = Field(default={}, description="Materials of sections")
    sections: dict[Name, Section] = Field(default={}, description="Cross-sections of beams")
    beams: dict[Name, Beam] = Field(default={}, description="Beams: they bend, twist and stretch")
    bars: dict[Name, Bar] = Field(default={}, description="Bars pinned at both ends")
    ropes: dict[Name, Rope] = Field(default={}, description="Ropes, belts and wires")
    joints: dict[Name, Joint] = Field(default={}, description="Joints between points")
    actuators: dict[Name, Actuator] = Field(default={}, description="Drives")
    loads: dict[Name, Load] = Field(default={}, description="Forces and moments at points")
    sensors: dict[Name, Sensor] = Field(default={}, description="Instruments")
    effects: dict[EffectName, Entries] = Field(default={}, description="Effects, KEYWORD@PLACE: {PARAMETER: value}")

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

    def nominal_values(self) -> dict[str, float]:
        """The nominal values of all parameters, SI."""
        return {name: parameter.nominal for name, parameter in self.parameters.items()}


def axis_vector(axis: Axis, dimensions: int) -> tuple[Quantity, ...]:
    """An axis as a vector of quantities; a letter as a constant unit vector."""
    if not isinstance(axis, str):
        return axis
    letter: Letter = axis
    place = "xyz".index(letter[-1])
    sign = -1.0 if letter.startswith("-") else 1.0
    return tuple(Quantity.constant(sign if i == place else 0.0) for i in range(dimensions))
