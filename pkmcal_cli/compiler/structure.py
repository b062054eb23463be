"""Where everything is: frames, guides, nodes, bodies and their points as connection points of the topology.

Joints that lock translations place one side on the other (a tree), so that pinned ends, cranks, telescopes and
carriages need neither unknowns nor constraints of their own; the others become links in `joints`.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pkmcal_cli.base.rotation import Array, exp
from pkmcal_cli.compiler.axes import depends, joint_tilts, nominal_axis
from pkmcal_cli.compiler.coefficient_values import constant_vector, is_zero, number, unit, vector
from pkmcal_cli.compiler.coordinates import Coordinates
from pkmcal_cli.compiler.joint_tree import joint_tree
from pkmcal_cli.compiler.rails import Rails
from pkmcal_cli.language.fields import Direction
from pkmcal_cli.language.machine import Body, Joint
from pkmcal_cli.mechanism.connection_points import ConnectionPoint, Point
from pkmcal_cli.mechanism.topology import GROUND, RotationKind


@dataclass(kw_only=True)
class Structure(Coordinates):
    """Connection points by name, made on demand."""

    placed_by: dict[str, tuple[str, int]] = field(default_factory=dict)  # node or body -> joint, its side
    points: dict[str, Point] = field(default_factory=dict)
    rotations: dict[str, int] = field(default_factory=dict)
    owner: dict[str, str] = field(default_factory=dict)  # body point -> body
    receptive: bool = False  # whether effects can enter: carriages get an error of their place
    rails: Rails = field(init=False)

    def __post_init__(self) -> None:
        self.rails = Rails(coordinates=self, point=self.point, rotation=self.rotation, filed_place=self.filed_place)

    def prepare(self) -> None:
        """Frames and guides on the base, owners of points, and which joint places what."""
        self.rails.prepare()
        for name, body in self.machine.bodies.items():
            self.owner |= dict.fromkeys(body.points, name)
        self.placed_by |= joint_tree(self.machine, self.owner, self.nominal)

    def point(self, name: str) -> Point:
        """The point of a node, ground point, body or body's point."""
        return self.points.get(name) or self.points.setdefault(name, self._make_point(name))

    def rotation(self, name: str) -> int:
        """The rotation of the body or node that a name belongs to; made where a node did not need one yet."""
        owner = self.owner.get(name, name)
        if owner not in self.rotations:
            if owner in self.machine.ground:
                self.rotations[owner] = GROUND
            else:
                self._make_rotation(owner)
        return self.rotations[owner]

    def connection(self, name: str, rotating: bool = False) -> ConnectionPoint:
        """Point and rotation; a node's rotation is made only if `rotating`."""
        owner = self.owner.get(name, name)
        point = self.point(name)
        rotates = rotating or owner in self.rotations or owner in self.machine.bodies
        return ConnectionPoint(point, self.rotation(name) if rotates else GROUND)

    def _make_point(self, name: str) -> Point:
        machine = self.machine
        if name in machine.ground:
            return self.anchored("ground", name, GROUND, vector(machine.ground[name]), name)
        if name in self.owner:
            body = self.owner[name]
            offset = self.anchored("point", name, self.rotation(body), vector(machine.bodies[body].points[name]), name)
            return self.point(body) + offset
        if name in self.placed_by:
            return self._placed_point(name)
        if name in machine.bodies:
            return self._body_point(name, machine.bodies[name])
        node = machine.nodes[name]
        at = constant_vector(node.at, self.nominal)
        return self._partly_fixed(name, at, vector(node.at), node.fixed)

    def _partly_fixed(self, name: str, at: Array, values: tuple, fixed: tuple[str, ...]) -> Point:  # type: ignore[type-arg]
        axes = "xy" if self.planar else "xyz"
        held = [v if c in fixed else 0.0 for v, c in zip(values, "xyz", strict=True)]
        kind = "fixed" if all(c in fixed for c in axes) else "partly fixed"
        out = self.anchored(kind, name, GROUND, held, name) if any(c in fixed for c in axes) else Point()
        moves = [
            (GROUND, self.new_travel(f"{name}.{c}", float(at[k])), tuple(np.eye(3)[k]))
            for k, c in enumerate(axes)
            if c not in fixed
        ]
        return out + Point((), tuple(moves))

    def _body_point(self, name: str, body: Body) -> Point:
        if body.guide is None:
            return self._partly_fixed(name, constant_vector(body.at, self.nominal), vector(body.at), body.fixed)
        rail = self.rails.of(name)
        coefficient = self.builder.coefficient(number(body.at[0]), f"{name}.travel")
        travel = self.new_travel(name, body.at[0].number(self.nominal), coefficient)
        self.carriage_travel[name] = travel
        on_beam = self.machine.guides[body.guide].beam is not None  # then it lengthens the spans of the beam
        moves = [] if on_beam else [(rail.tilted, travel, tuple(rail.along))]
        for direction in self.rails.elastic_directions(body.guide):
            if direction in "xyz":
                axis = np.eye(3)["xyz".index(direction)]
                moves.append((rail.tilted, self.new_travel(f"{name}.{direction}", 0.0), tuple(axis)))
        if self.receptive:
            self.anchored("carriage", name, rail.rotation, (0.0, 0.0, 0.0), f"{name}.error")
        return self.rails.at(name) + Point((), tuple(moves))

    def _make_rotation(self, name: str) -> None:
        body = self.machine.bodies.get(name)
        if name in self.placed_by:
            self._placed_rotation(name)
        elif body is not None and body.guide is not None:
            rail = self.rails.of(name)
            rotates = any(d[0] == "r" for d in self.rails.elastic_directions(body.guide))
            self.rotations[name] = (
                self.new_rotation(name, self.filed_orientation(rail.rotation)) if rotates else rail.rotation
            )
        else:
            self.rotations[name] = self._partly_turning(name, body)

    def _partly_turning(self, name: str, body: Body | None) -> int:
        """The rotation of a body or node of which some or all rotations are fixed."""
        filed = self._filed_rotation(name)
        free = [d for d in self.rotations_of_space if d not in self.fixed(name)]
        if not free:
            return GROUND if body is None else self.builder.rotation(RotationKind.FIXED, name, reference=filed)
        if len(free) == 1 and not self.planar:
            axis = np.eye(3)["xyz".index(free[0][1])]
            return self._about(name, axis)
        return self.new_rotation(name, filed)

    def _about(self, name: str, axis: Array) -> int:
        """The rotation of a node or body about an axis fixed to the base."""
        reference = self.configuration.orientations.get(name, self._filed_rotation(name))
        out = self.builder.rotation(RotationKind.AXIS, name, axis=axis, reference=reference)
        self.builder.filed[out] = self._filed_rotation(name)
        return out

    @property
    def rotations_of_space(self) -> tuple[Direction, ...]:
        """What a body can rotate about."""
        return ("rz",) if self.planar else ("rx", "ry", "rz")

    def fixed(self, name: str) -> tuple[Direction, ...]:
        """Directions in which a body or node is fixed to the base."""
        return (self.machine.bodies.get(name) or self.machine.nodes[name]).fixed

    def _filed_rotation(self, name: str) -> Array:
        body = self.machine.bodies.get(name)
        if body is not None and body.guide is not None:
            return self.filed_orientation(self.rails.of(name).rotation)
        if body is None or is_zero(body.turn):
            return np.eye(3)
        rotation = [q.number(self.nominal) for q in body.turn]
        return exp(np.array([0.0, 0.0, rotation[0]] if self.planar else rotation))

    def _placed_rotation(self, name: str) -> None:
        """Rotation of a node or body that a joint places."""
        joint_name, side = self.placed_by[name]
        joint = self.machine.joints[joint_name]
        parent = self.rotation(joint.between[1 - side])
        if joint.type in ("fixed", "prismatic"):
            self.rotations[name] = parent
        elif joint.type == "revolute" and not self.planar and parent == GROUND and not depends(joint.axis):
            self.rotations[name] = self._about(name, nominal_axis(joint.axis or "z", self.nominal))
        else:
            self.rotations[name] = self.new_rotation(name, self._filed_rotation(name))

    def _placed_point(self, name: str) -> Point:
        """Point of a node, or origin of a body, that a joint places on its other side."""
        joint_name, side = self.placed_by[name]
        joint = self.machine.joints[joint_name]
        end, other_end = joint.between[side], joint.between[1 - side]
        base = self.point(other_end)
        if joint.type in ("prismatic", "cylindrical", "planar"):
            base = base + self._slide(joint_name, joint, name, other_end, 1.0 if side == 1 else -1.0)
        if end == name:
            return base
        offset = self.machine.bodies[name].points[end]
        index = self.builder.offset(self.rotation(name), vector(offset), end).offsets[0][2]
        return base + Point(((self.rotation(name), -1.0, index),), ())

    def _slide(self, joint_name: str, joint: Joint, child: str, parent: str, sign: float) -> Point:
        """Travels of a sliding joint along its free axes, carried by the parent."""
        rotation = self.rotation(parent)
        filed = self.filed_orientation(rotation)
        tilted = self.tilted(rotation, joint_tilts(joint, self.nominal)[0], f"{joint_name}.axis", filed)
        reference = self.filed_place(child) - self.filed_place(parent)
        axis = self.slide_axis(joint, sign * reference)
        axes = [axis] if joint.type != "planar" else list(np.linalg.svd(axis[None])[2][1:])
        moves = []
        for k, a in enumerate(axes):
            size = float(sign * a @ reference)
            coefficient = self.builder.coefficient(size, f"{joint_name}.travel")
            travel = self.new_travel(joint_name if k == 0 else f"{joint_name}.{k}", size, coefficient)
            if k == 0:
                self.carriage_travel[joint_name] = travel
            moves.append((tilted, travel, tuple(sign * (filed.T @ a))))
        return Point((), tuple(moves))

    def slide_axis(self, joint: Joint, chord: Array) -> Array:
        """Axis of a sliding joint as filed: the one given, else along the line between its points, else x."""
        if joint.axis is not None:
            return nominal_axis(joint.axis, self.nominal)
        return unit(chord) if np.sqrt(chord @ chord) > 1e-9 else np.array([1.0, 0.0, 0.0])

    def filed_place(self, name: str) -> Array:
        """Place of a node, body or point in the file's configuration."""
        machine = self.machine
        if name in self.owner:
            body = self.owner[name]
            offset = constant_vector(machine.bodies[body].points[name], self.nominal)
            return np.asarray(self.filed_place(body) + self._filed_rotation(body) @ offset)
        if name in machine.bodies and machine.bodies[name].guide is not None:
            return self.position(self.point(name))
        at = machine.ground.get(name) or (machine.bodies.get(name) or machine.nodes[name]).at
        return constant_vector(at, self.nominal)
