"""Bars and ropes as links."""

from __future__ import annotations

import numpy as np

from pkmcal_cli.compiler.numbers import combined, number
from pkmcal_cli.compiler.structure import Structure
from pkmcal_cli.compiler.weights import Weight, halves
from pkmcal_cli.elements import Bar, ElasticBar
from pkmcal_cli.language.machine import Bar as BarSpec
from pkmcal_cli.language.machine import Beam as BeamSpec
from pkmcal_cli.mechanism.connection_points import Number, Port


def add_bars(structure: Structure, leg_lengths: dict[str, Number]) -> list[Weight]:
    """Bars and ropes; `leg_lengths`: rest lengths that drives set. Returns their lumped masses."""
    weights = []
    springs = drive_stiffness(structure)
    members = [(n, b, False) for n, b in structure.machine.bars.items()]
    members += [(n, r, True) for n, r in structure.machine.ropes.items()]
    for name, bar, rope in members:
        ports = (structure.port(bar.between[0]), structure.port(bar.between[1]))
        length = leg_lengths.get(name, rest_length(structure, bar, ports))
        element, stiffness = _stiffness(bar, length, springs.get(name))
        structure.builder.link(
            element,
            name,
            ports,
            rest=[length],
            stiffness=[stiffness or 0.0],
            rigid=[stiffness is None],
            rope=rope,
        )
        if bar.mass is not None:
            weights += halves(name, ports, number(bar.mass))
    return weights


def drive_stiffness(structure: Structure) -> dict[str, Number]:
    """Stiffness (N/m) of the drives of legs and spools that declare one, by bar or rope."""
    actuators = structure.machine.actuators.values()
    return {a.target: number(a.stiffness) for a in actuators if a.stiffness is not None and (a.drives or a.winds)}


def _stiffness(bar: BarSpec, length: Number, drive: Number | None) -> tuple[Bar, Number | None]:
    """Element and stiffness number of a bar in series with its drive; None where both are rigid.

    With a drive spring, ES/L is taken at the length of reading zero.
    """
    if drive is None:
        given = bar.EA if bar.k is None else bar.k
        element = Bar() if bar.EA is None else ElasticBar()
        return element, None if given is None else number(given)
    if bar.k is not None:
        return Bar(), combined(lambda k, d: k * d / (k + d), bar.k, drive)
    if bar.EA is not None:
        return Bar(), combined(lambda ea, l, d: ea * d / (ea + l * d), bar.EA, length, drive)
    return Bar(), drive


def rest_length(structure: Structure, bar: BarSpec | BeamSpec, ports: tuple[Port, Port]) -> Number:
    """Unstressed length: the file's, else the drawing's."""
    if bar.length is not None:
        return number(bar.length)
    ends = [structure.position(p.point) for p in ports]
    return float(np.sqrt(((ends[1] - ends[0]) ** 2).sum()))
