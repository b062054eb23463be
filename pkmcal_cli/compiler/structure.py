"""Where everything is: frames, guides, nodes, bodies and their points as ports of the layout.

Joints that lock translations place one side on the other (a tree), so that pinned ends, cranks, telescopes and
carriages need neither unknowns nor constraints of their own; the others become links in `joints`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from pkmcal_cli.base.rotation import Array, exp
from pkmcal_cli.compiler.numbers import constant_vector, is_zero, number, unit, vector
from pkmcal_cli.compiler.tree import joint_tree
from pkmcal_cli.language.machine import Body, Guide, Joint, Machine, axis_vector
from pkmcal_cli.language.quantities import Quantity
from pkmcal_cli.mechanism.builder import LayoutBuilder
from pkmcal_cli.mechanism.connection_points import Number, Point, Port, Rail
from pkmcal_cli.mechanism.topology import GROUND, Turn


@dataclass(frozen=True)
class Drawing:
    """The assembled drawing: travels (m) and orientations (3, 3) by name, instead of those of the file."""

    travels: dict[str, float] = field(default_factory=dict)
    orientations: dict[str, Array] = field(default_factory=dict)


@dataclass(kw_only=True)
class Structure:
    """Ports by name, made on demand."""

    machine: Machine
    drawing: Drawing
    builder: LayoutBuilder
    frames: dict[str, tuple[Point, int]] = field(default_factory=dict)
    rails: dict[str, Rail] = field(default_factory=dict)
    carriage_travel: dict[str, int] = field(default_factory=dict)  # body or prismatic joint -> travel
    placed_by: dict[str, tuple[str, int]] = field(default_factory=dict)  # node or body -> joint, its side
    points: dict[str, Point] = field(default_factory=dict)
    rotations: dict[str, int] = field(default_factory=dict)
    owner: dict[str, str] = field(default_factory=dict)  # body point -> body
    receptive: bool = False  # whether effects can enter: carriages get an error of their place
    anchors: dict[tuple[str, str], int] = field(default_factory=dict)  # (kind, name) -> offset vector, for effects

    @property
    def planar(self) -> bool:
        """Whether the machine lives in the plane."""
        return self.machine.space == "planar"

    @property
    def nominal(self) -> dict[str, float]:
        """Nominal parameter values, SI."""
        return self.builder.nominal

    # --- what the layout needs -------------------------------------------------------------
    def new_rotation(self, name: str, filed: Array | None = None) -> int:
        """An unknown rotation: about z in the plane, any in space. `filed`: its orientation in the file."""
        filed = np.eye(3) if filed is None else filed
        drawn = self.drawing.orientations.get(name, filed)
        made = self.builder.rotation(Turn.AXIS if self.planar else Turn.FREE, name, drawn=drawn)
        self.builder.filed[made] = filed
        return made

    def new_travel(self, name: str, drawn: float, slot: int = -1) -> int:
        """A travel, at its assembled value where there is one."""
        return self.builder.travel(self.drawing.travels.get(name, drawn), name, slot)

    def free_point(self, name: str, at: Array) -> Point:
        """A point free to move along the base axes."""
        axes = np.eye(3)[: 2 if self.planar else 3]
        moves = [
            (GROUND, self.new_travel(f"{name}.{c}", float(v)), tuple(axis))
            for v, c, axis in zip(at, "xyz", axes, strict=False)
        ]
        return Point((), tuple(moves))

    def position(self, point: Point) -> Array:
        """Place of a point in the drawing, base axes (3,), m."""
        b, out = self.builder, np.zeros(3)
        for r, sign, index in point.offsets:
            out = out + self.orientation(r) @ (sign * np.array([b.constants[k] for k in b.offsets[index]]))
        for r, t, axis in point.travels:
            out = out + self.orientation(r) @ (b.travels[t][1] * np.array(axis))
        return out

    def orientation(self, rotation: int) -> Array:
        """Orientation of a rotation in the drawing, (3, 3)."""
        kind, _, drawn, slots, _ = self.builder.rotations[rotation]
        if kind == Turn.FIXED and slots[0] >= 0:
            return exp(np.array([self.builder.constants[k] for k in slots])) @ drawn
        return drawn

    # --- places ----------------------------------------------------------------------------
    def prepare(self) -> None:
        """Frames and guides, owners of points, and which joint places what."""
        for name, frame in self.machine.frames.items():
            turn = (Quantity.constant(0.0), Quantity.constant(0.0), *frame.turn) if self.planar else frame.turn
            slots = [self.builder.slot(n, f"{name}.turn.{c}") for n, c in zip(vector(turn), "xyz", strict=True)]
            rotation = self.builder.rotation(Turn.FIXED, name, slots=slots)
            self.frames[name] = (self.anchored("frame", name, GROUND, vector(frame.at), f"{name}.at"), rotation)
        for name, guide in self.machine.guides.items():
            self.rails[name] = self._rail(name, guide)
        for name, body in self.machine.bodies.items():
            self.owner |= dict.fromkeys(body.points, name)
        self.placed_by |= joint_tree(self.machine, self.owner, self.nominal)

    def _rail(self, name: str, guide: Guide) -> Rail:
        origin, rotation = self.frames[guide.frame] if guide.frame else (Point(), GROUND)
        along = unit(constant_vector(axis_vector(guide.along, 3), self.nominal))
        return Rail(origin + self.anchored("guide", name, rotation, vector(guide.at), f"{name}.at"), rotation, along)

    def anchored(self, kind: str, name: str, rotation: int, value: Sequence[Number], label: str) -> Point:
        """A point at a constant offset that effects can move."""
        point = self.builder.offset(rotation, value, label)
        self.anchors[kind, name] = point.offsets[0][2]
        return point

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

    def port(self, name: str, turning: bool = False) -> Port:
        """Point and rotation; a node's rotation is made only if `turning`."""
        owner = self.owner.get(name, name)
        point = self.point(name)
        turns = turning or owner in self.rotations or owner in self.machine.bodies
        return Port(point, self.rotation(name) if turns else GROUND)

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
        out = self.anchored("fixed", name, GROUND, held, name) if any(c in fixed for c in axes) else Point()
        moves = [
            (GROUND, self.new_travel(f"{name}.{c}", float(at[k])), tuple(np.eye(3)[k]))
            for k, c in enumerate(axes)
            if c not in fixed
        ]
        return out + Point((), tuple(moves))

    def _body_point(self, name: str, body: Body) -> Point:
        if body.on is None:
            return self._partly_fixed(name, constant_vector(body.at, self.nominal), vector(body.at), body.fixed)
        rail = self.rails[body.on]
        slot = self.builder.slot(number(body.at[0]), f"{name}.travel")
        travel = self.new_travel(name, body.at[0].number(self.nominal), slot)
        self.carriage_travel[name] = travel
        moves = [(rail.rotation, travel, tuple(rail.along))]
        for direction in self.elastic_directions(body.on):
            if direction in "xyz":
                axis = np.eye(3)["xyz".index(direction)]
                moves.append((rail.rotation, self.new_travel(f"{name}.{direction}", 0.0), tuple(axis)))
        if self.receptive:
            self.anchored("carriage", name, rail.rotation, (0.0, 0.0, 0.0), f"{name}.error")
        return self.rail_at(name) + Point((), tuple(moves))

    def rail_at(self, carriage: str) -> Point:
        """Travel 0 of a carriage's guide, where effects on the guide move it for this carriage: the rail's side."""
        rail = self.rails[self.machine.bodies[carriage].on or ""]
        error = self.anchors.get(("carriage", carriage))
        return rail.origin + (Point() if error is None else Point(((rail.rotation, 1.0, error),)))

    def elastic_directions(self, guide: str) -> tuple[str, ...]:
        """Directions of a guide with stiffness, in its frame's axes; not the travel itself."""
        stiffness = self.machine.guides[guide].stiffness
        if stiffness is None:
            return ()
        axes = ("x", "y", "rz") if self.planar else ("x", "y", "z", "rx", "ry", "rz")
        along = self.rails[guide].along
        across = [d for d in axes if d[0] == "r" or abs(along["xyz".index(d)]) < 1e-9]
        radial = stiffness.radial is not None
        return tuple(d for d in across if getattr(stiffness, d) is not None or (radial and d[0] != "r"))

    def _make_rotation(self, name: str) -> None:
        body = self.machine.bodies.get(name)
        if name in self.placed_by:
            self._placed_rotation(name)
        elif body is not None and body.on is not None:
            rail = self.rails[body.on]
            turns = any(d[0] == "r" for d in self.elastic_directions(body.on))
            self.rotations[name] = self.new_rotation(name, self.orientation(rail.rotation)) if turns else rail.rotation
        else:
            fixed = body.fixed if body is not None else self.machine.nodes[name].fixed
            turn = self._drawn_turn(name)
            if all(d in fixed for d in (("rz",) if self.planar else ("rx", "ry", "rz"))):
                drawn = self.builder.rotation(Turn.FIXED, name, drawn=turn) if body is not None else GROUND
                self.rotations[name] = drawn
            else:
                self.rotations[name] = self.new_rotation(name, turn)

    def _drawn_turn(self, name: str) -> Array:
        body = self.machine.bodies.get(name)
        if body is None or is_zero(body.turn):
            return np.eye(3)
        turn = [q.number(self.nominal) for q in body.turn]
        return exp(np.array([0.0, 0.0, turn[0]] if self.planar else turn))

    def _placed_rotation(self, name: str) -> None:
        """Rotation of a node or body that a joint places."""
        joint_name, side = self.placed_by[name]
        joint = self.machine.joints[joint_name]
        parent = self.rotation(joint.between[1 - side])
        if joint.type in ("fixed", "prismatic"):
            self.rotations[name] = parent
        elif joint.type == "revolute" and not self.planar and parent == GROUND:
            axis = unit(constant_vector(axis_vector(joint.axis or "z", 3), self.nominal))
            drawn = self.drawing.orientations.get(name, self._drawn_turn(name))
            self.rotations[name] = self.builder.rotation(Turn.AXIS, name, axis=axis, drawn=drawn)
            self.builder.filed[self.rotations[name]] = self._drawn_turn(name)
        else:
            self.rotations[name] = self.new_rotation(name, self._drawn_turn(name))

    def _placed_point(self, name: str) -> Point:
        """Point of a node, or origin of a body, that a joint places on its other side."""
        joint_name, side = self.placed_by[name]
        joint = self.machine.joints[joint_name]
        mine, theirs = joint.between[side], joint.between[1 - side]
        base = self.point(theirs)
        if joint.type in ("prismatic", "cylindrical", "planar"):
            base = base + self._slide(joint_name, joint, name, theirs, 1.0 if side == 1 else -1.0)
        if mine == name:
            return base
        offset = self.machine.bodies[name].points[mine]
        index = self.builder.offset(self.rotation(name), vector(offset), mine).offsets[0][2]
        return base + Point(((self.rotation(name), -1.0, index),), ())

    def _slide(self, joint_name: str, joint: Joint, child: str, parent: str, sign: float) -> Point:
        """Travels of a sliding joint along its free axes, carried by the parent."""
        rotation = self.rotation(parent)
        turned = self.builder.filed.get(rotation, self.orientation(rotation)).T
        drawn = self._drawn_place(child) - self._drawn_place(parent)
        axis = self.slide_axis(joint, sign * drawn)
        axes = [axis] if joint.type != "planar" else list(np.linalg.svd(axis[None])[2][1:])
        moves = []
        for k, a in enumerate(axes):
            slot = self.builder.slot(float(sign * a @ drawn), f"{joint_name}.travel")
            travel = self.new_travel(joint_name if k == 0 else f"{joint_name}.{k}", float(sign * a @ drawn), slot)
            if k == 0:
                self.carriage_travel[joint_name] = travel
            moves.append((rotation, travel, tuple(sign * (turned @ a))))
        return Point((), tuple(moves))

    def slide_axis(self, joint: Joint, chord: Array) -> Array:
        """Axis of a sliding joint in the file's drawing: as given, else along the line between its points, else x."""
        if joint.axis is not None:
            return unit(constant_vector(axis_vector(joint.axis, 3), self.nominal))
        return unit(chord) if np.sqrt(chord @ chord) > 1e-9 else np.array([1.0, 0.0, 0.0])

    def sliding_axis(self, joint: Joint) -> Array:
        """Axis of a sliding joint in the assembled drawing, base axes, towards its second point."""
        first, second = joint.between
        axis = self.slide_axis(joint, self._drawn_place(second) - self._drawn_place(first))
        rotation = self.rotation(first)
        drawn = self.orientation(rotation)
        return np.asarray(drawn @ self.builder.filed.get(rotation, drawn).T @ axis)

    def _drawn_place(self, name: str) -> Array:
        """Place of a node, body or point in the file's drawing."""
        machine = self.machine
        if name in self.owner:
            body = self.owner[name]
            offset = constant_vector(machine.bodies[body].points[name], self.nominal)
            return np.asarray(self._drawn_place(body) + self._drawn_turn(body) @ offset)
        if name in machine.bodies and machine.bodies[name].on is not None:
            return self.position(self.point(name))
        at = machine.ground.get(name) or (machine.bodies.get(name) or machine.nodes[name]).at
        return constant_vector(at, self.nominal)
