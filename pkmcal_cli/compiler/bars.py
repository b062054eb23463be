"""Bars and ropes as links."""

from __future__ import annotations

import numpy as np

from ..elements import Bar, ElasticBar
from ..layout_builder import Number, Port
from ..machine import Bar as BarSpec
from ..machine import Beam as BeamSpec
from .numbers import number
from .structure import Structure
from .weights import Weight, halves


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
            weights += halves(name, ports, number(bar.mass))
    return weights


def rest_length(structure: Structure, bar: BarSpec | BeamSpec, ports: tuple[Port, Port]) -> Number:
    """Unstressed length: the file's, else the drawing's."""
    if bar.length is not None:
        return number(bar.length)
    ends = [structure.position(p.point) for p in ports]
    return float(np.sqrt(((ends[1] - ends[0]) ** 2).sum()))
