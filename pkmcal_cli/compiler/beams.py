"""Beams with the joints at their ends, in one piece or several."""

from __future__ import annotations

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.compiler.assemble import BadConfiguration
from pkmcal_cli.compiler.bars import rest_length
from pkmcal_cli.compiler.coefficient_values import combined
from pkmcal_cli.compiler.cross_sections import beam_mass, beam_stiffness
from pkmcal_cli.compiler.joints import add_joint_link, elastic_rows, joint_rows, joint_triad, rest_of, tilts_of
from pkmcal_cli.compiler.spans import add_spans
from pkmcal_cli.compiler.structure import Structure
from pkmcal_cli.compiler.weights import Weight, halves
from pkmcal_cli.elements import BeamElement
from pkmcal_cli.language.machine import Beam
from pkmcal_cli.mechanism.connection_points import ConnectionPoint


def add_beams(structure: Structure) -> list[Weight]:
    """Beams with their end joints; returns their lumped masses. Raises BadDrawing."""
    weights = []
    for name, beam in structure.machine.beams.items():
        nodes = [structure.point(p) for p in beam.between]
        chord = structure.position(nodes[1]) - structure.position(nodes[0])
        if not chord.any():
            raise BadConfiguration(name)
        triad = structure.rails.beam_triad(name, chord)
        ends = (_beam_end(structure, name, 0, beam, chord), _beam_end(structure, name, 1, beam, chord))
        make = add_spans if structure.rails.riders(name) else _beam_pieces
        weights += make(structure, name, beam, ends, triad)
    return weights


def _beam_end(structure: Structure, name: str, side: int, beam: Beam, chord: Array) -> ConnectionPoint:
    """Connection point of a beam's end: the node's own where welded, else with a rotation of its own."""
    end, node = beam.ends[side], beam.between[side]
    if end.joint == "fixed" and end.stiffness is None:
        return structure.connection(node, rotating=True)
    elastic = elastic_rows(end.stiffness, end.joint, structure.planar)
    label = f"{name}.{'ij'[side]}"
    moving = [d for d in elastic if d in "xyz"]
    point = structure.point(node)
    if moving:
        point = structure.free_point(label, structure.position(point))
    rotating = end.joint != "fixed" or any(d[0] == "r" for d in elastic)
    rotation = structure.new_rotation(label) if rotating else structure.rotation(node)
    connection = ConnectionPoint(point, rotation)
    triad = joint_triad(structure, end, chord)
    rows = tuple(d for d in joint_rows(end.joint, structure.planar) if d[0] == "r" or moving)
    if rows:
        add_joint_link(
            structure,
            label,
            end.joint,
            rows=rows,
            connections=(structure.connection(node, rows[-1][0] == "r"), connection),
            triad=triad,
            stiffness=end.stiffness,
            rest=rest_of(structure, end),
            tilts=tilts_of(structure, end),
        )
    return connection


def _beam_pieces(
    structure: Structure, name: str, beam: Beam, connections: tuple[ConnectionPoint, ConnectionPoint], triad: Array
) -> list[Weight]:
    """The beam's elements between its ends, through interior nodes where it has several pieces."""
    count = beam.pieces
    ends = [structure.position(p.point) for p in connections]
    stations = [connections[0]]
    for k in range(1, count):
        label = f"{name}.{k}"
        stations.append(
            ConnectionPoint(
                structure.free_point(label, ends[0] + (ends[1] - ends[0]) * k / count),
                structure.new_rotation(label),
            )
        )
    stations.append(connections[1])
    total = rest_length(structure, beam, connections)
    length = combined(lambda l: l / count, total)
    element = BeamElement(structure.planar)
    stiffness = beam_stiffness(structure, beam, length)
    rigid = {s: stiffness[k] is None for k, names in enumerate(element.alike) for s in names}
    mass = beam_mass(structure, beam, total)
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
            weights += halves(f"{name}.{k}", pair, combined(lambda m: m / count, mass))
    return weights
