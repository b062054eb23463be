"""What is drawn of a machine: where its parts are in one row, and where the control believes them to be.

The control's machine has nominal parameters, no effects and no loads, and its redundant drives follow: the rigid pose
of the nominal machine (Ecorchard 2010, section 3.1.1). The other is the equilibrium of the machine at the parameter
values that are given, with effects, loads and strain. Between them lies what a picture exaggerates.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.compiler.layout import members
from pkmcal_cli.equilibrium.assembly import balance
from pkmcal_cli.equilibrium.status import reason_of
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.language.quantities import Quantity
from pkmcal_cli.loading.load_machine import LoadedMachine
from pkmcal_cli.model.layout import JointPlace, Layout, Placed
from pkmcal_cli.model.model import Model
from pkmcal_cli.pictures.shapes import JointShape, MachineShape, Shape
from pkmcal_cli.prediction import Rows, configuration
from pkmcal_cli.prediction.forces import drive_forces
from pkmcal_cli.prediction.solving import Solution

_NO_FORCE = 1e-6  # N or N m
_ENDLESS = 10.0  # sizes of the machine: limits so wide are no end of a guide
_BEYOND = 0.08  # of the machine's size: how far a guide is drawn beyond its carriages


def machine_shape(
    loaded: LoadedMachine, values: Array, rows: Rows, row: int, believed: Rows | None = None
) -> MachineShape | str:
    """A machine in one row at parameter values (P,), SI, or why the row cannot be solved.

    believed: rows with the set values at which the control believes that nothing is strained; by default the same.
    """
    model = loaded.model
    actual = configuration(model, values, rows, row)
    if actual.failed[0]:
        return _reason(actual)
    plain, believed = model.with_options(()), rows if believed is None else believed
    reference = configuration(plain, model.nominal, believed, row, "rigid")
    if reference.failed[0]:  # a mechanism that its drives alone do not hold
        reference = configuration(plain, model.nominal, believed, row)
    if reference.failed[0]:
        return _reason(reference)
    layout, machine = loaded.compiled.layout, loaded.machine
    forces = drive_forces(model, actual)[0][0]
    names = model.drive_names
    turning = [n for n, d in zip(names, model.topology.drives, strict=True) if not model.topology.moves_length(d)]
    reach = _reach(machine, layout, _placed(plain, reference), _strokes(plain, rows.readings[row]))
    return MachineShape(
        machine=machine,
        length=model.length,
        reference=_shape(machine, layout, _placed(plain, reference), reach),
        actual=_shape(machine, layout, _placed(model, actual), reach),
        readings=dict(zip(names, rows.readings[row].tolist(), strict=True)),
        forces=_felt(dict(zip(names, forces.tolist(), strict=True))),
        turning=frozenset(turning),
        tensions=_felt(_tensions(model, actual, machine)),
    )


def _felt(forces: Mapping[str, float]) -> dict[str, float]:
    """Forces with 0 for what a solver leaves of none."""
    return {name: force if abs(force) > _NO_FORCE else 0.0 for name, force in forces.items()}


def _reason(solution: Solution) -> str:
    return reason_of(int(solution.status[0]))


def _placed(model: Model, solution: Solution) -> Placed:
    return Placed(model.topology, solution.coefficients, solution.state)


def _shape(
    machine: Machine[Quantity, float], layout: Layout, placed: Placed, reach: Mapping[str, tuple[float, float]]
) -> Shape:
    places = {name: placed.position_of(point)[0] for name, point in layout.points.items()}
    courses = {}
    for name, between in members(machine).items():
        pieces = [placed.course(piece)[0] for piece in layout.pieces[name]]
        courses[name] = np.vstack(pieces or [places[p] for p in between])
    guides = {}
    for name, (start, end) in reach.items():
        rail = layout.rails[name]
        origin, way = placed.position_of(rail.origin)[0], placed.direction(rail.tilted, rail.along)[0]
        guides[name] = np.array([origin + start * way, origin + end * way])
    guides |= {name: courses[guide.beam] for name, guide in machine.guides.items() if guide.beam is not None}
    return Shape(places, courses, guides, {name: _joint(joint, placed) for name, joint in layout.joints.items()})


def _joint(joint: JointPlace, placed: Placed) -> JointShape:
    axes = tuple(placed.direction(rotation, along)[0] for rotation, along in joint.axes)
    return JointShape(joint.type, placed.position_of(joint.point)[0], axes)


def _strokes(model: Model, readings: Array) -> dict[str, tuple[float, ...]]:
    """How far each drive can still travel from its reading, one way and the other; none where that is endless."""
    gains = model.topology.coefficients.constants
    out = {}
    for a, q in zip(model.actuators, readings.tolist(), strict=True):
        strokes = tuple(float(gains[a.gain_coefficient] * (limit - q)) for limit in a.limits)
        out[a.name] = tuple(s for s in strokes if abs(s) < _ENDLESS * model.length)
    return out


def _reach(
    machine: Machine[Quantity, float], layout: Layout, placed: Placed, strokes: Mapping[str, tuple[float, ...]]
) -> dict[str, tuple[float, float]]:
    """From where to where each guide is drawn, along it from its origin, m: over the limits of the drives that move its
    carriages, and a little beyond where carriages are.
    """
    moved_by = {a.moves: strokes[name] for name, a in machine.actuators.items() if a.moves is not None}
    carriages: dict[str, list[float]] = {}
    limits: dict[str, list[float]] = {}
    for name, body in machine.bodies.items():
        if body.guide is not None and body.guide in layout.rails:
            rail = layout.rails[body.guide]
            way = placed.direction(rail.tilted, rail.along)[0]
            at = float(way @ (placed.position_of(layout.points[name])[0] - placed.position_of(rail.origin)[0]))
            carriages.setdefault(body.guide, []).append(at)
            limits.setdefault(body.guide, []).extend(at + stroke for stroke in moved_by.get(name, ()))
    places = np.array([placed.position_of(point)[0] for point in layout.points.values()])
    beyond = _BEYOND * float(np.sqrt((np.ptp(places, axis=0) ** 2).sum()))
    return {
        name: (min([min(at) - beyond, *limits[name]]), max([max(at) + beyond, *limits[name]]))
        for name, at in carriages.items()
    }


def _tensions(model: Model, solution: Solution, machine: Machine[Quantity, float]) -> dict[str, float]:
    """Axial forces of members, N: of one in several pieces, the largest; of a rope, its share of its cable's."""
    balanced = balance(solution.system, solution.numbers, solution.state, 1.0, tangent=False, taut=solution.taut)
    out: dict[str, float] = {}
    known, wound = members(machine), [a for a in machine.actuators.values() if a.winds is not None]
    cables = {a.target: {rope: weight.number({}) for rope, weight in (a.winds or {}).items()} for a in wound}
    for name, force in _elongations(model, balanced.stresses):
        member = name.partition(".")[0]
        if member in known and abs(force) >= abs(out.get(member, 0.0)):
            out[member] = force
        for rope, weight in cables.get(name, {}).items():
            out[rope] = weight * force
    return out


def _elongations(model: Model, stresses: tuple[Array, ...] | list[Array]) -> Iterator[tuple[str, float]]:
    for group, stress in zip(model.topology.groups, stresses, strict=True):
        if group.element.strains[0] == "elongation":
            yield from zip(group.names, stress[0, :, 0].tolist(), strict=True)
