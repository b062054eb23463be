"""Views of a machine: from where it is looked at, and which part of the page shows what at one scale for all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.rotation import Array

_AROUND = 0.13  # of the larger side: room for labels around a machine
_LEAST = 0.25  # of the larger side: a machine on one line has room across it
_WIDTH, _LOWEST, _HIGHEST = 6.45, 2.6, 4.1  # inches, of the one view of a planar machine
_LARGE, _LARGE_LOW, _LARGE_HIGH = 7.0, 2.4, 4.6  # inches, of the isometric view, in which everything is named
_SMALL, _SMALL_LOW, _SMALL_HIGH = 1.66, 1.2, 2.6  # inches, of each of the three views below it
LEFT, RIGHT, TOP, BOTTOM = 0.75, 0.2, 0.75, 0.55  # inches around the views: ticks, title, ticks and names of axes
BETWEEN = (0.74, 0.4)  # inches between views, across (ticks) and up (title)


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
ABREAST = (
    View("from above (xy)", np.array([X, Y]), ("x", "y")),
    View("from the front (xz)", np.array([X, Z]), ("x", "z")),
    View("from the right (yz)", np.array([Y, Z]), ("y", "z")),
)


@dataclass(frozen=True)
class Pane:
    """A view, its part of the page (left, bottom, width, height in inches), and what of the machine it shows (2, 2)."""

    view: View
    box: tuple[float, float, float, float]
    limits: Array


def panes(corners: Array, planar: bool, below: float) -> tuple[tuple[float, float], list[Pane]]:
    """Size of the page in inches, and the views of what lies within `corners` (K, 3), `below` inches above its end.

    In space one large view, and three beside one another below it, at one scale. The page is as wide as the text of an
    A4 sheet, so that letters are printed at their size.
    """
    bottom = BOTTOM + below
    if planar:
        (height,), (shown,) = _fitted((PLANE,), corners, _WIDTH, (_LOWEST, _HIGHEST))
        box = (LEFT, bottom, _WIDTH, height)
        return (LEFT + _WIDTH + RIGHT, bottom + height + TOP), [Pane(PLANE, box, shown)]
    (high,), (large,) = _fitted((ISOMETRIC,), corners, _LARGE, (_LARGE_LOW, _LARGE_HIGH))
    (low, *_), limits = _fitted(ABREAST, corners, _SMALL, (_SMALL_LOW, _SMALL_HIGH))
    above = bottom + low + BETWEEN[1]
    out = [Pane(ISOMETRIC, (RIGHT, above, _LARGE, high), large)]
    for k, (view, shown) in enumerate(zip(ABREAST, limits, strict=True)):
        out.append(Pane(view, (BETWEEN[0] + k * (_SMALL + BETWEEN[0]), bottom, _SMALL, low), shown))
    return (_LARGE + 2 * RIGHT, above + high + TOP), out


def _fitted(
    views: Sequence[View], corners: Array, width: float, heights: tuple[float, float]
) -> tuple[list[float], list[Array]]:
    """Heights in inches, all the same, and limits (2, 2) of views at one scale, so that each shows all `corners`."""
    bounds = [_bounds(view.of(corners)) for view in views]
    sizes = [np.ptp(bound, axis=0) for bound in bounds]
    per_inch = max(float(max(size[0] / width, size[1] / heights[1])) for size in sizes)
    height = max(heights[0], *(float(size[1]) / per_inch for size in sizes))
    half = 0.5 * per_inch * np.array([width, height])
    return [height] * len(views), [np.array([b.mean(axis=0) - half, b.mean(axis=0) + half]) for b in bounds]


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
