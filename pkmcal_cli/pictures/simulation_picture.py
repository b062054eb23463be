"""What a simulation brings: where the tool point goes, what the other instruments read, forces, uncertainties."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.model.model import Model
from pkmcal_cli.pictures.parts import Part, brief, composed, dots, over_rows, shown_unit, thinned
from pkmcal_cli.pictures.picture import LOOKS, Picture
from pkmcal_cli.pictures.scatter import Cloud, moving, planes, scatter_part
from pkmcal_cli.pictures.titles import Titles
from pkmcal_cli.units.file_units import FileUnits
from pkmcal_cli.units.unit_text import parse_unit

if TYPE_CHECKING:
    from matplotlib.figure import SubFigure

_SHOWN = 3000  # rows
_PER_PANEL = len(LOOKS)
_NO_FORCE = 1e-6  # N, N m: what solving leaves
_HEIGHT = 2.3  # inches, of a panel over the rows


@dataclass(frozen=True, kw_only=True)
class Simulated:
    """Solved rows of a simulation: poses of the tool point (N, K), readings (N, C), forces (N, A) or None, SI.

    uncertainty (N, K): standard uncertainties of the pose; None where they were not asked for.
    """

    model: Model
    coordinates: tuple[str, ...]
    tool: Array
    readings: Array
    forces: Array | None
    uncertainty: Array | None


@dataclass(frozen=True)
class _Series:
    name: str
    values: Array
    dimension: str
    unit: str


def simulation_picture(result: Simulated, titles: Titles, units: FileUnits) -> Picture:
    """Forces where they were asked for, the map of uncertainties where it was, else the way and the readings."""
    parts, names = _parts(result, units)
    count = len(result.readings)
    return composed("simulation", titles, f"{count} rows simulated: {', '.join(names) or 'nothing to draw'}.", parts)


def _parts(result: Simulated, units: FileUnits) -> tuple[list[Part], list[str]]:
    parts: list[Part] = []
    names: list[str] = []
    columns = moving(result.coordinates, result.tool)
    coordinates, tool = [result.coordinates[k] for k in columns], result.tool[:, columns]
    drawn = bool(planes(coordinates)) and len(tool) > 0
    dimension, axis = ("angle", units.angle) if drawn and coordinates[0][0] == "r" else ("length", units.length)
    if result.uncertainty is not None and drawn:
        size = np.sqrt((result.uncertainty[:, columns] ** 2).sum(axis=1))
        name = f"standard uncertainty of the {'orientation' if dimension == 'angle' else 'position'}"
        cloud = Cloud(name, tool, size, shown_unit(dimension, float(np.nanmax(size))))
        parts.append(scatter_part([cloud], coordinates, axis))
        names.append(name)
    if result.forces is not None:
        model = result.model
        turning = [not model.topology.moves_length(d) for d in model.topology.drives]
        series = [
            _Series(a.name, result.forces[:, k], "torque" if turning[k] else "force", "N m" if turning[k] else "N")
            for k, a in enumerate(model.actuators)
        ]
        parts += _over_rows("force of drives", series)
        names.append("forces of drives")
    if not parts:
        if drawn:
            parts.append(scatter_part([Cloud("", tool, path=True)], coordinates, axis))
            names.append(f"{'orientations' if dimension == 'angle' else 'positions'} of the tool point")
        parts += _over_rows("reading", _others(result))
        names += ["readings of other channels"] if _others(result) else []
    return parts, names


def _others(result: Simulated) -> list[_Series]:
    """Readings of what is no coordinate of a point."""
    out = []
    for k, channel in enumerate(result.model.channels):
        if channel.measurand.label != "position":
            out.append(_Series(channel.name, result.readings[:, k], channel.dimension, channel.unit))
    return out


def _over_rows(quantity: str, series: Sequence[_Series]) -> list[Part]:
    """Panels over the rows, one for each unit, of a few series each."""
    out = []
    for unit in dict.fromkeys(s.unit for s in series):
        alike = [s for s in series if s.unit == unit and np.isfinite(s.values).any()]
        for first in range(0, len(alike), _PER_PANEL):
            out.append(_panel(quantity, alike[first : first + _PER_PANEL], unit))
    return out


def _panel(quantity: str, series: Sequence[_Series], unit: str) -> Part:
    file_unit = parse_unit(unit)
    largest = max(float(np.nanmax(np.abs(s.values))) for s in series)
    if largest < _NO_FORCE and series[0].dimension in ("force", "torque"):
        series = [replace(s, values=np.zeros_like(s.values)) for s in series]
    shown = shown_unit(series[0].dimension, largest, file_unit) if file_unit.text in ("N", "kN", "N m") else file_unit

    def draw(figure: SubFigure) -> None:
        ax = figure.add_subplot()
        for (colour, marker), one in zip(LOOKS, series, strict=False):
            rows = thinned(len(one.values), _SHOWN)
            dots(ax, rows + 1, (one.values[rows] - shown.offset) / shown.scale, colour, marker, brief(one.name))
        ax.set_ylabel(f"{quantity} [{shown.text}]")
        ax.margins(0.04, 0.1)
        over_rows(ax, "row", len(series[0].values))
        ax.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False)

    return Part(_HEIGHT, draw)
