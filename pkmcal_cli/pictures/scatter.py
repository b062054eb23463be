"""Positions of a tool point, plane by plane, at one scale in both directions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.pictures.parts import Part, thinned
from pkmcal_cli.pictures.picture import AFTER, BEFORE, FITTED, NOISE
from pkmcal_cli.pictures.titles import plain
from pkmcal_cli.units.unit_text import Unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import SubFigure

_SHOWN = 5000  # points
_STAYS = 1e-9  # m, rad
_HEIGHT, _LOW = 3.6, 2.2  # inches
_LABEL = 22  # letters of a line that the lowest part is high enough for
_FLAT = 0.3  # height by width below which the lower part will do, and no plane is drawn flatter


@dataclass(frozen=True)
class Cloud:
    """Places (N, K), m (orientations: rad), with a name; values (N,) that colours say, in the unit `of`."""

    name: str
    at: Array
    values: Array | None = None
    of: Unit | None = None
    path: bool = False  # rows follow one another


def planes(names: Sequence[str]) -> list[tuple[int, int]]:
    """Pairs of coordinates that are drawn."""
    return [(0, 1)] if len(names) == 2 else [(0, 1), (0, 2)] if len(names) > 2 else []


def moving(names: Sequence[str], at: Array) -> list[int]:
    """Columns of poses (N, K), m and rad, that are drawn: positions, or the orientation of a tool that only turns."""
    columns = [[k for k, name in enumerate(names) if name.startswith("r") is turns] for turns in (False, True)]
    ways = [bool(len(at)) and float(np.ptp(at[:, some], axis=0).max(initial=0.0)) > _STAYS for some in columns]
    return columns[1] if ways == [False, True] and len(columns[1]) > 1 else columns[0]


def scatter_part(clouds: Sequence[Cloud], names: Sequence[str], unit: Unit) -> Part:
    """Clouds of places; of coordinates x y z (rx ry rz) the planes xy and xz, side by side."""
    pairs = planes(names)
    every = np.vstack([c.at for c in clouds])
    sizes = [np.ptp(every[:, list(pair)], axis=0) for pair in pairs]
    flat = all(size[1] < _FLAT * size[0] for size in sizes)

    def draw(figure: SubFigure) -> None:
        axes = np.ravel(figure.subplots(1, len(pairs), squeeze=False))
        for ax, (a, b) in zip(axes, pairs, strict=True):
            _draw_plane(ax, clouds, (a, b), unit)
            ax.set_xlabel(f"{names[a]} [{unit.text}]")
            ax.set_ylabel(f"{names[b]} [{unit.text}]")
            if sizes[0].max() > 0:
                ax.set_aspect("equal", adjustable="box")
        handles, labels = axes[0].get_legend_handles_labels()
        if labels:
            figure.legend(handles, labels, loc="outside upper center", ncols=len(labels), frameon=False, fontsize=8)
        _bar(figure, axes, clouds)

    return Part(_LOW if flat else _HEIGHT, draw)


def _draw_plane(ax: Axes, clouds: Sequence[Cloud], pair: tuple[int, int], unit: Unit) -> None:
    limits = _limits(clouds)
    for cloud, colour, marker in zip(clouds, (AFTER, BEFORE, FITTED), ("o", "^", "x"), strict=False):
        rows = thinned(len(cloud.at), _SHOWN)
        x, y = (cloud.at[rows][:, list(pair)] / unit.scale).T
        label = plain(cloud.name) if cloud.name else None
        if cloud.path:
            ax.plot(x, y, color=NOISE, lw=0.6, zorder=1)
            ax.plot(x[:1], y[:1], marker="D", ms=6, color=BEFORE, ls="none", label="first row", zorder=4)
        size = 16 if len(rows) < 400 else 5
        if cloud.values is None:
            ax.scatter(x, y, s=size, c=colour, marker=marker, label=label, zorder=3, linewidths=0.6)
        else:
            shown = cloud.of.scale if cloud.of is not None else 1.0
            ax.scatter(x, y, s=size * 2, c=cloud.values[rows] / shown, cmap="cividis", zorder=3, **limits)
    ax.margins(0.08)
    _room(ax)


def _room(ax: Axes) -> None:
    """Height for positions that all lie on one line: ticks need some."""
    (left, right), (low, high) = ax.get_xlim(), ax.get_ylim()
    least = _FLAT * (right - left)
    if high - low < least:
        ax.set_ylim(0.5 * (low + high - least), 0.5 * (low + high + least))


def _limits(clouds: Sequence[Cloud]) -> dict[str, Any]:
    """The scale of colours, which begins at zero."""
    values = [c.values / (c.of.scale if c.of is not None else 1.0) for c in clouds if c.values is not None]
    return {"vmin": 0.0, "vmax": max(float(np.nanmax(v)) for v in values) or 1.0} if values else {}


def _bar(figure: SubFigure, axes: Any, clouds: Sequence[Cloud]) -> None:
    """What the colours say."""
    valued = next((c for c in clouds if c.values is not None), None)
    if valued is not None:
        drawn = axes[0].collections[0]
        label = fill(f"{valued.name} [{valued.of.text if valued.of else '1'}]", _LABEL)
        figure.colorbar(drawn, ax=list(axes), label=label, shrink=0.9)
