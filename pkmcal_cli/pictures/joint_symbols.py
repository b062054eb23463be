"""Symbols of points and joints by kind, axes along which joints turn or slide, and directions of guides."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.path import Path

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.compiler.layout import members
from pkmcal_cli.pictures.picture import FITTED
from pkmcal_cli.pictures.shapes import MachineShape, Shape
from pkmcal_cli.pictures.views import View

if TYPE_CHECKING:
    from matplotlib.axes import Axes

AXIS = "#8f3f71"
AXIS_LINE: dict[str, Any] = {"color": AXIS, "lw": 0.9, "ls": (0, (8, 2, 1.5, 2))}
TRAVEL = "0.4"
SUPPORT = Path([(0.0, 0.0), (-1.0, -1.6), (1.0, -1.6), (0.0, 0.0)])
"""A support: a triangle whose tip is the point."""
_WHITE: dict[str, Any] = {"mfc": "white", "mec": FITTED}
SYMBOLS: dict[str, dict[str, Any]] = {
    "base": {"marker": SUPPORT, "mfc": "#d9d9d9", "mec": FITTED, "ms": 13},
    "node": {"marker": "o", "mfc": FITTED, "mec": FITTED, "ms": 3},
    "fixed": {"marker": "s", "mfc": FITTED, "mec": FITTED, "ms": 3.5},
    "spherical": {"marker": "o", "mfc": "0.6", "mec": FITTED, "ms": 5},
    "pulley": {"marker": "o", "mfc": "none", "mec": FITTED, "ms": 10},
    "revolute": {"marker": "o", "ms": 4.5} | _WHITE,
    "prismatic": {"marker": "s", "ms": 5} | _WHITE,
    "cylindrical": {"marker": "h", "ms": 6} | _WHITE,
    "planar": {"marker": "d", "ms": 6} | _WHITE,
    "universal": {"marker": "X", "ms": 6} | _WHITE,
}
"""Marks of points by what they are: the base, free nodes, and joints by type, those below over those above."""
_WIDER = ("base", "pulley")  # than the mark of a drive
_SEEN = 0.15  # of its length: an axis that is shorter in a view points at the beholder


def symbols(shape: MachineShape, shown: Shape) -> dict[str, list[Array]]:
    """Places (3,) of the marks that are drawn, by kind (keys of `SYMBOLS`), but for those that a drive covers.

    An end of a bar or rope that is no joint of the file turns freely: a revolute joint in the plane, else a spherical.
    """
    machine, places = shape.machine, shown.places
    still = [n for part in (machine.nodes, machine.bodies) for n, p in part.items() if {"x", "y"} <= set(p.fixed)]
    base = [n for n in (*machine.ground, *still) if n in places]
    joints = {n: j for n, j in shown.joints.items() if j.type != "fixed" or not _at_node(shape, n)}
    welded = {n for name, beam in machine.beams.items() for n in beam.between}
    pinned = [n for names in members(machine).values() for n in names]
    hinged = {n for joint in machine.joints.values() for n in joint.between}
    ends = [n for n in dict.fromkeys(pinned) if n in places and n not in {*base, *machine.nodes, *welded, *hinged}]
    out: dict[str, list[Array]] = {kind: [] for kind in SYMBOLS}
    out["base"] = [places[n] for n in base]
    out["node"] = [places[n] for n in machine.nodes if n in places and n not in still and n not in hinged]
    out["revolute" if shape.planar else "spherical"] = [places[n] for n in ends]
    for name, joint in joints.items():
        out[joint.type].append(shape.symbol(name, shown))
    tool = [] if shape.tool is None else [places[shape.tool]]
    over = [*tool, *(shape.at_drive(drive, shown) for drive in shape.readings)]
    return {k: [at for at in every if k in _WIDER or not shape.at_one_of(at, over)] for k, every in out.items()}


def _at_node(shape: MachineShape, name: str) -> bool:
    """Whether the fixed end of a beam is at a node: the mark of the node says so."""
    beam, _, end = name.rpartition(".")
    return beam in shape.machine.beams and shape.machine.beams[beam].between["ij".index(end)] in shape.machine.nodes


def axes_on_page(shape: MachineShape, shown: Shape, view: View) -> list[tuple[str, Array]]:
    """Names of joints, and their axes as places (2, 3) from end to end, where a view shows them as lines."""
    every = [(name, line) for name in shown.joints for line in shape.axes(name, shown)]
    return [(n, line) for n, line in every if _length(view.of(line)) > _SEEN * _length(line)]


def draw_axes(ax: Axes, name: str, line: Array) -> None:
    """An axis (2, 2) on the page: a thin chain line with an arrow at its positive end."""
    ax.plot(*line.T, zorder=3.5, gid=f"axis-{name}", **AXIS_LINE)
    _head(ax, line, AXIS)


def draw_travel(ax: Axes, name: str, course: Array, reach: float) -> None:
    """The direction of a guide (K, 2): an arrow as long as `reach` at the end to which travel grows."""
    way = course[-1] - course[0]
    size = float(np.hypot(*way))
    if size <= _SEEN * reach:
        return
    line = np.array([course[-1], course[-1] + reach * way / size])
    ax.plot(*line.T, zorder=1.5, gid=f"travel-{name}", color=TRAVEL, lw=1.2)
    _head(ax, line, TRAVEL)


def _head(ax: Axes, line: Array, colour: str) -> None:
    (x, y), (u, v) = line[1].tolist(), (line[0] + 0.7 * (line[1] - line[0])).tolist()
    style = {"arrowstyle": "-|>", "color": colour, "lw": 0.9, "shrinkA": 0, "shrinkB": 0, "mutation_scale": 7}
    ax.annotate("", (x, y), (u, v), arrowprops=style, zorder=3.5)


def _length(line: Array) -> float:
    return float(np.sqrt(((line[1] - line[0]) ** 2).sum()))
