"""Beams on which carriages run, as spans between their ends and the carriages, each in one piece or several."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from itertools import pairwise

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.compiler.assemble import BadConfiguration
from pkmcal_cli.compiler.bars import rest_length
from pkmcal_cli.compiler.coefficient_values import combined
from pkmcal_cli.compiler.cross_sections import beam_mass, beam_stiffness
from pkmcal_cli.compiler.structure import Structure
from pkmcal_cli.compiler.weights import Weight
from pkmcal_cli.elements import BeamElement, SpanElement
from pkmcal_cli.language.machine import Beam
from pkmcal_cli.mechanism.connection_points import ConnectionPoint, Number
from pkmcal_cli.mechanism.topology import Topology

Slides = tuple[tuple[int, float], ...]


@dataclass(frozen=True)
class _Station:
    """A place on a beam: its natural distance from the beam's start is `fixed` (m) plus a travel, if any."""

    connection: ConnectionPoint
    fixed: Number
    travel: int | None = None


def add_spans(
    structure: Structure,
    name: str,
    beam: Beam,
    ends: tuple[ConnectionPoint, ConnectionPoint],
    triad: Array,
) -> list[Weight]:
    """The spans of a beam that carriages run on; returns its spread weight."""
    total = rest_length(structure, beam, ends)
    stations, taken = [_Station(ends[0], 0.0)], dict[float, str]()
    for rider in structure.rails.riders(name):
        rail, travel = structure.rails.of(rider), structure.carriage_travel[rider]
        other = taken.setdefault(structure.builder.translations[travel][1], rider)
        if other != rider:
            message = f"carriages `{other}` and `{rider}` are at one place of beam `{name}`"
            raise BadConfiguration(rider, message, "give them different travels: they cannot pass each other")
        stations.append(_Station(ConnectionPoint(rail.origin, rail.rotation), 0.0, travel))
    stations.append(_Station(ends[1], total))
    mass = beam_mass(structure, beam, total)
    weights, pieces = [], 0
    for first, second in pairwise(stations):
        length = combined(lambda a, b: (b - a) / beam.pieces, first.fixed, second.fixed)
        slides = tuple(
            (station.travel, sign / beam.pieces)
            for station, sign in ((first, -1.0), (second, 1.0))
            if station.travel is not None
        )
        for pair in _pieces(structure, name, beam, (first.connection, second.connection), pieces):
            label = f"{name}.{pieces}"
            triads = tuple(structure.orientation(p.rotation).T @ triad for p in pair)
            _add_piece(structure, label, beam, pair, length, slides=slides, triads=(triads[0], triads[1]))
            if mass is not None:
                tangents = (triads[0][:, 0], triads[1][:, 0])
                per_length = combined(lambda m, l: m / l, mass, total)
                weights += _spread_weight(structure, label, pair, tangents, per_length, length=length, slides=slides)
            pieces += 1
    return weights


def natural_length(topology: Topology, beam: str) -> float:
    """Unstressed length (m) of a beam at nominal parameters."""
    length = 0.0
    for group in topology.groups:
        rest = topology.coefficients.constants[group.rest].reshape(len(group.names), -1)
        if isinstance(group.element, BeamElement):
            length += sum(float(rest[e, 0]) for e, name in enumerate(group.names) if name.split(".")[0] == beam)
    return length


def _pieces(
    structure: Structure, name: str, beam: Beam, ends: tuple[ConnectionPoint, ConnectionPoint], first: int
) -> list[tuple[ConnectionPoint, ConnectionPoint]]:
    """A span cut into pieces by nodes; `first`: number of its first piece."""
    places = [structure.position(end.point) for end in ends]
    nodes = [ends[0]]
    for k in range(1, beam.pieces):
        label = f"{name}.{first + k}"
        between = places[0] + (places[1] - places[0]) * k / beam.pieces
        nodes.append(ConnectionPoint(structure.free_point(label, between), structure.new_rotation(label)))
    nodes.append(ends[1])
    return list(pairwise(nodes))


def _add_piece(
    structure: Structure,
    label: str,
    beam: Beam,
    pair: tuple[ConnectionPoint, ConnectionPoint],
    length: Number,
    slides: Slides,
    triads: tuple[Array, Array],
) -> None:
    element = SpanElement(structure.planar)
    stiffness = beam_stiffness(structure, beam, 1.0)
    rigid = {s: stiffness[k] is None for k, names in enumerate(element.alike) for s in names}
    structure.builder.link(
        element,
        label,
        pair,
        rest=[length] + [0.0] * (len(element.strains) - 1),
        stiffness=[s or 0.0 for s in stiffness],
        rigid=[rigid[s] for s in element.strains],
        triads=triads,
        slides=slides,
    )


def _spread_weight(
    structure: Structure,
    label: str,
    pair: tuple[ConnectionPoint, ConnectionPoint],
    tangents: tuple[Array, Array],
    mass: Number,
    length: Number,
    slides: Slides,
) -> list[Weight]:
    """Weight of a span of a mass per length (kg/m): on its ends, and on the unit tangents that they carry."""
    out = []
    for side, end, tangent, sign in zip("ij", pair, tangents, (1.0, -1.0), strict=True):
        spread = partial(Weight, length=length, slides=slides)
        half = combined(lambda m: 0.5 * m, mass)
        ahead = structure.builder.offset(end.rotation, tangent.tolist(), f"{label}.{side}.tangent")
        tip = ConnectionPoint(end.point + ahead, end.rotation)
        twelfth = combined(partial(lambda s, m: s * m / 12, sign), mass)
        out.append(spread(name=f"{label}.{side}", connection=end, mass=half, power=1))
        out.append(spread(name=f"{label}.{side}.bending", connection=tip, mass=twelfth, origin=end, power=2))
    return out
