"""Pictures put together of parts, one below the other under one title."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.pictures.picture import Picture
from pkmcal_cli.pictures.titles import Titles, plain, shortened
from pkmcal_cli.report.number_format import plain_number, three_digits
from pkmcal_cli.units.unit_text import Unit, parse_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

WIDTH = 9.0
"""Inches, of every part."""
_HEAD = 0.6  # inches, of the title
_BRIEF = 20  # characters
_NOTHING = 1e-12  # m, rad: rounding
_FINER = {"m": "mm", "mm": "um", "rad": "mrad", "mrad": "urad", "kN": "N"}
_STEPS = (
    (1.0, 2.0, 5.0),
    (1.0, 1.5, 2.0, 3.0, 5.0, 7.0),
    (1.0, 1.2, 1.4, 1.7, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0),
    tuple(k / 10 for k in range(10, 100)),
)  # of a decade, coarse to fine
_COARSER = {"um": "mm", "urad": "mrad", "N": "kN"}


@dataclass(frozen=True)
class Part:
    """A part of a picture: its height in inches, and who draws it."""

    height: float
    draw: Callable[[SubFigure], None]


def composed(name: str, titles: Titles, alt: str, parts: Sequence[Part]) -> Picture:
    """A picture of parts."""
    heights = [_HEAD, *(part.height for part in parts)]
    size = (WIDTH, sum(heights))

    def draw(figure: Figure) -> None:
        titles.write(figure)
        panes: Any = figure.subfigures(len(heights), 1, height_ratios=heights)
        for part, pane in zip(parts, panes[1:], strict=True):
            part.draw(pane)

    return Picture(name, f"{titles.machine}: {titles.subject}", alt, size, draw)


def shown_unit(dimension: str, size: float, default: Unit | None = None) -> Unit:
    """The unit in which values of a size (SI) have up to four figures before the point; `default`: where to begin."""
    unit = default or parse_unit({"length": "um", "angle": "urad", "force": "N", "torque": "N m"}.get(dimension, "1"))
    while size >= 3000 * unit.scale and unit.text in _COARSER:
        unit = parse_unit(_COARSER[unit.text])
    while 0 < size < 0.3 * unit.scale and unit.text in _FINER:
        unit = parse_unit(_FINER[unit.text])
    return unit


def rounded(value: float) -> float:
    """The value of 1, 2 or 5 times a power of ten that is nearest below."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(power * max(r for r in (1.0, 2.0, 5.0) if r * power <= value * (1 + 1e-9)))


def size_text(value: float, dimension: str = "length") -> str:
    """A size (SI) to three digits in the unit that suits it, without powers of ten; what is rounding is 0."""
    value = 0.0 if abs(value) < _NOTHING else value
    unit = shown_unit(dimension, abs(value))
    while abs(value) >= 999.5 * unit.scale and unit.text in _COARSER:
        unit = parse_unit(_COARSER[unit.text])
    return f"{three_digits(value / unit.scale)} {unit.text}"


def log_ticks(low: float, high: float, steps: Sequence[float]) -> list[float]:
    """Steps times powers of ten that lie within a range above zero."""
    decades = range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
    return [s * 10.0**d for d in decades for s in steps if low <= s * 10.0**d <= high]


def _steps(low: float, high: float) -> tuple[float, ...]:
    """The coarsest steps of a decade of which two lie in a range; there a library's own choice would be crowded."""
    return next((s for s in _STEPS if len(log_ticks(low, high, s)) > 1), _STEPS[0])


def plain_log(ax: Axes, axis: str = "x") -> None:
    """A logarithmic axis whose ticks are plain numbers, at least two of them."""
    from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullFormatter

    which = ax.xaxis if axis == "x" else ax.yaxis
    (ax.set_xscale if axis == "x" else ax.set_yscale)("log")
    low, high = ax.get_xlim() if axis == "x" else ax.get_ylim()
    decades = np.log10(high / low)
    steps = _steps(low, high)
    if steps in _STEPS[1:]:
        which.set_major_locator(FixedLocator(log_ticks(low, high, steps)))
    else:
        which.set_major_locator(LogLocator(subs=steps if decades < 2.5 else (1.0,), numticks=12))
    which.set_major_formatter(FuncFormatter(lambda value, _: plain_number(value)))
    which.set_minor_formatter(NullFormatter())


def thinned(count: int, most: int) -> Array:
    """Numbers of at most `most` rows out of `count`, evenly spread."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(np.intp))


def dots(ax: Any, x: Array, y: Array, colour: str, marker: str, label: str | None = None) -> None:
    """Markers without lines, smaller where there are many."""
    ax.plot(x, y, ls="none", marker=marker, ms=4 if len(x) < 300 else 2, mfc=colour, mec="none", label=label)


def over_rows(ax: Axes, label: str, count: int) -> None:
    """The axis of `count` numbered rows: whole numbers, also where there is one row."""
    from matplotlib.ticker import MaxNLocator

    ax.set_xlabel(label)
    ax.set_xlim(1 - (room := max(0.04 * count, 0.6)), count + room)
    ax.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))


def brief(name: str) -> str:
    """A name as a legend, or an axis of one panel of several, has room for it."""
    return shortened(plain(name), _BRIEF)
