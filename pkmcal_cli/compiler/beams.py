"""Beams with the joints at their ends, in one piece or several."""

from __future__ import annotations

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.compiler.assemble import BadDrawing
from pkmcal_cli.compiler.bars import rest_length
from pkmcal_cli.compiler.joints import add_joint_link, elastic_rows, joint_rows, joint_triad
from pkmcal_cli.compiler.numbers import combined, is_zero, triad_along
from pkmcal_cli.compiler.sections import beam_mass, beam_stiffness
from pkmcal_cli.compiler.structure import Structure
from pkmcal_cli.compiler.weights import Weight, halves
from pkmcal_cli.elements import Beam
from pkmcal_cli.language.machine import Beam as BeamSpec
from pkmcal_cli.mechanism.connection_points import Port


def add_beams(structure: Structure) -> list[Weight]:
    """Beams with their end joints; returns their lumped masses. Raises BadDrawing."""
    weights = []
    for name, beam in structure.machine.beams.items():
        nodes = [structure.point(p) for p in beam.between]
        chord = structure.position(nodes[1]) - structure.position(nodes[0])
        if not chord.any():
            raise BadDrawing(name)
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
    elastic = elastic_rows(end.stiffness, end.joint, structure.planar)
    label = f"{name}.{'ij'[side]}"
    moving = [d for d in elastic if d in "xyz"]
    point = structure.point(node)
    if moving:
        point = structure.free_point(label, structure.position(point))
    turning = end.joint != "fixed" or any(d[0] == "r" for d in elastic)
    rotation = structure.new_rotation(label) if turning else structure.rotation(node)
    port = Port(point, rotation)
    triad = joint_triad(structure, end, chord)
    rows = tuple(d for d in joint_rows(end.joint, structure.planar) if d[0] == "r" or moving)
    if rows:
        add_joint_link(
            structure,
            label,
            end.joint,
            rows=rows,
            ports=(structure.port(node, rows[-1][0] == "r"), port),
            triad=triad,
            stiffness=end.stiffness,
        )
    return port


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


def _beam_strains(element: Beam) -> list[tuple[str, ...]]:
    """Strains that share one stiffness number, in the order of the numbers."""
    kinds = ["elongation", "bend_z"] if element.planar else ["elongation", "torsion", "bend_y", "bend_z"]
    return [tuple(s for s in element.strains if s.startswith(kind)) for kind in kinds]
