"""Named values as dots on one axis, one line each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pkmcal_cli.pictures.parts import Part, plain_log
from pkmcal_cli.pictures.picture import AFTER, BEFORE, NOISE
from pkmcal_cli.pictures.titles import plain, shortened

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import SubFigure

_MOST = 50  # lines
_NAME, _TEXT = 30, 26  # characters
_LINE, _FRAME = 0.24, 0.85  # inches


@dataclass(frozen=True, kw_only=True)
class Dot:
    """A line: name, value as it is drawn (nan: none), half of its interval, what stands at the right.

    good: drawn full, else open and in the other colour.
    """

    name: str
    value: float
    half: float = 0.0
    text: str = ""
    good: bool = True


@dataclass(frozen=True, kw_only=True)
class Scale:
    """The axis of dots: what it says, whether it is logarithmic, and up to where values are grey."""

    label: str
    logarithmic: bool = False
    band: tuple[float, float] | None = None
    line: float | None = None


def dot_part(rows: Sequence[Dot], scale: Scale) -> Part:
    """Dots from the top; no more than fifty, the others are counted below the axis."""
    shown = list(rows[:_MOST])

    def draw(figure: SubFigure) -> None:
        ax = figure.add_subplot()
        _limits(ax, shown, scale)
        if scale.band is not None:
            ax.axvspan(*scale.band, color="0.93", lw=0)
        if scale.line is not None:
            ax.axvline(scale.line, color=NOISE, lw=1, ls="--")
        for k, dot in enumerate(shown):
            _line(ax, k, dot)
        ax.set_yticks(range(len(shown)), [shortened(plain(d.name), _NAME) for d in shown])
        ax.set_ylim(len(shown) - 0.4, -0.6)
        ax.grid(axis="y", visible=False)
        if any(d.text for d in shown):
            beside = ax.secondary_yaxis("right")
            beside.set_yticks(range(len(shown)), [shortened(plain(d.text), _TEXT) for d in shown])
            beside.tick_params(length=0)
        if not any(math.isfinite(d.value) for d in shown):  # a scale of nothing
            ax.set_xticks([], minor=False)
            ax.set_xticks([], minor=True)
        more = f"; {len(rows) - len(shown)} more are not shown" if len(rows) > len(shown) else ""
        ax.set_xlabel(scale.label + more)

    return Part(_FRAME + _LINE * max(len(shown), 1), draw)


def _line(ax: Axes, k: int, dot: Dot) -> None:
    if not math.isfinite(dot.value):
        return
    colour, marker = (AFTER, "o") if dot.good else (BEFORE, "s")
    if dot.half and math.isfinite(dot.half):
        ax.plot([dot.value - dot.half, dot.value + dot.half], [k, k], color=colour, lw=1.6)
    face = colour if dot.good else "white"
    ax.plot(dot.value, k, marker=marker, mfc=face, mec=colour, ms=5.5, ls="none", gid=f"dot-{k}")


def _limits(ax: Axes, rows: Sequence[Dot], scale: Scale) -> None:
    """Limits around all that is drawn."""
    known = [d for d in rows if math.isfinite(d.value)]
    halves = [d.half if math.isfinite(d.half) else 0.0 for d in known]
    every = [d.value + sign * half for d, half in zip(known, halves, strict=True) for sign in (-1, 1)]
    every += [x for x in (*(scale.band or ()), *(() if scale.line is None else (scale.line,))) if math.isfinite(x)]
    if scale.logarithmic:
        every = [x for x in every if x > 0]
    low, high = (min(every), max(every)) if every else (1.0, 1.0)
    if scale.logarithmic:
        ax.set_xlim(low / 1.6, high * 1.6)
        plain_log(ax)
        return
    room = 0.06 * (high - low) or 0.1 * abs(high) or 1.0
    ax.set_xlim(low - room, high + room)
