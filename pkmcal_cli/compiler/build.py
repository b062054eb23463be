"""From a machine to a model: structure, members, drives, sensors; once to close the machine, once closed."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from pkmcal_cli.base.errors import Fault, warnings_among
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.compiler import assemble as asm
from pkmcal_cli.compiler.base_places import base_of
from pkmcal_cli.compiler.coordinates import ReferenceConfiguration
from pkmcal_cli.compiler.drawn_places import far_from_drawing
from pkmcal_cli.compiler.drives import PlacedDrive, add_drive, as_travel
from pkmcal_cli.compiler.effect_groups import effect_groups
from pkmcal_cli.compiler.joints import add_fixed_rotations
from pkmcal_cli.compiler.layout import layout_of
from pkmcal_cli.compiler.members import add_members
from pkmcal_cli.compiler.parameters import model_parameters
from pkmcal_cli.compiler.physical import number_faults
from pkmcal_cli.compiler.placed_effects import declared_effects
from pkmcal_cli.compiler.rope_faults import drawn_faults, pull_faults
from pkmcal_cli.compiler.ropes import cables
from pkmcal_cli.compiler.sensor_table import PlacedPoint, SensorTable
from pkmcal_cli.compiler.shared_misfit import with_yielding_drives, yields
from pkmcal_cli.compiler.site_coefficients import LOAD, effect_sites_of
from pkmcal_cli.compiler.structure import Structure
from pkmcal_cli.compiler.weights import add_loads
from pkmcal_cli.compiler.workspaces import workspace_of
from pkmcal_cli.elements import JointElement, LoadElement, OrientationElement
from pkmcal_cli.equilibrium.kinematics import point_poses, reference_state
from pkmcal_cli.equilibrium.mobility import pivots, strain_rows
from pkmcal_cli.equilibrium.system import DriveState
from pkmcal_cli.language.fingerprint import fingerprint_of
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.mechanism.builder import TopologyBuilder
from pkmcal_cli.mechanism.connection_points import ConnectionPoint, Point
from pkmcal_cli.mechanism.topology import GROUND, DriveKind, Topology
from pkmcal_cli.model.layout import Layout
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.parts import Actuator, Channel, LeastTension
from pkmcal_cli.model.tool_motion import AimedPoint
from pkmcal_cli.units.measurands import Measurand

_SMALLEST = 1e-3  # m; the size of a machine drawn in one point


@dataclass(frozen=True)
class Compiled:
    """A model and what its compilation found."""

    model: Model
    mobility: asm.Mobility
    gaps: tuple[asm.Gap, ...]
    doubts: tuple[Fault, ...]  # warnings of what the reference configuration looks like
    layout: Layout
    shared_by: tuple[str, ...] = ()  # rigid elements that join drives, all of which yield alike


def compile_machine(machine: Machine, receptive: bool = False) -> Compiled:
    """The model of a machine; where nothing yields in loops of drives, all drives yield alike. Raises BadInput."""
    made = _compiled(machine, receptive)
    if not made.mobility.rigid_loops or yields(machine):
        return made
    shared = _compiled(with_yielding_drives(machine, made.model.length), receptive)
    if shared.mobility.rigid_loops:  # not the drives' doing
        return made
    model = replace(shared.model, fingerprint=made.model.fingerprint)
    return replace(shared, model=model, shared_by=made.mobility.rigid_loops)


def _compiled(machine: Machine, receptive: bool) -> Compiled:
    """The model of a machine. Faults of the mechanism are in `mobility` and `gaps`; `check` reports them.

    Raises BadInput where it has numbers that cannot be, or effects at places that it does not have.

    `receptive`: effects can enter (they have coefficients of their own); so it is where the machine declares effects.
    """
    fitted = frozenset(n for n, s in machine.sensors.items() if s.frame not in (None, "machine"))
    receptive = receptive or bool(machine.effects) or bool(fitted)
    first = _assembled(machine, ReferenceConfiguration(), receptive)
    warnings_among(drawn_faults(first.structure))
    warnings_among(number_faults(machine, first.topology, first.drives))
    length = first.length
    state, gaps = asm.assemble(first.topology, length)
    made = _assembled(machine, asm.reference_configuration(first.topology, state), receptive)
    far = far_from_drawing(machine, first.topology, state, length)
    doubts = (*warnings_among([*drawn_faults(made.structure), *pull_faults(made.structure)]), *far)
    topology, drives, sensors = made.topology, made.drives, made.sensors
    basis, system = asm.free_motions(topology, length)
    read = tuple(v.index for v in sensors.observed if v.measurand is Measurand.ORIENTATION)
    quiet, loud = asm.split_motions(topology, basis, system, length, read)
    held = tuple(int(system.free[k]) for k in pivots(quiet))
    held_names = tuple(asm.coordinate_name(topology, k) for k in held)
    loud_names = tuple(asm.coordinate_name(topology, int(system.free[k])) for k in pivots(loud))
    topology = replace(topology, parked=held)
    mobility = asm.mobility(topology, length, held_names, loud_names)
    model = _model(machine, made, topology, length)
    base = base_of(made.structure, topology.drives, made.supports, machine)
    model = replace(model, base=base, datum=machine.datum, fingerprint=fingerprint_of(machine))
    if receptive:
        sites = effect_sites_of(
            made.structure, topology, drives, model.sensors, model.reference_coefficients[0], made.payload
        )
        model = replace(model, sites=sites, fitted_frames=fitted, effect_groups=effect_groups(machine, sites))
        model = model.with_effects(*declared_effects(machine, model))
    vectors = len(topology.offset_vectors.offset_coefficients)
    return Compiled(model, mobility, tuple(gaps), doubts, layout_of(made.structure, vectors))


@dataclass(frozen=True, kw_only=True)
class _Assembly:
    """One pass over a machine; `length`: its size, m; `payload`: name of the place where a payload is."""

    topology: Topology
    drives: list[PlacedDrive]
    sensors: SensorTable
    length: float
    structure: Structure
    payload: str
    tool: AimedPoint
    measured: AimedPoint
    supports: frozenset[tuple[str, str]]


def _assembled(machine: Machine, configuration: ReferenceConfiguration, receptive: bool) -> _Assembly:
    """One pass over the machine."""
    builder = TopologyBuilder(planar=machine.space == "planar", nominal=machine.nominal_values())
    structure = Structure(machine=machine, configuration=configuration, builder=builder, receptive=receptive)
    structure.prepare()
    for name in [*machine.bodies, *machine.nodes, *structure.owner]:
        structure.point(name)
    weights = add_members(structure)
    drives = [add_drive(structure, name, actuator) for name, actuator in machine.actuators.items()]
    add_loads(structure, weights)
    add_fixed_rotations(structure)
    supports = frozenset(structure.anchors)
    sensors = SensorTable(structure)
    sensors.place_all(machine)
    base, tool = ConnectionPoint(Point(), GROUND), sensors.tool(machine)
    if receptive:
        builder.link(LoadElement(), LOAD, (base, tool.at), rest=[0.0] * 3, stiffness=[], rigid=[False] * 3)
    points = (tool, sensors.measured(machine) or tool)
    aims = {p.point: _aim_at(structure, p.at) for p in points}
    topology = asm.with_springs(builder.build([(d.drive, d.element, d.strain) for d in drives]), _size(structure))
    poses = {p.point: _reference_pose(topology, p) for p in points}
    aimed = [AimedPoint(p.point, p.at.rotation, aims[p.point], poses[p.point]) for p in points]
    return _Assembly(
        topology=topology,
        drives=drives,
        sensors=sensors,
        length=_size(structure),
        structure=structure,
        payload=tool.name,
        tool=aimed[0],
        measured=aimed[1],
        supports=supports,
    )


def _size(structure: Structure) -> float:
    """Size of the machine, wherever it stands: diagonal of the box around its points as filed, m."""
    places = np.array([structure.position(point) for point in structure.points.values()])
    diagonal = np.ptp(places, axis=0)
    return max(float(np.sqrt(diagonal @ diagonal)), _SMALLEST)


def _aim_at(structure: Structure, at: ConnectionPoint) -> tuple[int, ...]:
    """Constraints by which inverse positions hold a point: its place, and its orientation where it has one."""
    builder, base = structure.builder, ConnectionPoint(Point(), GROUND)
    axes = ("x", "y") if structure.planar else ("x", "y", "z")
    place = builder.aim(JointElement("fixed", axes), "aim.place", (base, at))
    if at.rotation == GROUND:
        return (place,)
    filed = builder.filed.get(at.rotation, structure.orientation(at.rotation))
    rotations = ("rz",) if structure.planar else ("rx", "ry", "rz")
    return place, builder.aim(OrientationElement(rotations), "aim.turn", (base, at), triad=filed.T)


def _model(machine: Machine, assembly: _Assembly, topology: Topology, length: float) -> Model:
    parameters = model_parameters(machine)
    sensors = assembly.sensors
    actuators = tuple(_actuator(machine, topology, d) for d in assembly.drives)
    channels = sensors.channels(machine)
    for channel in _drive_channels(topology, actuators):
        sensors.direct.append((len(channels), sensors.quantity(Measurand.DRIVE, channel.index)))
        channels.append(channel)
    readings = _reference_readings(topology, actuators)
    return Model(
        name=machine.files[0][0] if machine.files else "machine",
        topology=topology,
        parameters=parameters,
        actuators=actuators,
        channels=tuple(channels),
        length=length,
        reference_readings=readings,
        tool=assembly.tool,
        measured=assembly.measured,
        workspace=workspace_of(machine, actuators),
        observed=tuple(sensors.observed),
        direct=tuple(sensors.direct),
        sensors=tuple(sensors.sensors),
        correlated=sensors.correlated(machine),
        least_tensions=_least_tensions(machine, topology),
    )


def _least_tensions(machine: Machine, topology: Topology) -> tuple[LeastTension, ...]:
    """Ropes that have to be taut."""
    nominal = machine.nominal_values()
    places = {n: (g, e) for g, group in enumerate(topology.groups) for e, n in enumerate(group.names) if group.rope[e]}
    return tuple(
        LeastTension(name, places[cable.name], cable.weights[name], rope.t_min.number(nominal))
        for cable in cables(machine).values()
        for name, rope in cable.ropes.items()
        if rope.t_min is not None
    )


def _actuator(machine: Machine, topology: Topology, placed: PlacedDrive) -> Actuator:
    spec = machine.actuators[placed.drive.name]
    nominal = machine.nominal_values()
    low, high = (-math.inf, math.inf)
    if spec.limits is not None:
        low, high = (q.number(nominal) for q in spec.limits)
    sigma = math.nan if spec.sigma is None else as_travel(spec.sigma, spec, nominal)
    dimension = spec.reading_dimension
    unit = spec.unit or machine.file_units.unit(dimension).text
    return Actuator(
        name=placed.drive.name,
        gain_coefficient=placed.gain_coefficient,
        limits=(low, high),
        force_limit=math.inf if spec.force_limit is None else spec.force_limit.number(nominal),
        sigma=sigma,
        unit=unit,
        dimension=dimension.name,
        force_coefficient=placed.force_coefficient,
        sigma_is=spec.sigma_is,
    )


def _drive_channels(topology: Topology, actuators: tuple[Actuator, ...]) -> list[Channel]:
    """Readings of the drives that do not hold their position."""
    out = []
    for a, (drive, actuator) in enumerate(zip(topology.drives, actuators, strict=True)):
        if drive.force_controlled:
            gain = abs(float(topology.coefficients.constants[actuator.gain_coefficient]))
            out.append(
                Channel(
                    name=drive.name,
                    measurand=Measurand.DRIVE,
                    index=a,
                    component=0,
                    sigma=actuator.sigma / gain,
                    unit=actuator.unit,
                    dimension=actuator.dimension,
                    instrument=actuator.name,
                    sigma_is=actuator.sigma_is,
                )
            )
    return out


def _reference_readings(topology: Topology, actuators: tuple[Actuator, ...]) -> Array:
    """Readings of all drives at the assembled reference configuration, (A,)."""
    coefficients = topology.coefficients.constants[None]
    engaged = asm.all_drives(topology, DriveState.ENGAGED)
    state = reference_state(topology, coefficients, 1, engaged.constraints)
    rows = strain_rows(engaged, coefficients, state, 1.0)
    strains = dict(zip(rows.names, rows.values.tolist(), strict=True))
    out = []
    for drive, actuator in zip(topology.drives, actuators, strict=True):
        gain, base = coefficients[0, actuator.gain_coefficient], coefficients[0, drive.coefficient]
        if drive.kind is DriveKind.TRAVEL:
            moved = state.translation[0, drive.target[0]] - base
        elif drive.kind is DriveKind.ROTATION:
            moved = -base
        else:
            g, e, m = drive.target
            group = topology.groups[g]
            moved = strains[group.names[e], group.element.strains[m]]
        out.append(moved / gain)
    return np.array(out)


def _reference_pose(topology: Topology, placed: PlacedPoint) -> Array:
    """Pose (6,) of a point at the assembled reference configuration."""
    coefficients = topology.coefficients.constants[None]
    state = reference_state(topology, coefficients, 1, 0)
    return np.asarray(point_poses(topology, coefficients, state, placed.point, placed.at.rotation)[0])
