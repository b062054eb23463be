"""Welded frames of growing size in space: a chain of beams, a platform on many legs, a portal cut into elements."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pkmcal_cli.base.rotation import Array

from .frames import Frame, compiled, unloaded

SIZES = {"chain": (17, 50, 150), "platform": (8, 23, 74), "gantry": (18, 32, 151)}
"""Beams of the chain and of the gantry, legs of the platform: 96 to 900 unknowns."""


@dataclass(frozen=True)
class _Parts:
    ground: dict[str, Array]
    nodes: dict[str, Array]
    beams: list[tuple[str, str]]


def structure(kind: str, size: int, rows: int) -> Frame:
    """A frame under weight in `rows` sections of its beams, at its unstressed state."""
    model = compiled(_text(_PARTS[kind](size)))
    thickness = np.random.default_rng(0).uniform(0.8, 1.25, rows)
    values = model.topology.coefficients
    coefficients = np.asfortranarray([values.values({**model.by_name(model.nominal), "a": a}) for a in thickness])
    return Frame(model, coefficients, unloaded(model, coefficients, rows), ())


def _line(start: Array, end: Array, count: int, name: str) -> dict[str, Array]:
    """Points between two others."""
    share = np.arange(1, count)[:, None] / count
    return {f"{name}{k}": point for k, point in enumerate(start + share * (end - start), start=1)}


def _joined(names: list[str]) -> list[tuple[str, str]]:
    return list(pairwise(names))


def _chain(beams: int) -> _Parts:
    start, end = np.zeros(3), np.array([4.0, 1.0, 0.5])
    nodes = _line(start, end, beams, "N")
    return _Parts({"A": start, "B": end}, nodes, _joined(["A", *nodes, "B"]))


def _platform(legs: int) -> _Parts:
    angle = 2 * np.pi * np.arange(legs) / legs
    ring = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    feet = {f"F{k}": foot for k, foot in enumerate(ring)}
    centre = np.array([0.0, 0.0, 1.0])
    nodes, beams = {"T": centre}, []
    for k, (foot, point) in enumerate(zip(ring, ring, strict=True)):
        nodes |= {f"K{k}": 0.6 * foot + [0, 0, 0.5], f"P{k}": centre + 0.3 * point}
        beams += [(f"F{k}", f"K{k}"), (f"K{k}", f"P{k}"), (f"P{k}", "T")]
    return _Parts(feet, nodes, beams)


def _gantry(beams: int) -> _Parts:
    """Two columns of a quarter of the beams each, and the bridge."""
    column = beams // 4
    corners = [np.array(p) for p in ((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (2.0, 0.2, 1.0), (2.0, 0.2, 0.0))]
    left, right = _line(corners[0], corners[1], column, "L"), _line(corners[2], corners[3], column, "R")
    bridge = _line(corners[1], corners[2], beams - 2 * column, "G")
    nodes = {**left, "C": corners[1], **bridge, "D": corners[2], **right}
    return _Parts({"A": corners[0], "B": corners[3]}, nodes, _joined(["A", *nodes, "B"]))


_PARTS = {"chain": _chain, "platform": _platform, "gantry": _gantry}


def _text(parts: _Parts) -> str:
    """The machine."""
    places = {**parts.ground, **parts.nodes}

    def written(points: dict[str, Array]) -> list[str]:
        return [f"  {name}: [{', '.join(repr(float(v)) for v in point)}]" for name, point in points.items()]

    beams = [
        f"  beam{k}: {{between: [{i}, {j}], length: {float(np.linalg.norm(places[j] - places[i]))!r}, "
        "section: tube, material: steel}"
        for k, (i, j) in enumerate(parts.beams)
    ]
    head = """
units: {length: m, angle: rad, force: N}
space: spatial
gravity: [0, 0, -9.81]
parameters: {a: {nominal: 0.04, range: 0.01}}
materials: {steel: {E: 210 GPa, nu: 0.3, density: 7850 kg/m^3}}
sections: {tube: {area: a**2, Iy: a**4/12, Iz: a**4/12, J: 0.1406*a**4}}
"""
    lines = ["ground:", *written(parts.ground), "nodes:", *written(parts.nodes), "beams:", *beams]
    return head + "\n".join(lines) + "\n"
