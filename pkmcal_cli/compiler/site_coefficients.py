"""Effect sites of a machine: which coefficients every entry of every place displaces."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.compiler.carriage_sites import carriages, guides
from pkmcal_cli.compiler.drives import PlacedDrive, period_of_travel
from pkmcal_cli.compiler.instrument_sites import instruments
from pkmcal_cli.compiler.rope_path import rope_path
from pkmcal_cli.compiler.ropes import cables
from pkmcal_cli.compiler.site_collector import ONE, Named, SiteCollector, coefficients_at
from pkmcal_cli.compiler.structure import Structure
from pkmcal_cli.effects import Entry
from pkmcal_cli.language.machine import Actuator
from pkmcal_cli.language.sections import sections_with
from pkmcal_cli.mechanism.topology import Topology
from pkmcal_cli.model.effect_sites import EffectSite, EffectSites
from pkmcal_cli.model.observed import PlacedSensor

TOOL, LOAD = "tool", "effect.load"
"""Kind of the offsets of what sensors see, and name of the load at the tool point; both zero without effects."""


def effect_sites_of(
    structure: Structure,
    topology: Topology,
    drives: Sequence[PlacedDrive],
    sensors: Sequence[PlacedSensor],
    reference: Array,
    tool: str,
) -> EffectSites:
    """All effect sites of a machine compiled to take effects; `reference` (S,): its coefficients there."""
    c = SiteCollector(structure, topology, drives, sensors, reference, tool)
    out: dict[Entry, dict[str, tuple[EffectSite, ...]]] = {
        "command": dict(_commands(c)),
        "drive_force": dict(_drive_forces(c)),
        "length": dict(_lengths(c)),
        "guide": dict(guides(c)),
        "carriage": dict(carriages(c)),
        "base": dict(_base(c)),
        "tool": dict(_tools(c)),
        "stiffness": dict(_stiffnesses(c)),
        "weight": dict(_weights(c)),
        "load": dict(_loads(c)),
        "frame": dict(instruments(c)),
    }
    return out


def _kind(actuator: Actuator) -> str:
    """Kind of a drive."""
    if actuator.winds is not None and actuator.radius is not None:
        return "spool"
    return "rotary" if actuator.turns is not None else "linear"


def _commands(c: SiteCollector) -> Named:
    for a, drive in enumerate(c.topology.drives):
        actuator = c.structure.machine.actuators[drive.name]
        nominal = c.structure.nominal
        radius, folds = (1.0 if q is None else q.number(nominal) for q in (actuator.radius, actuator.folds))
        made = EffectSite(
            part=drive.name,
            coefficients=coefficients_at(drive.coefficient),
            matrix=ONE,
            actuator=a,
            length=radius,
            folds=folds,
            kind=_kind(actuator),
            period=period_of_travel(actuator, nominal),
        )
        yield drive.name, (made,)


def _drive_forces(c: SiteCollector) -> Named:
    for a, drive in enumerate(c.topology.drives):
        if drive.force_controlled:
            yield (
                drive.name,
                (
                    EffectSite(
                        part=drive.name,
                        coefficients=coefficients_at(drive.force_coefficient),
                        matrix=drive.force_sign * ONE,
                        actuator=a,
                        kind=_kind(c.structure.machine.actuators[drive.name]),
                    ),
                ),
            )


def _lengths(c: SiteCollector) -> Named:
    sections = [s for s in sections_with("length") if s in sections_with("between")]
    weights = {n: w for cable in cables(c.structure.machine).values() for n, w in cable.weights.items()}
    for name in (name for section in sections for name in getattr(c.structure.machine, section)):
        pieces = []
        for g, e, group in c.places_of(name):
            coefficient = group.rest.start + e * len(group.element.strains)
            pieces.append((coefficient, (g, e), float(c.reference[coefficient])))
        member, weight = pieces[0][1], weights.get(name, 1.0)
        group = c.topology.groups[member[0]]
        shared = name != group.names[member[1]] and name in weights
        lengths = np.array([length for _, _, length in pieces])
        shares = lengths / lengths.sum() if len(pieces) > 1 else np.ones(1)
        made = EffectSite(
            part=name,
            coefficients=np.array([coefficient for coefficient, _, _ in pieces]),
            matrix=weight * shares[:, None],
            member=member,
            weight=weight,
            straight=group.path is None and not group.element.sizes,
            length=_drawn_length(c, name) if shared else float(lengths.sum()) / weight,
            leg=_leg(c, name, member),
        )
        yield name, (made,)


def _leg(c: SiteCollector, name: str, member: tuple[int, int]) -> int:
    """The drive that holds the length of a telescopic leg; -1 without."""
    if name not in c.structure.machine.bars:
        return -1
    held = (a for a, d in enumerate(c.topology.drives) if d.target[:2] == member and not d.force_controlled)
    return next(held, -1)


def _drawn_length(c: SiteCollector, rope: str) -> float:
    """Of a rope in the reference configuration, m."""
    return float(rope_path(c.structure, c.structure.machine.ropes[rope]).lengths.sum())


def _base(c: SiteCollector) -> Named:
    for kind, name in c.structure.anchors:
        inner = kind == "guide" and not c.structure.machine.guides[name].on_base
        if kind in ("ground", "frame", "guide") and not inner:
            coefficients = c.offset(kind, name)
            matrix = np.eye(3)
            matrix[c.axes :] = 0.0
            yield (
                name,
                (
                    EffectSite(
                        part=name,
                        coefficients=coefficients,
                        matrix=matrix,
                        at=c.topology.coefficients.constants[coefficients],
                    ),
                ),
            )


def _tools(c: SiteCollector) -> Named:
    for sensor in c.sensors:
        level = sensor.kind.reads_coordinates and not sensor.places  # it does not see where it is
        if not level and (TOOL, sensor.name) in c.structure.anchors:
            matrix = np.eye(3)
            matrix[c.axes :] = 0.0
            yield sensor.name, (EffectSite(part=sensor.name, coefficients=c.offset(TOOL, sensor.name), matrix=matrix),)


def _stiffnesses(c: SiteCollector) -> Named:
    """Elements that yield, by name; pieces of a beam together."""
    by_name: dict[str, list[int]] = {}
    for group in c.topology.groups:
        count = len(group.element.patterns)
        for e, name in enumerate(group.names):
            coefficients = [group.stiffness.start + e * count + p for p in range(count)]
            used = [s for s in coefficients if c.topology.coefficients.constants[s] > 0]
            stem, _, piece = name.partition(".")
            if used:
                by_name.setdefault(stem if piece.isdigit() else name, []).extend(used)
    for name, every in by_name.items():
        yield name, (EffectSite(part=name, coefficients=np.array(every), matrix=np.ones((len(every), 1)), scales=True),)


def _weights(c: SiteCollector) -> Named:
    """All weights, by their names."""
    coefficients = [
        group.prestress.start + e * len(group.element.strains) + k
        for group in c.topology.groups
        for e, name in enumerate(group.names)
        if name.endswith(".weight")
        for k in range(len(group.element.strains))
    ]
    if coefficients:
        loads = c.topology.coefficients.constants[coefficients]
        yield "machine", (EffectSite(part="machine", coefficients=np.array(coefficients), matrix=loads[:, None]),)


def _loads(c: SiteCollector) -> Named:
    for _, e, group in c.places_of(LOAD):
        coefficients = group.prestress.start + e * 3 + np.arange(3)
        matrix = -np.eye(3)
        matrix[c.axes :] = 0.0
        down = c.gravity
        yield c.tool, (EffectSite(part=c.tool, coefficients=coefficients, matrix=matrix, down=down),)
