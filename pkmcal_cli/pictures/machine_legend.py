"""What the marks, lines and colours of a drawing of a machine mean."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pkmcal_cli.compiler.layout import members
from pkmcal_cli.pictures.joint_symbols import AXIS_LINE, SYMBOLS, axes_on_page, symbols
from pkmcal_cli.pictures.picture import AFTER, BEFORE, FITTED, NOISE, OTHER
from pkmcal_cli.pictures.shapes import MachineShape
from pkmcal_cli.pictures.titles import shortened
from pkmcal_cli.pictures.views import ABREAST, PLANE
from pkmcal_cli.report.number_format import handy
from pkmcal_cli.units.unit_text import parse_unit

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

BODY = "#cfe0ee"
GUIDE: dict[str, Any] = {"lw": 5, "color": "0.85", "solid_capstyle": "butt"}
_NAME = 28  # characters
_COLUMNS, _LINE, _BELOW = 2, 0.17, 0.05  # inches, of an entry and below all of them


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
    if shape.moved:
        out.append(Line2D([], [], color=NOISE, lw=0.9, ls=(0, (4, 2)), label="where the control believes it to be"))
        text = f"where it is, displacements {factor:g} x" if factor != 1 else "where it is, at true scale"
        out.append(Line2D([], [], color=FITTED, lw=1.6, label=text))
    else:
        out.append(Line2D([], [], color=FITTED, lw=1.6, label="not displaced: as the control believes it to be"))
    out += [_mark(marker, OTHER, label) for marker, label in drive_marks(shape).values()]
    if shape.actual.guides:
        out.append(Line2D([], [], label="guide, arrow: travel grows", **GUIDE))
    kinds = [kind for kind, places in symbols(shape, shape.actual).items() if places]
    middle = {"base": {"marker": "^", "ms": 7}}  # of the legend's line
    for kind in kinds:
        style = SYMBOLS[kind] | middle.get(kind, {})
        out.append(Line2D([], [], ls="none", mew=0.8, label=_kind_text(shape, kind), **style))
    if any(axes_on_page(shape, shape.actual, view) for view in ((PLANE,) if shape.planar else ABREAST)):
        out.append(Line2D([], [], label="axis of a joint, arrow: positive", **AXIS_LINE))
    if shape.tool is not None:
        out.append(_mark("D", BEFORE, _tool_text(shape, shape.tool)))
    if forces and any(shape.tensions.values()):
        out.append(Line2D([], [], color=AFTER, lw=3, label="pulls (+)"))
        out.append(Line2D([], [], color=BEFORE, lw=3, ls=(0, (3, 0.8)), label="pushes (-)"))
    return out


def drive_marks(shape: MachineShape) -> dict[bool, tuple[str, str]]:
    """Marker and text of drives, by whether they turn; only of such as the machine has."""
    turning = {name in shape.turning for name in shape.readings}
    marks = {False: ("s", "drive"), True: ("H", "drive that turns" if len(turning) > 1 else "drive")}
    return {turns: marks[turns] for turns in sorted(turning)}


def _kind_text(shape: MachineShape, kind: str) -> str:
    """What a mark of points or joints means."""
    if kind in ("base", "node", "pulley"):
        return kind
    if kind == "fixed":
        return "fixed end or joint"
    ends = kind == ("revolute" if shape.planar else "spherical") and members(shape.machine)
    return f"{kind} joint, end of a bar" if ends else f"{kind} joint"


def _mark(marker: str, colour: str, label: str) -> Line2D:
    from matplotlib.lines import Line2D

    return Line2D([], [], ls="none", marker=marker, mfc=colour, mec="white", ms=7, label=label)


def _tool_text(shape: MachineShape, tool: str) -> str:
    size = float(np.sqrt((shape.displacement(tool) ** 2).sum()))
    if size <= 1e-9 * shape.length:
        return f"tool point {shortened(tool, _NAME)}"
    return f"tool point {shortened(tool, _NAME)}, displaced by {handy(size, parse_unit('mm'))}"
