"""Bars as links."""

from __future__ import annotations

import numpy as np

from pkmcal_cli.compiler.coefficient_values import combined, number
from pkmcal_cli.compiler.structure import Structure
from pkmcal_cli.compiler.weights import Weight, halves
from pkmcal_cli.elements import BarElement, ElasticBarElement
from pkmcal_cli.language.machine import Axial, Beam
from pkmcal_cli.mechanism.connection_points import ConnectionPoint, Number


def add_bars(structure: Structure, leg_lengths: dict[str, Number]) -> list[Weight]:
    """Bars; `leg_lengths`: rest lengths that drives set. Returns their lumped masses."""
    weights = []
    springs = drive_stiffness(structure)
    for name, bar in structure.machine.bars.items():
        connections = (structure.connection(bar.between[0]), structure.connection(bar.between[1]))
        length = leg_lengths.get(name, rest_length(structure, bar, connections))
        per_length, stiffness = axial_stiffness(bar, length, springs.get(name))
        structure.builder.link(
            ElasticBarElement() if per_length else BarElement(),
            name,
            connections,
            rest=[length],
            stiffness=[stiffness or 0.0],
            rigid=[stiffness is None],
            springs=[bar.spring],
        )
        if bar.mass is not None:
            weights += halves(name, connections, number(bar.mass))
    return weights


def drive_stiffness(structure: Structure) -> dict[str, Number]:
    """Stiffness (N/m) of the drives of legs and spools that declare one, by bar or rope."""
    actuators = structure.machine.actuators.values()
    return {a.target: number(a.stiffness) for a in actuators if a.stiffness is not None and (a.drives or a.winds)}


def axial_stiffness(bar: Axial, length: Number, drive: Number | None) -> tuple[bool, Number | None]:
    """Whether the stiffness number is ES, and that number, in series with its drive; None where both are rigid.

    With a drive spring, ES/L is taken at the length of reading zero.
    """
    if drive is None:
        stiffness = bar.EA if bar.k is None else bar.k
        return bar.EA is not None, None if stiffness is None else number(stiffness)
    if bar.k is not None:
        return False, combined(lambda k, d: k * d / (k + d), bar.k, drive)
    if bar.EA is not None:
        return False, combined(lambda ea, l, d: ea * d / (ea + l * d), bar.EA, length, drive)
    return False, drive


def rest_length(
    structure: Structure, bar: Axial | Beam, connections: tuple[ConnectionPoint, ConnectionPoint]
) -> Number:
    """Unstressed length: the file's, else the reference configuration's."""
    if bar.length is not None:
        return number(bar.length)
    ends = [structure.position(p.point) for p in connections]
    return float(np.sqrt(((ends[1] - ends[0]) ** 2).sum()))
