"""Joints as links: what they hold beyond the tree of points, elastic directions, guides with stiffness."""

from __future__ import annotations

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.compiler.numbers import constant_vector, number, triad_about, triad_along, unit
from pkmcal_cli.compiler.structure import Structure
from pkmcal_cli.elements import JOINTS, Joint
from pkmcal_cli.language.machine import End, Stiffness, axis_vector
from pkmcal_cli.language.machine import Joint as JointSpec
from pkmcal_cli.mechanism.connection_points import Number, Port
from pkmcal_cli.mechanism.topology import Turn

_PLANAR_ROWS = ("x", "y", "rz", "angle")


def add_joints(structure: Structure) -> None:
    """What the joints hold beyond the tree of points, and their springs."""
    for name, joint in structure.machine.joints.items():
        tree = any(joint == name for joint, _ in structure.placed_by.values())  # translations are built in
        shares = tree and joint.type in ("fixed", "prismatic")
        rows = joint_rows(joint.type, structure.planar)
        if tree:
            rows = tuple(r for r in rows if r[0] == "r" and not shares and not _axis_built_in(structure, name))
        rows += free_springs(joint.stiffness, joint.type, structure.planar)
        driven = [a for a in structure.machine.actuators.values() if a.drives == name]
        extra: dict[str, Number] = {}
        if driven and name not in structure.carriage_travel and "x" not in rows:
            rows += ("x",)
            if driven[0].stiffness is not None:
                extra = {"x": number(driven[0].stiffness)}
        if rows:
            turning = any(r not in "xyz" for r in rows)
            ports = (structure.port(joint.between[0], turning), structure.port(joint.between[1], turning))
            chord = structure.position(ports[1].point) - structure.position(ports[0].point)
            triad = joint_triad(structure, joint, chord if chord.any() else np.array([0.0, 0.0, 1.0]))
            add_joint_link(
                structure,
                name,
                joint.type,
                rows=rows,
                ports=ports,
                triad=triad,
                stiffness=joint.stiffness,
                rest=None,
                extra=extra,
            )


def _axis_built_in(structure: Structure, name: str) -> bool:
    """Whether a placed body turns about one fixed axis: its revolute joint needs no constraint."""
    child = next(c for c, (joint, _) in structure.placed_by.items() if joint == name)
    return structure.builder.rotations[structure.rotation(child)][0] == Turn.AXIS


def add_guides(structure: Structure) -> None:
    """Elastic guidance of carriages: the paper's 1-node beam (eq. 8) where lateral and tilt are coupled."""
    for name, body in structure.machine.bodies.items():
        if body.on is None:
            continue
        elastic = structure.elastic_directions(body.on)
        if not elastic:
            continue
        rail = structure.rails[body.on]
        turns = any(d[0] == "r" for d in elastic)
        all_turns = ("rz",) if structure.planar else ("rx", "ry", "rz")
        rows = tuple(d for d in elastic if d in "xyz") + (all_turns if turns else ())
        ports = (Port(structure.rail_at(name), rail.rotation), structure.port(name))
        triad = structure.orientation(rail.rotation)
        add_joint_link(
            structure,
            f"{name}.guidance",
            "fixed",
            rows=rows,
            ports=ports,
            triad=triad,
            stiffness=structure.machine.guides[body.on].stiffness,
        )


def joint_rows(kind: str, planar: bool) -> tuple[str, ...]:
    """Blocked directions of a joint type."""
    rows = JOINTS[kind].blocked
    return tuple(r for r in rows if r in _PLANAR_ROWS) if planar else rows


def elastic_rows(stiffness: Stiffness | None, kind: str, planar: bool) -> tuple[str, ...]:
    """Blocked directions that yield."""
    if stiffness is None:
        return ()
    rows = joint_rows(kind, planar)
    return tuple(
        r for r in rows if getattr(stiffness, r, None) is not None or (stiffness.radial is not None and r in "xyz")
    )


def free_springs(stiffness: Stiffness | None, kind: str, planar: bool) -> tuple[str, ...]:
    """Springs in free directions: torsion of a revolute joint (`rz`), along a sliding one (`x`)."""
    if stiffness is None:
        return ()
    drive = JOINTS[kind].drive
    if drive == "rz" and stiffness.rz is not None:
        return ("angle",)
    return (drive,) if drive is not None and getattr(stiffness, drive) is not None else ()


def joint_triad(structure: Structure, joint: End | JointSpec, chord: Array) -> Array:
    """The joint's own triad in the drawing, base axes (columns)."""
    kind = joint.joint if isinstance(joint, End) else joint.type
    if kind == "universal":
        return _universal_triad(structure, joint, chord)
    if not isinstance(joint, End) and kind in ("prismatic", "cylindrical"):
        axis = structure.sliding_axis(joint)
        return triad_along(axis) if kind == "prismatic" else triad_about(axis)
    if joint.axis is None:
        return np.eye(3)
    axis = constant_vector(axis_vector(joint.axis, 3), structure.nominal)
    return triad_along(axis) if kind == "prismatic" else triad_about(axis)


def _universal_triad(structure: Structure, joint: End | JointSpec, chord: Array) -> Array:
    """x: axis of the first member, by default horizontal across the leg; y: of the second, across both."""
    if joint.axes is not None:
        first, second = (unit(constant_vector(axis_vector(a, 3), structure.nominal)) for a in joint.axes)
        return np.column_stack([first, second, np.cross(first, second)])
    leg = unit(chord)
    across = np.cross([0.0, 0.0, 1.0], leg)
    first = unit(across) if np.sqrt(across @ across) > 1e-6 else np.array([1.0, 0.0, 0.0])
    second = np.cross(leg, first)
    return np.column_stack([first, second, np.cross(first, second)])


def add_joint_link(
    structure: Structure,
    name: str,
    kind: str,
    rows: tuple[str, ...],
    ports: tuple[Port, Port],
    triad: Array,
    stiffness: Stiffness | None,
    rest: dict[str, Number] | None = None,
    extra: dict[str, Number] | None = None,
) -> None:
    """A joint element in the given directions: elastic where there is a stiffness, else rigid."""
    element = Joint(kind, rows)
    numbers = [_direction_stiffness(stiffness, r, extra or {}) for r in rows]
    couplings = [_coupling(stiffness, a, b) for i, a in enumerate(rows) for b in rows[i + 1 :]]
    triads = tuple(structure.orientation(p.rotation).T @ triad for p in ports)
    rests = rest or {}
    if kind == "universal" and "rz" in rows:
        rests = {"rz": -float(triad[:, 0] @ triad[:, 1]), **rests}
    structure.builder.link(
        element,
        name,
        ports,
        rest=[rests.get(r, 0.0) for r in rows],
        stiffness=[n or 0.0 for n in numbers] + couplings,
        rigid=[n is None for n in numbers],
        triads=(triads[0], triads[1]),
    )


def _direction_stiffness(stiffness: Stiffness | None, row: str, extra: dict[str, Number]) -> Number | None:
    if row in extra:
        return extra[row]
    if stiffness is None:
        return None
    value = stiffness.rz if row == "angle" else getattr(stiffness, row)
    if value is None and row in "xyz":
        value = stiffness.radial
    return None if value is None else number(value)


def _coupling(stiffness: Stiffness | None, a: str, b: str) -> Number:
    value = getattr(stiffness, f"{a}_{b}", None) if stiffness is not None else None
    return 0.0 if value is None else number(value)
