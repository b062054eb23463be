"""Beams, bars, ropes, joints, loads and weights as links of the layout."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..elements import JOINTS, Bar, Beam, ElasticBar, Joint, Load
from ..layout import GROUND, Turn
from ..layout_builder import Number, Port
from ..machine import Bar as BarSpec
from ..machine import Beam as BeamSpec
from ..machine import End, Section, Stiffness, axis_vector
from ..machine import Joint as JointSpec
from ..quantities import Quantity
from ..rotation import Array
from .numbers import combined, constant_vector, is_zero, number, triad_about, triad_along, unit, vector
from .structure import Structure

_PLANAR_ROWS = ("x", "y", "rz", "angle")


@dataclass(frozen=True)
class Weight:
    """A mass (kg) lumped at a port."""

    name: str
    port: Port
    mass: Number


def add_bars(structure: Structure, leg_lengths: dict[str, Number]) -> list[Weight]:
    """Bars and ropes; `leg_lengths`: rest lengths that drives set. Returns their lumped masses."""
    weights = []
    members = [(n, b, False) for n, b in structure.machine.bars.items()]
    members += [(n, r, True) for n, r in structure.machine.ropes.items()]
    for name, bar, rope in members:
        ports = (structure.port(bar.between[0]), structure.port(bar.between[1]))
        length = leg_lengths.get(name, rest_length(structure, bar, ports))
        given = bar.EA if bar.k is None else bar.k
        stiffness = None if given is None else number(given)
        structure.builder.link(
            Bar() if bar.EA is None else ElasticBar(),
            name,
            ports,
            rest=[length],
            stiffness=[stiffness or 0.0],
            rigid=[stiffness is None],
            rope=rope,
        )
        if bar.mass is not None:
            weights += _halves(name, ports, number(bar.mass))
    return weights


def rest_length(structure: Structure, bar: BarSpec | BeamSpec, ports: tuple[Port, Port]) -> Number:
    """Unstressed length: the file's, else the drawing's."""
    if bar.length is not None:
        return number(bar.length)
    ends = [structure.position(p.point) for p in ports]
    return float(np.sqrt(((ends[1] - ends[0]) ** 2).sum()))


def _halves(name: str, ports: tuple[Port, Port], mass: Number) -> list[Weight]:
    half = combined(lambda m: 0.5 * m, mass)
    return [Weight(f"{name}.{side}", port, half) for side, port in zip("ij", ports, strict=True)]


# --- beams ---------------------------------------------------------------------------------
def add_beams(structure: Structure) -> list[Weight]:
    """Beams with their end joints; returns their lumped masses."""
    weights = []
    for name, beam in structure.machine.beams.items():
        nodes = [structure.point(p) for p in beam.between]
        chord = structure.position(nodes[1]) - structure.position(nodes[0])
        up = np.array([q.number(structure.nominal) for q in beam.up]) if not is_zero(beam.up) else None
        triad = triad_along(chord, np.array([0.0, 0.0, 1.0]) if structure.planar else up)
        ports = [_beam_end(structure, name, side, beam, chord) for side in (0, 1)]
        weights += _beam_pieces(structure, name, beam, (ports[0], ports[1]), triad)
    return weights


def _beam_end(structure: Structure, name: str, side: int, beam: BeamSpec, chord: Array) -> Port:
    """Port of a beam's end: the node's own where welded, else with a rotation of its own."""
    end, node = beam.ends[side], beam.between[side]
    if end.joint == "fixed" and end.stiffness is None:
        return structure.port(node, turning=True)
    elastic = _elastic_rows(end.stiffness, end.joint, structure.planar)
    label = f"{name}.{'ij'[side]}"
    moving = [d for d in elastic if d in "xyz"]
    point = structure.point(node)
    if moving:
        point = structure.free_point(label, structure.position(point))
    turning = end.joint != "fixed" or any(d[0] == "r" for d in elastic)
    rotation = structure.new_rotation(label) if turning else structure.rotation(node)
    port = Port(point, rotation)
    triad = _joint_triad(structure, end, chord)
    rows = tuple(d for d in joint_rows(end.joint, structure.planar) if d[0] == "r" or moving)
    if rows:
        add_joint_link(
            structure,
            label,
            end.joint,
            rows,
            (structure.port(node, rows[-1][0] == "r"), port),
            triad,
            end.stiffness,
        )
    return port


def _joint_triad(structure: Structure, joint: End | JointSpec, chord: Array) -> Array:
    """The joint's own triad in the drawing, base axes (columns)."""
    kind = joint.joint if isinstance(joint, End) else joint.type
    if kind == "universal":
        return _universal_triad(structure, joint, chord)
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


def _beam_pieces(
    structure: Structure, name: str, beam: BeamSpec, ports: tuple[Port, Port], triad: Array
) -> list[Weight]:
    """The beam's elements between its ends, through interior nodes where it has several pieces."""
    count = beam.pieces
    ends = [structure.position(p.point) for p in ports]
    stations = [ports[0]]
    for k in range(1, count):
        label = f"{name}.{k}"
        stations.append(
            Port(
                structure.free_point(label, ends[0] + (ends[1] - ends[0]) * k / count),
                structure.new_rotation(label),
            )
        )
    stations.append(ports[1])
    total = rest_length(structure, beam, ports)
    length = combined(lambda l: l / count, total)
    element = Beam(structure.planar)
    stiffness = beam_stiffness(structure, beam, length)
    rigid = {s: stiffness[k] is None for k, names in enumerate(_beam_strains(element)) for s in names}
    mass = _beam_mass(structure, beam, total)
    weights = []
    for k in range(count):
        pair = (stations[k], stations[k + 1])
        triads = tuple(structure.orientation(p.rotation).T @ triad for p in pair)
        structure.builder.link(
            element,
            name if count == 1 else f"{name}.{k}",
            pair,
            rest=[length] + [0.0] * (len(element.strains) - 1),
            stiffness=[s or 0.0 for s in stiffness],
            rigid=[rigid[s] for s in element.strains],
            triads=(triads[0], triads[1]),
        )
        if mass is not None:
            weights += _halves(f"{name}.{k}", pair, combined(lambda m: m / count, mass))
    return weights


def _beam_strains(element: Beam) -> list[tuple[str, ...]]:
    """Strains that share one stiffness number, in the order of the numbers."""
    kinds = ["elongation", "bend_z"] if element.planar else ["elongation", "torsion", "bend_y", "bend_z"]
    return [tuple(s for s in element.strains if s.startswith(kind)) for kind in kinds]


def beam_stiffness(structure: Structure, beam: BeamSpec, length: Number) -> list[Number | None]:
    """EA/L, (GJ/L, EIy/L,) EIz/L; None where that deformation is rigid."""
    machine = structure.machine
    section = machine.sections[beam.section] if beam.section else None
    material = machine.materials[beam.material] if beam.material else None
    products: dict[str, Number | None] = {
        "EA": None if beam.EA is None else number(beam.EA),
        "EIy": None if (beam.EIy or beam.EI) is None else number(beam.EIy or beam.EI),
        "EIz": None if (beam.EIz or beam.EI) is None else number(beam.EIz or beam.EI),
        "GJ": None if beam.GJ is None else number(beam.GJ),
    }
    if section is not None and material is not None:
        shape = section_properties(section)
        for key, of in (("EA", "A"), ("EIy", "Iy"), ("EIz", "Iz")):
            if products[key] is None and of in shape:
                products[key] = combined(lambda e, a: e * a, material.E, shape[of])
        if products["GJ"] is None and "J" in shape:
            products["GJ"] = combined(lambda g, j: g * j, shear_modulus(material), shape["J"])
    order = ["EA", "EIz"] if structure.planar else ["EA", "GJ", "EIy", "EIz"]
    return [None if products[k] is None else combined(lambda p, l: p / l, products[k], length) for k in order]  # type: ignore[arg-type]


def shear_modulus(material: object) -> Number:
    """G, or E / (2 (1 + nu)) with nu = 0.3 by default."""
    from ..machine import Material

    assert isinstance(material, Material)
    if material.G is not None:
        return number(material.G)
    nu = number(material.nu, 0.3)
    return combined(lambda e, n: e / (2 * (1 + n)), material.E, nu)


def section_properties(section: Section) -> dict[str, Number]:
    """A (m^2), Iy, Iz, J (m^4); squares and rectangles twist by Saint-Venant's series (Roark, table 10.1)."""
    if section.square is not None:
        return _rectangle(section.square, section.square)
    if section.rectangle is not None:
        return _rectangle(*section.rectangle)
    if section.round is not None:
        return _tube(section.round, Quantity.constant(0.0))
    if section.tube is not None:
        return _tube(*section.tube)
    out: dict[str, Number] = {}
    for key, value in (("A", section.area), ("Iy", section.Iy), ("Iz", section.Iz), ("J", section.J)):
        if value is not None:
            out[key] = number(value)
    return out


def _rectangle(b: Quantity, h: Quantity) -> dict[str, Number]:
    def torsion(p: complex, q: complex) -> complex:
        long, short = (p, q) if np.real(p) >= np.real(q) else (q, p)
        r = short / long
        return long * short**3 * (1 / 3 - 0.21 * r * (1 - r**4 / 12))

    return {
        "A": combined(lambda p, q: p * q, b, h),
        "Iy": combined(lambda p, q: p * q**3 / 12, b, h),
        "Iz": combined(lambda p, q: q * p**3 / 12, b, h),
        "J": combined(torsion, b, h),
    }


def _tube(outer: Quantity, inner: Quantity) -> dict[str, Number]:
    area = combined(lambda d, e: np.pi / 4 * (d**2 - e**2), outer, inner)
    second = combined(lambda d, e: np.pi / 64 * (d**4 - e**4), outer, inner)
    return {"A": area, "Iy": second, "Iz": second, "J": combined(lambda i: 2 * i, second)}


def _beam_mass(structure: Structure, beam: BeamSpec, length: Number) -> Number | None:
    if beam.mass is not None:
        return number(beam.mass)
    material = structure.machine.materials[beam.material] if beam.material else None
    section = structure.machine.sections[beam.section] if beam.section else None
    if material is None or section is None or material.density is None:
        return None
    area = section_properties(section)["A"]
    return combined(lambda r, a, l: r * a * l, material.density, area, length)


# --- joints --------------------------------------------------------------------------------
def joint_rows(kind: str, planar: bool) -> tuple[str, ...]:
    """Blocked directions of a joint type."""
    rows = JOINTS[kind].blocked
    return tuple(r for r in rows if r in _PLANAR_ROWS) if planar else rows


def _elastic_rows(stiffness: Stiffness | None, kind: str, planar: bool) -> tuple[str, ...]:
    """Blocked directions that yield."""
    if stiffness is None:
        return ()
    rows = joint_rows(kind, planar)
    return tuple(
        r
        for r in rows
        if getattr(stiffness, r, None) is not None or (stiffness.radial is not None and r in "xyz")
    )


def add_joints(structure: Structure) -> None:
    """What the joints hold beyond the tree of points, and their springs."""
    for name, joint in structure.machine.joints.items():
        tree = structure.joint_is_ideal_tree(name)
        shares = tree and joint.type in ("fixed", "prismatic")
        rows = joint_rows(joint.type, structure.planar)
        if tree:
            rows = tuple(
                r for r in rows if r[0] == "r" and not shares and not _axis_built_in(structure, name)
            )
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
            triad = _joint_triad(structure, joint, chord if chord.any() else np.array([0.0, 0.0, 1.0]))
            add_joint_link(structure, name, joint.type, rows, ports, triad, joint.stiffness, None, extra)


def _axis_built_in(structure: Structure, name: str) -> bool:
    """Whether a placed body turns about one fixed axis: its revolute joint needs no constraint."""
    child = next(c for c, (joint, _) in structure.placed_by.items() if joint == name)
    rotation = structure.rotations.get(child)
    return rotation is not None and structure.builder.rotations[rotation][0] == Turn.AXIS


def free_springs(stiffness: Stiffness | None, kind: str, planar: bool) -> tuple[str, ...]:
    """Springs in free directions: torsion of a revolute joint (`rz`), along a sliding one (`x`)."""
    if stiffness is None:
        return ()
    drive = JOINTS[kind].drive
    if drive == "rz" and stiffness.rz is not None:
        return ("angle",)
    return (drive,) if drive is not None and getattr(stiffness, drive) is not None else ()


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


# --- guides, loads, weights ----------------------------------------------------------------
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
        ports = (Port(rail.origin, rail.rotation), structure.port(name))
        triad = structure.orientation(rail.rotation)
        add_joint_link(
            structure,
            f"{name}.guidance",
            "fixed",
            rows,
            ports,
            triad,
            structure.machine.guides[body.on].stiffness,
        )


def add_loads(structure: Structure, weights: list[Weight]) -> None:
    """Nodal forces and moments, masses of nodes and bodies, and lumped weights."""
    machine, b = structure.machine, structure.builder
    for name, load in machine.loads.items():
        if not is_zero(load.force):
            force = [number(q) for q in load.force]
            _add_force(structure, f"{name}.force", structure.port(load.at), force)
        if not is_zero(load.moment):
            _add_moment(structure, f"{name}.moment", structure.rotation(load.at), load.moment)
    if not machine.own_weight or not machine.gravity:
        return
    gravity = constant_vector(machine.gravity, structure.nominal)
    for name, node in machine.nodes.items():
        if node.mass is not None:
            weights = [*weights, Weight(name, structure.port(name), number(node.mass))]
    for name, body in machine.bodies.items():
        if body.mass is not None:
            weights = [*weights, Weight(name, _centre(structure, name), number(body.mass))]
    for weight in weights:
        force = [combined(lambda m, a=float(a): m * a, weight.mass) for a in gravity]
        _add_force(structure, f"{weight.name}.weight", weight.port, force)


def _add_moment(structure: Structure, name: str, rotation: int, moment: tuple[Quantity, ...]) -> None:
    """A moment on a rotation: its part about the axis of one that turns about one, none on a fixed one."""
    b = structure.builder
    kind, axis = b.rotations[rotation][:2]
    if kind == Turn.AXIS:
        parts = [number(q) for q in moment]
        about = axis if len(parts) == 3 else axis[2:]
        share = combined(lambda *m: sum(a * v for a, v in zip(about.tolist(), m, strict=True)), *parts)
        b.force("rotation", 3 * rotation, b.slot(share, name))
    elif kind == Turn.FREE:
        for k, q in enumerate(moment):
            b.force("rotation", 3 * rotation + k, b.slot(number(q), f"{name}.{k}"))


def _centre(structure: Structure, name: str) -> Port:
    """Centre of mass of a body."""
    port, centre = structure.port(name), structure.machine.bodies[name].centre
    if is_zero(centre):
        return port

    return Port(
        port.point + structure.builder.offset(port.rotation, vector(centre), f"{name}.centre"), port.rotation
    )


def _add_force(structure: Structure, name: str, port: Port, force: list[Number]) -> None:
    from ..layout_builder import Point

    full = (list(force) + [0.0] * 3)[:3]
    pull = [combined(lambda f: -f, f) for f in full]
    base = Port(Point(), GROUND)
    structure.builder.link(
        Load(), name, (base, port), rest=[0.0] * 3, stiffness=[], rigid=[False] * 3, prestress=pull
    )
