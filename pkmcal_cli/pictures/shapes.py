"""Where the parts of a machine are that is drawn, and where symbols of joints stand that would lie on one another."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.language.quantities import Quantity
from pkmcal_cli.language.tool_point import tool_point_of

_NOTHING = 1e-9  # of the machine's size: no displacement
_STRAIGHT = 1e-8  # rad: no turn
_AT = 1e-6  # of the machine's size: as near is the same place
_HALF_AXIS = 0.06  # of the machine's size: from a joint to an end of its axis
_FEW = 3  # joints in one point whose symbols half an axis away are apart; of more, farther
_APART = 0.5  # of that distance: between symbols on one axis
_ONE_AXIS = 0.95  # cosine of the angle of axes that cannot be told apart in a picture


@dataclass(frozen=True)
class JointShape:
    """A joint: its type, its place (3,), unit vectors (3,) along its axes; m, base axes."""

    type: str
    at: Array
    axes: tuple[Array, ...]

    def towards(self, other: JointShape, factor: float) -> JointShape:
        """This joint, moved and turned by `factor` times the way to the other."""
        mixed = (a + factor * (b - a) for a, b in zip(self.axes, other.axes, strict=True))
        axes = tuple(axis / np.sqrt(axis @ axis) for axis in mixed)
        return JointShape(self.type, self.at + factor * (other.at - self.at), axes)


@dataclass(frozen=True)
class Shape:
    """Places (3,) of named points, courses (K, 3) of members and of guides (in the direction of travel), joints; m,
    base axes.
    """

    places: Mapping[str, Array]
    members: Mapping[str, Array]
    guides: Mapping[str, Array]
    joints: Mapping[str, JointShape]

    def towards(self, other: Shape, factor: float) -> Shape:
        """This shape moved by `factor` times what the other is displaced from it."""
        places, courses, guides = (
            {name: one[name] + factor * (two[name] - one[name]) for name in one}
            for one, two in ((self.places, other.places), (self.members, other.members), (self.guides, other.guides))
        )
        joints = {name: joint.towards(other.joints[name], factor) for name, joint in self.joints.items()}
        return Shape(places, courses, guides, joints)

    @property
    def corners(self) -> Array:
        """All points (K, 3) between which it lies."""
        return np.vstack([*self.places.values(), *self.members.values(), *self.guides.values()])


@dataclass(frozen=True, kw_only=True)
class MachineShape:
    """A machine in one row: where the control believes it to be, where it is, and what its parts carry.

    drives: by name the point, member or joint that each acts on; forces: of drives, N or N m (`turning`); tensions:
    axial forces of members, N, positive where they pull.
    """

    machine: Machine[Quantity, float]
    length: float
    reference: Shape
    actual: Shape
    readings: Mapping[str, float]
    forces: Mapping[str, float]
    turning: frozenset[str]
    tensions: Mapping[str, float]

    @cached_property
    def extent(self) -> float:
        """Diagonal of the box around what is drawn, m; 0 where all points coincide."""
        size = float(np.sqrt((np.ptp(self.reference.corners, axis=0) ** 2).sum()))
        return size if size > _AT * self.length else 0.0

    @property
    def planar(self) -> bool:
        """Whether it is a machine in the plane."""
        return self.machine.space == "planar"

    @property
    def tool(self) -> str | None:
        """Name of the tool point."""
        tool_point = tool_point_of(self.machine)
        return None if tool_point is None else tool_point.name

    @cached_property
    def half_axis(self) -> float:
        """How long an axis is drawn on either side of its joint, m: a share of what is drawn, if that has a size."""
        return _HALF_AXIS * self.extent or self.length

    @cached_property
    def together(self) -> list[list[str]]:
        """Names of points by where they are: those in one place together, the tool point by itself."""
        out: list[list[str]] = []
        for name, at in self.actual.places.items():
            near = (names for names in out if self.at_one_of(at, [self.actual.places[names[0]]]))
            others = None if name == self.tool else next((names for names in near if names[0] != self.tool), None)
            if others is None:
                out.append([name])
            else:
                others.append(name)
        return out

    @cached_property
    def moved_out(self) -> dict[str, float]:
        """How far along its axis the symbol of a joint stands, m: those of several joints in one point are apart.

        A joint acts all along its axis. Those that share a place with no other, or have no axis of their own, stay.
        """
        out: dict[str, float] = {}
        single = {n: j for n, j in self.reference.joints.items() if len(j.axes) == 1 and n in self.machine.joints}
        for name, joint in single.items():
            near = [n for n, o in single.items() if self.at_one_of(o.at, [joint.at])]
            along = [n for n in near if n in out and abs(single[n].axes[0] @ joint.axes[0]) > _ONE_AXIS]
            crowd = max(1.0, len(near) / _FEW) if len(near) > 1 and not self.planar else 0.0
            out[name] = self.half_axis * crowd * (1 + _APART * len(along))
        return out

    def symbol(self, name: str, shape: Shape) -> Array:
        """Where the symbol of a joint stands (3,), m."""
        joint, out = shape.joints[name], self.moved_out.get(name, 0.0)
        return np.asarray(joint.at + out * joint.axes[0]) if out else joint.at

    def axes(self, name: str, shape: Shape) -> list[Array]:
        """The axes of a joint as they are drawn, from end to end (2, 3), the second one where it is positive."""
        joint, reach = shape.joints[name], self.half_axis
        out = self.moved_out.get(name, 0.0)
        return [np.array([joint.at - reach * axis, joint.at + (out + reach) * axis]) for axis in joint.axes]

    def outline(self, name: str, shape: Shape) -> Array:
        """Points (K, 3) between which a body lies: its own, and symbols of its joints."""
        names = (name, *self.machine.bodies[name].points)
        joints = [n for n in self.moved_out if not set(names).isdisjoint(self.machine.joints[n].between)]
        return np.array([*(shape.places[n] for n in names), *(self.symbol(n, shape) for n in joints)])

    def corners(self, shape: Shape) -> Array:
        """All points (K, 3) between which it lies, with the axes of its joints."""
        axes = [line for name in shape.joints for line in self.axes(name, shape)]
        return np.vstack([shape.corners, *axes])

    def at_one_of(self, at: Array, others: Sequence[Array]) -> bool:
        """Whether a place (3,) is one of others, m."""
        return any(float(np.abs(at - other).max()) <= _AT * self.length for other in others)

    def displacement(self, name: str) -> Array:
        """How far a point is from where the control believes it (3,), m."""
        return np.asarray(self.actual.places[name] - self.reference.places[name])

    @cached_property
    def largest(self) -> tuple[str, float]:
        """The point that is displaced most, and how far, m; 0 for what is rounding."""
        sizes = {n: float(np.sqrt((self.displacement(n) ** 2).sum())) for n in self.reference.places}
        name = max(sizes, key=lambda n: sizes[n], default="")
        size = sizes.get(name, 0.0)
        return name, size if size > _NOTHING * self.length else 0.0

    @cached_property
    def most_turned(self) -> tuple[str, float]:
        """The joint whose axes are turned most against where the control believes them, and how far, rad; 0 for
        what is rounding.
        """
        sizes = {
            name: max(float(np.sqrt(((a - b) ** 2).sum())) for a, b in zip(joint.axes, actual.axes, strict=True))
            for name, joint in self.reference.joints.items()
            if joint.axes and (actual := self.actual.joints[name])
        }
        name = max(sizes, key=lambda n: sizes[n], default="")
        angle = 2 * float(np.arcsin(min(sizes.get(name, 0.0) / 2, 1.0)))
        return name, angle if angle > _STRAIGHT else 0.0

    @property
    def moved(self) -> bool:
        """Whether anything is displaced or turned."""
        return self.largest[1] > 0 or self.most_turned[1] > 0

    def at_drive(self, name: str, shape: Shape) -> Array:
        """Where a drive acts (3,): its carriage or crank, the middle of its member, its joint, its rope's start."""
        actuator = self.machine.actuators[name]
        if actuator.winds is not None:
            return np.asarray(shape.members[next(iter(actuator.winds))][0])
        target = actuator.target
        if target in shape.members:
            course = shape.members[target]
            return np.asarray(0.5 * (course[(len(course) - 1) // 2] + course[len(course) // 2]))
        joint = self._turned(target) if name in self.turning else target
        return self.symbol(joint, shape) if joint in shape.joints else shape.places[target]

    def _turned(self, target: str) -> str:
        """The joint that a turning drive acts on: the one named, or that of the body named."""
        points = {target, *(self.machine.bodies[target].points if target in self.machine.bodies else ())}
        hinges = (n for n, j in self.machine.joints.items() if j.type == "revolute" and points & set(j.between))
        return target if target in self.machine.joints else next(hinges, target)
