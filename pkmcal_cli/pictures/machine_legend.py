"""What the marks, lines and colours of a drawing of a machine mean."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pkmcal_cli.compiler.layout import members
from pkmcal_cli.pictures.machine_shape import MachineShape
from pkmcal_cli.pictures.picture import AFTER, BEFORE, FITTED, NOISE, OTHER
from pkmcal_cli.report.number_format import handy
from pkmcal_cli.units.unit_text import parse_unit

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

GROUND, BODY = "#d9d9d9", "#cfe0ee"
GUIDE: dict[str, Any] = {"lw": 5, "color": "0.85", "solid_capstyle": "butt"}
POINTS: dict[str, dict[str, Any]] = {
    "base": {"marker": "^", "mfc": GROUND, "mec": FITTED, "ms": 6},
    "node": {"marker": "o", "mfc": FITTED, "mec": FITTED, "ms": 3},
    "joint or end of a member": {"marker": "o", "mfc": "white", "mec": FITTED, "ms": 4},
}
_AT = 1e-6  # of the machine's size: as near is the same place
_COLUMNS, _LINE, _BELOW = 2, 0.17, 0.05  # inches, of an entry and below all of them


def marked_points(shape: MachineShape) -> dict[str, list[str]]:
    """Names of points that are marked, by what they are (keys of `POINTS`); the tool point has a mark of its own."""
    base, nodes = shape.machine.ground, shape.machine.nodes
    between = [p for names in members(shape.machine).values() for p in names]
    ends = [n for n in dict.fromkeys([*between, *shape.joints]) if n not in base and n not in nodes]
    marked = {"base": list(base), "node": list(nodes), "joint or end of a member": ends}
    shown = {n for n in shape.actual.places if n != shape.tool and not _covered(shape, n)}
    return {kind: [n for n in names if n in shown] for kind, names in marked.items()}


def _covered(shape: MachineShape, name: str) -> bool:
    """Whether the mark of a drive lies on a point."""
    at = shape.actual.places[name]
    drives = (shape.at_drive(drive, shape.actual) for drive in shape.readings)
    return any(float(np.linalg.norm(at - drive)) <= _AT * shape.length for drive in drives)


def legend_height(shape: MachineShape, forces: bool) -> float:
    """Height in inches that the legend takes."""
    rows = -(-len(_entries(shape, 1.0, forces)) // _COLUMNS)
    return rows * _LINE + _BELOW


def write_legend(
    figure: Figure, size: tuple[float, float], shape: MachineShape, factor: float, *, forces: bool
) -> None:
    """The legend at the bottom of a figure of this size, inches; displacements are drawn `factor` times."""
    corner = (0.4 / size[0], _BELOW / size[1])
    handles = _entries(shape, factor, forces)
    figure.legend(
        handles=handles, loc="lower left", bbox_to_anchor=corner, ncols=_COLUMNS, fontsize=8, frameon=False
    )  # fmt: skip


def _entries(shape: MachineShape, factor: float, forces: bool) -> list[Line2D]:
    from matplotlib.lines import Line2D

    out: list[Line2D] = []
    if shape.largest[1]:
        out.append(Line2D([], [], color=NOISE, lw=0.9, ls=(0, (4, 2)), label="where the control believes it to be"))
        text = f"where it is, displacements {factor:g} x" if factor != 1 else "where it is, at true scale"
        out.append(Line2D([], [], color=FITTED, lw=1.6, label=text))
    else:
        out.append(Line2D([], [], color=FITTED, lw=1.6, label="not displaced: as the control believes it to be"))
    if shape.readings:
        out.append(_mark("s", OTHER, "drive"))
    if shape.actual.guides:
        out.append(Line2D([], [], label="guide", **GUIDE))
    points = {kind: names for kind, names in marked_points(shape).items() if names}
    out += [Line2D([], [], ls="none", mew=0.8, label=kind, **POINTS[kind]) for kind in points]
    if shape.tool is not None:
        out.append(_mark("D", BEFORE, _tool_text(shape, shape.tool)))
    if forces and any(shape.tensions.values()):
        out.append(Line2D([], [], color=AFTER, lw=3, label="pulls (+)"))
        out.append(Line2D([], [], color=BEFORE, lw=3, ls=(0, (3, 0.8)), label="pushes (-)"))
    return out


def _mark(marker: str, colour: str, label: str) -> Line2D:
    from matplotlib.lines import Line2D

    return Line2D([], [], ls="none", marker=marker, mfc=colour, mec="white", ms=7, label=label)


def _tool_text(shape: MachineShape, tool: str) -> str:
    size = float(np.sqrt((shape.displacement(tool) ** 2).sum()))
    if size <= 1e-9 * shape.length:
        return f"tool point {tool}"
    return f"tool point {tool}, displaced by {handy(size, parse_unit('mm'))}"
