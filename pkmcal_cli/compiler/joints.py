"""Joints as links: what they hold beyond the tree of points, elastic directions, guides with stiffness."""

from __future__ import annotations

from dataclasses import replace
from operator import neg

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.compiler.axes import CONSTANT, Tilts, carried, cosine, joint_tilts, nominal_axis
from pkmcal_cli.compiler.coefficient_values import combined, number, triad_about, triad_along, unit
from pkmcal_cli.compiler.structure import Structure
from pkmcal_cli.elements import JOINTS, JointElement
from pkmcal_cli.language.machine import Actuator, End, Joint, Stiffness
from pkmcal_cli.mechanism.connection_points import ConnectionPoint, Number, Point
from pkmcal_cli.mechanism.topology import GROUND, RotationKind

_PLANAR_ROWS = ("x", "y", "rz", "angle")


def add_joints(structure: Structure) -> None:
    """What the joints hold beyond the tree of points, and their springs."""
    for name, joint in structure.machine.joints.items():
        tree = any(joint == name for joint, _ in structure.placed_by.values())  # translations are built in
        shares = tree and joint.type in ("fixed", "prismatic")
        rows = joint_rows(joint.type, structure.planar)
        if tree:
            rows = tuple(r for r in rows if r[0] == "r" and not shares and not _axis_built_in(structure, name))
        springs = free_springs(joint.stiffness, joint.type, structure.planar)
        rows += springs
        driven = [a for a in structure.machine.actuators.values() if a.drives == name]
        extra: dict[str, Number] = {}
        held = bool(driven) and name not in structure.carriage_travel
        if held and "x" not in rows:
            rows += ("x",)
            if driven[0].stiffness is not None:
                extra = {"x": number(driven[0].stiffness)}
        if rows:
            rotating = any(r not in "xyz" for r in rows)
            connections = (
                structure.connection(joint.between[0], rotating),
                structure.connection(joint.between[1], rotating),
            )
            chord = structure.position(connections[1].point) - structure.position(connections[0].point)
            triad = joint_triad(structure, joint, chord if chord.any() else np.array([0.0, 0.0, 1.0]))
            add_joint_link(
                structure,
                name,
                joint.type,
                rows=rows,
                connections=connections,
                triad=triad,
                stiffness=joint.stiffness,
                rest=rest_of(structure, joint) | (_travel_at_zero(driven[0], triad, chord) if held else {}),
                extra=extra,
                tilts=tilts_of(structure, joint),
                springs=() if held else springs,
            )


def _travel_at_zero(actuator: Actuator, triad: Array, chord: Array) -> dict[str, Number]:
    """How far a sliding joint is out at reading 0, along its x; `chord`: between its points as drawn."""
    base = float(triad[:, 0] @ chord) if actuator.zero == "home" else number(actuator.zero)  # type: ignore[arg-type]
    if actuator.offset is not None:
        base = combined(lambda z, o: z + o, base, number(actuator.offset))
    return {"x": base}


def add_fixed_rotations(structure: Structure) -> None:
    """Of bodies and nodes in space of which one rotation is fixed: their rotation vector has no part about it.

    Two fixed ones leave a rotation about one axis, three none: those are built in.
    """
    for name, rotation in list(structure.rotations.items()):
        if structure.planar or name not in {**structure.machine.bodies, **structure.machine.nodes}:
            continue
        held = [d for d in structure.rotations_of_space if d in structure.fixed(name)]
        if len(held) == 1:
            base, at = ConnectionPoint(Point(), GROUND), structure.connection(name)
            filed = structure.filed_orientation(rotation)
            structure.builder.link(
                JointElement("fixed", (held[0],)),
                f"{name}.fixed",
                (base, at),
                rest=[0.0],
                stiffness=[0.0],
                rigid=[True],
                triads=(np.eye(3), filed.T),
            )


def _axis_built_in(structure: Structure, name: str) -> bool:
    """Whether a placed body turns about one fixed axis: its revolute joint needs no constraint."""
    child = next(c for c, (joint, _) in structure.placed_by.items() if joint == name)
    return structure.builder.rotations[structure.rotation(child)][0] == RotationKind.AXIS


def add_guides(structure: Structure) -> None:
    """Elastic guidance of carriages: the paper's 1-node beam (eq. 8) where lateral and tilt are coupled."""
    for name, body in structure.machine.bodies.items():
        if body.guide is None:
            continue
        elastic = structure.rails.elastic_directions(body.guide)
        if not elastic:
            continue
        rail = structure.rails.of(name)
        rotates = any(d[0] == "r" for d in elastic)
        all_rotations = ("rz",) if structure.planar else ("rx", "ry", "rz")
        rows = tuple(d for d in elastic if d in "xyz") + (all_rotations if rotates else ())
        connections = (ConnectionPoint(structure.rails.at(name), rail.rotation), structure.connection(name))
        triad = structure.orientation(rail.rotation)
        add_joint_link(
            structure,
            f"{name}.guidance",
            "fixed",
            rows=rows,
            connections=connections,
            triad=triad,
            stiffness=structure.machine.guides[body.guide].stiffness,
            tilts=(rail.tilt, rail.tilt),
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


def joint_triad(structure: Structure, joint: End | Joint, chord: Array) -> Array:
    """The joint's own triad in the reference configuration, base axes (columns)."""
    kind = joint.joint if isinstance(joint, End) else joint.type
    if kind == "universal":
        return _universal_triad(structure, joint, chord)
    if not isinstance(joint, End) and kind in ("prismatic", "cylindrical"):
        axis = sliding_axis(structure, joint)
        return triad_along(axis) if kind == "prismatic" else triad_about(axis)
    if joint.axis is None:
        return np.eye(3)
    axis = nominal_axis(joint.axis, structure.nominal)
    return triad_along(axis) if kind == "prismatic" else triad_about(axis)


def sliding_axis(structure: Structure, joint: Joint) -> Array:
    """Axis of a sliding joint in the assembled reference configuration, base axes, towards its second point."""
    first, second = joint.between
    axis = structure.slide_axis(joint, structure.filed_place(second) - structure.filed_place(first))
    return np.asarray(_assembled(structure, first) @ axis)


def tilts_of(structure: Structure, joint: End | Joint) -> Tilts:
    """How far parameters turn the axes of a joint, base axes, in the assembled reference configuration."""
    tilts = joint_tilts(joint, structure.nominal)
    if isinstance(joint, End) or joint.type not in ("prismatic", "cylindrical"):
        return tilts
    turned = _assembled(structure, joint.between[0])
    first, second = (None if tilt is None else carried(tilt, turned) for tilt in tilts)
    return first, second


def _assembled(structure: Structure, name: str) -> Array:
    """How the assembled reference configuration turns a body or node from where it is filed, (3, 3)."""
    rotation = structure.rotation(name)
    return np.asarray(structure.orientation(rotation) @ structure.filed_orientation(rotation).T)


def _universal_triad(structure: Structure, joint: End | Joint, chord: Array) -> Array:
    """x: axis of the first member, by default horizontal across the leg; y: of the second, across both."""
    if joint.axes is not None:
        first, second = (nominal_axis(a, structure.nominal) for a in joint.axes)
        return np.column_stack([first, second, np.cross(first, second)])
    leg = unit(chord)
    across = np.cross([0.0, 0.0, 1.0], leg)
    first = unit(across) if np.sqrt(across @ across) > 1e-6 else np.array([1.0, 0.0, 0.0])
    second = np.cross(leg, first)
    return np.column_stack([first, second, np.cross(first, second)])


def rest_of(structure: Structure, joint: End | Joint) -> dict[str, Number]:
    """What the strains of a joint measure at rest where that is not 0: the angle of the axes of a universal joint."""
    return {} if joint.axes is None else {"rz": combined(neg, cosine(*joint.axes, structure.nominal))}


def add_joint_link(
    structure: Structure,
    name: str,
    kind: str,
    rows: tuple[str, ...],
    connections: tuple[ConnectionPoint, ConnectionPoint],
    triad: Array,
    stiffness: Stiffness | None,
    rest: dict[str, Number] | None = None,
    extra: dict[str, Number] | None = None,
    tilts: Tilts = CONSTANT,
    springs: tuple[str, ...] = (),
) -> None:
    """A joint element in the given directions: elastic where there is a stiffness, else rigid.

    `springs`: directions in which it is free but for a spring. `tilts`: how far parameters turn its axes on each side,
    base axes, in the reference configuration.
    """
    element = JointElement(kind, rows)
    numbers = [_direction_stiffness(stiffness, r, extra or {}) for r in rows]
    couplings = [_coupling(stiffness, a, b) for i, a in enumerate(rows) for b in rows[i + 1 :]]
    triads = tuple(structure.orientation(p.rotation).T @ triad for p in connections)
    rest_values = rest or {}
    first, second = (
        replace(at, rotation=structure.tilted(at.rotation, tilt, f"{name}.{side}.axis"))
        for at, tilt, side in zip(connections, tilts, "ij", strict=True)
    )
    structure.builder.link(
        element,
        name,
        (first, second),
        rest=[rest_values.get(r, 0.0) for r in rows],
        stiffness=[n or 0.0 for n in numbers] + couplings,
        rigid=[n is None for n in numbers],
        springs=[r in springs for r in rows],
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
