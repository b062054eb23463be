"""Views of a machine: from where it is looked at, and which part of the page shows what at one scale for all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.rotation import Array

_AROUND = 0.13  # of the larger side: room for labels around a machine
_LEAST = 0.25  # of the larger side: a machine on one line has room across it
_WIDTH, _LOWEST, _HIGHEST = 7.6, 2.6, 8.0  # inches, of the one view of a planar machine
_PANE, _LOW = 4.3, 1.6  # inches, width of each of four views, and their least height
LEFT, RIGHT, TOP, BOTTOM = 0.75, 0.2, 0.75, 1.1  # inches around the views: ticks, title, legend
BETWEEN = (0.75, 0.75)  # inches between views, across and up


@dataclass(frozen=True)
class View:
    """A direction of sight: `axes` (2, 3), right and up on the page in base axes; names of these, if they are some."""

    title: str
    axes: Array
    names: tuple[str, str] | None

    def of(self, places: Array) -> Array:
        """Places (..., 3) on the page (..., 2)."""
        return np.asarray(places @ self.axes.T)


X, Y, Z = np.eye(3)
PLANE = View("", np.array([X, Y]), ("x", "y"))
ISOMETRIC = View("isometric", np.array([(X + Y) / np.sqrt(2), (2 * Z - X + Y) / np.sqrt(6)]), None)
SPACE = (
    View("from above (xy)", np.array([X, Y]), ("x", "y")),
    ISOMETRIC,
    View("from the front (xz)", np.array([X, Z]), ("x", "z")),
    View("from the right (yz)", np.array([Y, Z]), ("y", "z")),
)


@dataclass(frozen=True)
class Pane:
    """A view, its part of the page (left, bottom, width, height in inches), and what of the machine it shows (2, 2)."""

    view: View
    box: tuple[float, float, float, float]
    limits: Array


def panes(corners: Array, planar: bool) -> tuple[tuple[float, float], list[Pane]]:
    """Size of the page in inches, and the views of what lies within `corners` (K, 3), all at one scale."""
    views = (PLANE,) if planar else SPACE
    bounds = [_bounds(view.of(corners)) for view in views]
    sizes = [np.ptp(bound, axis=0) for bound in bounds]
    columns, width = (1, _WIDTH) if planar else (2, _PANE)
    highest, lowest = (_HIGHEST, _LOWEST) if planar else (_PANE, _LOW)
    per_inch = max(float(max(size[0] / width, size[1] / highest)) for size in sizes)
    rows = [list(range(k, k + columns)) for k in range(0, len(views), columns)]
    heights = [max(lowest, *(float(sizes[k][1]) / per_inch for k in row)) for row in rows]
    out, top = [], BOTTOM + sum(heights) + (len(rows) - 1) * BETWEEN[1]
    page = (LEFT + columns * width + (columns - 1) * BETWEEN[0] + RIGHT, top + TOP)
    for row, height in zip(rows, heights, strict=True):
        for column, k in enumerate(row):
            half = 0.5 * per_inch * np.array([width, height])
            middle = bounds[k].mean(axis=0)
            box = (LEFT + column * (width + BETWEEN[0]), top - height, width, height)
            out.append(Pane(views[k], box, np.array([middle - half, middle + half])))
        top -= height + BETWEEN[1]
    return page, out


def _bounds(places: Array) -> Array:
    """Lower and upper corner (2, 2) of places (K, 2), with room around them."""
    low, high = places.min(axis=0), places.max(axis=0)
    most = max(float((high - low).max()), 1e-9)
    lacking = np.maximum(_LEAST * most - (high - low), 0.0) / 2
    return np.array([low - lacking - _AROUND * most, high + lacking + _AROUND * most])


def hull(places: Array) -> Sequence[int]:
    """Numbers of the corners of the convex hull of places (K, 2), in order (Andrew 1979)."""
    order = sorted(range(len(places)), key=lambda k: (float(places[k, 0]), float(places[k, 1])))
    out: list[int] = []
    for sequence in (order, order[::-1]):
        part: list[int] = []
        for k in sequence:
            while len(part) > 1 and _area(places[part[-2]], places[part[-1]], places[k]) <= 0:
                part.pop()
            part.append(k)
        out += part[:-1]
    return out or order


def _area(a: Array, b: Array, c: Array) -> float:
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
