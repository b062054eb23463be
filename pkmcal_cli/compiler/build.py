"""From a machine to a model: structure, members, drives and sensors, twice - for the drawing, then assembled."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from pkmcal_cli.base.errors import BadInput
from pkmcal_cli.base.rotation import Array, log
from pkmcal_cli.compiler import assemble as asm
from pkmcal_cli.compiler.bars import add_bars
from pkmcal_cli.compiler.beams import add_beams
from pkmcal_cli.compiler.drives import PlacedDrive, add_drive, leg_lengths
from pkmcal_cli.compiler.effects import declared_effects
from pkmcal_cli.compiler.joints import add_guides, add_joints
from pkmcal_cli.compiler.physical import number_faults
from pkmcal_cli.compiler.sensors import SensorTable
from pkmcal_cli.compiler.sockets import LOAD, sockets_of
from pkmcal_cli.compiler.structure import Drawing, Structure
from pkmcal_cli.compiler.weights import add_loads
from pkmcal_cli.elements import Joint, Load
from pkmcal_cli.equilibrium.kinematics import drawn_state
from pkmcal_cli.equilibrium.mobility import pivots, strain_rows
from pkmcal_cli.equilibrium.system import DriveState
from pkmcal_cli.language.channels import kind_of_sensor
from pkmcal_cli.language.fingerprint import fingerprint_of
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.mechanism.builder import LayoutBuilder
from pkmcal_cli.mechanism.connection_points import Point, Port
from pkmcal_cli.mechanism.topology import GROUND, DriveKind, Index, Layout, Turn
from pkmcal_cli.model.model import Actuator, Channel, Model, ModelParameter

_SMALLEST = 1e-3  # m; the size of a machine drawn in one point


@dataclass(frozen=True)
class Compiled:
    """A model and what its compilation found."""

    model: Model
    mobility: asm.Mobility
    gaps: tuple[asm.Gap, ...]


def compile_machine(machine: Machine, receptive: bool = False) -> Compiled:
    """The model of a machine. Faults of the mechanism are in `mobility` and `gaps`; `check` reports them.

    Raises BadInput where it has numbers that cannot be, or effects at places that it does not have.

    `receptive`: effects can enter (they have slots of their own); so it is where the machine declares effects.
    """
    fitted = frozenset(n for n, s in machine.sensors.items() if s.frame not in (None, "machine"))
    receptive = receptive or bool(machine.effects) or bool(fitted)
    first = _draft(machine, Drawing(), receptive)
    if wrong := number_faults(machine, first.layout, first.drives):
        raise BadInput(wrong)
    length = first.length
    state, gaps = asm.assemble(first.layout, length)
    made = _draft(machine, asm.drawing_of(first.layout, state), receptive)
    layout, drives, sensors = made.layout, made.drives, made.sensors
    held_names: tuple[str, ...] = ()
    basis, system = asm.free_motions(layout, length)
    read = tuple(v.index for v in sensors.views if v.quantity == "orientation")
    quiet, loud = asm.split_motions(layout, basis, system, length, read)
    held = tuple(int(system.free[k]) for k in pivots(quiet))
    held_names = tuple(asm.coordinate_name(layout, k) for k in held)
    loud_names = tuple(asm.coordinate_name(layout, int(system.free[k])) for k in pivots(loud))
    layout = replace(layout, held=held)
    found = asm.mobility(layout, length, held_names, loud_names)
    model = _model(machine, layout, drives, sensors, length)
    base, turns = _base_slots(made.structure, machine)
    model = replace(model, base=base, base_turns=turns, datum=machine.datum, fingerprint=fingerprint_of(machine))
    if receptive:
        sockets = sockets_of(made.structure, layout, drives, model.sensors, model.drawn_slots[0])
        model = replace(model, sockets=sockets)
        model = replace(model, fitted_frames=fitted)
        model = model.with_effects(*declared_effects(machine, model.sockets, model.length))
    return Compiled(model, found, tuple(gaps))


def _base_slots(structure: Structure, machine: Machine) -> tuple[Index, Index]:
    """Slots of the places of everything fixed to the base (B, 3), and of the turns of its frames (F, 3)."""
    builder = structure.builder
    inner = {name for name, guide in machine.guides.items() if guide.frame is not None}
    fixed = ("ground", "frame", "fixed")
    places = [
        builder.offsets[index]
        for (kind, name), index in structure.anchors.items()
        if kind in fixed or (kind == "guide" and name not in inner)
    ]
    turns = [builder.rotations[rotation][3] for _, rotation in structure.frames.values()]
    return np.array(places, dtype=np.intp).reshape(-1, 3), np.array(turns, dtype=np.intp).reshape(-1, 3)


@dataclass(frozen=True)
class _Draft:
    """One pass over a machine; `length`: its size, m."""

    layout: Layout
    drives: list[PlacedDrive]
    sensors: SensorTable
    length: float
    structure: Structure


def _draft(machine: Machine, drawing: Drawing, receptive: bool) -> _Draft:
    """One pass over the machine."""
    builder = LayoutBuilder(planar=machine.space == "planar", nominal=machine.nominal_values())
    structure = Structure(machine=machine, drawing=drawing, builder=builder, receptive=receptive)
    structure.prepare()
    for name in [*machine.bodies, *machine.nodes, *structure.owner]:
        structure.point(name)
    weights = add_beams(structure)
    weights += add_bars(structure, leg_lengths(structure))
    add_joints(structure)
    add_guides(structure)
    drives = [add_drive(structure, name, actuator) for name, actuator in machine.actuators.items()]
    add_loads(structure, weights)
    sensors = SensorTable(structure)
    if not any(kind_of_sensor(s).sees_tool for s in machine.sensors.values()):
        last = next(reversed([*machine.bodies, *machine.nodes]))
        builder.reading_point("tcp", structure.port(last))
    sensors.place_all(machine)
    if receptive:
        base, tcp = Port(Point(), GROUND), builder.points[0].ports[1]
        builder.link(Load(), LOAD, (base, tcp), rest=[0.0] * 3, stiffness=[], rigid=[False] * 3)
    _aim_at_tcp(structure, sensors.tcp)
    layout = builder.build([(d.drive, d.element, d.strain) for d in drives])
    return _Draft(layout, drives, sensors, _size(structure), structure)


def _size(structure: Structure) -> float:
    """Size of the machine, wherever it stands: diagonal of the box around its points in the drawing, m."""
    places = np.array([structure.position(point) for point in structure.points.values()])
    diagonal = np.ptp(places, axis=0)
    return max(float(np.sqrt(diagonal @ diagonal)), _SMALLEST)


def _aim_at_tcp(structure: Structure, rotation: int) -> None:
    """Constraints by which inverse positions put the TCP at a pose: place, and orientation where it has one."""
    builder = structure.builder
    port = builder.points[0].ports[1]
    base = Port(Point(), GROUND)
    builder.aim(Joint("fixed", ("x", "y") if structure.planar else ("x", "y", "z")), "tcp.place", (base, port))
    if rotation != GROUND:
        drawn = structure.orientation(port.rotation)
        filed = builder.filed.get(port.rotation, drawn)
        slots = [builder.slot(float(v), f"tcp.turn.{c}") for v, c in zip(log(drawn @ filed.T), "xyz", strict=True)]
        aim = builder.rotation(Turn.FIXED, "tcp.aim", drawn=filed, slots=slots)
        turns = ("rz",) if structure.planar else ("rx", "ry", "rz")
        builder.aim(Joint("fixed", turns), "tcp.turn", (Port(Point(), aim), port))


def _model(machine: Machine, layout: Layout, drives: list[PlacedDrive], sensors: SensorTable, length: float) -> Model:
    parameters = tuple(
        ModelParameter(
            name=name,
            nominal=p.nominal,
            range=p.range,
            bounds=p.bounds if p.bounds is not None else (-math.inf, math.inf),
            unit=p.unit,
            dimension=p.dimension.name,
            identify=p.identify,
            per_session=p.per == "session",
        )
        for name, p in machine.parameters.items()
    )
    actuators = tuple(_actuator(machine, layout, d) for d in drives)
    channels = sensors.channels(machine)
    for channel in _drive_channels(layout, actuators):
        sensors.direct.append((len(channels), sensors.view("drive", channel.index)))
        channels.append(channel)
    readings = _drawn_readings(layout, actuators)
    return Model(
        name=machine.files[0][0] if machine.files else "machine",
        layout=layout,
        parameters=parameters,
        actuators=actuators,
        channels=tuple(channels),
        length=length,
        drawn_readings=readings,
        tcp=(0, sensors.tcp),
        tcp_drawn=_tcp_drawn(layout, 0, sensors.tcp),
        views=tuple(sensors.views),
        direct=tuple(sensors.direct),
        sensors=tuple(sensors.sensors),
        correlated=sensors.correlated(machine),
    )


def _actuator(machine: Machine, layout: Layout, placed: PlacedDrive) -> Actuator:
    spec = machine.actuators[placed.drive.name]
    nominal = machine.nominal_values()
    low, high = (-math.inf, math.inf)
    if spec.limits is not None:
        low, high = (q.number(nominal) for q in spec.limits)
    sigma = math.nan if spec.sigma is None else spec.sigma.number(nominal)
    dimension = spec.reading_dimension
    unit = spec.unit or machine.file_units.unit(dimension).text
    return Actuator(
        name=placed.drive.name,
        gain_slot=placed.gain_slot,
        limits=(low, high),
        sigma=sigma,
        unit=unit,
        dimension=dimension.name,
        force_slot=placed.force_slot,
    )


def _drive_channels(layout: Layout, actuators: tuple[Actuator, ...]) -> list[Channel]:
    """Readings of the drives that do not hold their position."""
    out = []
    for a, (drive, actuator) in enumerate(zip(layout.drives, actuators, strict=True)):
        if drive.force_controlled:
            gain = abs(float(layout.slots.constants[actuator.gain_slot]))
            out.append(
                Channel(
                    name=drive.name,
                    quantity="drive",
                    index=a,
                    component=0,
                    sigma=actuator.sigma / gain,
                    unit=actuator.unit,
                    dimension=actuator.dimension,
                )
            )
    return out


def _drawn_readings(layout: Layout, actuators: tuple[Actuator, ...]) -> Array:
    """Readings of all drives at the assembled drawing, (A,)."""
    slots = layout.slots.constants[None]
    engaged = asm.all_drives(layout, DriveState.ENGAGED)
    state = drawn_state(layout, slots, 1, engaged.constraints)
    rows = strain_rows(engaged, slots, state, 1.0)
    strains = dict(zip(rows.names, rows.values.tolist(), strict=True))
    out = []
    for drive, actuator in zip(layout.drives, actuators, strict=True):
        gain, base = slots[0, actuator.gain_slot], slots[0, drive.slot]
        if drive.kind is DriveKind.TRAVEL:
            moved = state.travel[0, drive.target[0]] - base
        elif drive.kind is DriveKind.ROTATION:
            moved = -base
        else:
            g, e, m = drive.target
            group = layout.groups[g]
            moved = strains[group.names[e], group.element.strains[m]]
        out.append(moved / gain)
    return np.array(out)


def _tcp_drawn(layout: Layout, point: int, rotation: int) -> Array:
    from pkmcal_cli.equilibrium.kinematics import arm_vectors, link_vectors

    slots = layout.slots.constants[None]
    state = drawn_state(layout, slots, 1, 0)
    links = link_vectors(layout, arm_vectors(layout, slots, state))
    turn = log(layout.rotations.drawn[rotation] @ layout.rotations.filed[rotation].T)
    return np.concatenate([links[0, layout.points[point]], turn])
