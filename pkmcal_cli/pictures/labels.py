"""Where labels stand, so that no text lies on another, on a marker, or outside the picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from pkmcal_cli.base.rotation import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.text import Text

_WAYS = np.array([[1, 0.6], [-1, 0.6], [1, -0.6], [-1, -0.6], [0, 1], [0, -1], [1, 0], [-1, 0]])
_FAR = (5.0, 11.0, 20.0, 32.0, 46.0, 64.0)  # points between a label and what it names
_LEADER = 15.0  # points from which on a line leads to it
_PAD = 1.5  # points around a text that stay free
_STEP = 4.0  # points between the places at which lines are looked at
_ON_TEXT, _ON_MARKER, _ON_LINE, _AWAY = 1e6, 40.0, 6.0, 0.35


@dataclass(frozen=True, kw_only=True)
class Label:
    """A text that names the place `at` (2,) in data; one that is not `needed` is left out where there is no room."""

    text: str
    at: Array
    colour: str = "black"
    size: float = 8.0
    bold: bool = False
    needed: bool = True


def put_labels(ax: Axes, labels: Sequence[Label], markers: Array, lines: Sequence[Array]) -> list[Text]:
    """Write labels beside their places, clear of `markers` (K, 2) and, where it can be, of `lines` (each (K, 2)).

    The limits of the axes must be final. Earlier labels choose first.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    figure = ax.figure
    renderer = FigureCanvasAgg(figure).get_renderer()  # type: ignore[arg-type, no-untyped-call]
    pixels = figure.dpi / 72.0
    markers, dense = ax.transData.transform(markers.reshape(-1, 2)), _dense(ax, lines, _STEP * pixels)
    frame, taken, out = ax.bbox.extents, np.zeros((0, 4)), []
    for label in labels:
        weight = "bold" if label.bold else "normal"
        text = ax.text(0, 0, label.text, size=label.size, color=label.colour, weight=weight, ha="center", va="center")
        box = text.get_window_extent(renderer)
        half = np.array([box.width, box.height]) / 2 + _PAD * pixels
        at = ax.transData.transform(label.at)
        centres = _centres(at, half, pixels)
        boxes = np.hstack([centres - half, centres + half])
        costs = _costs(boxes, taken, markers, dense, frame) + _AWAY * np.repeat(_FAR, len(_WAYS))
        best = int(np.argmin(costs))
        if costs[best] >= _ON_TEXT and not label.needed:
            text.remove()
            continue
        x, y = ax.transData.inverted().transform(centres[best])
        text.set_position((float(x), float(y)))
        text.set_bbox({"facecolor": "white", "alpha": 0.8, "edgecolor": "none", "pad": 0.5})
        text.set_zorder(9)
        if _FAR[best // len(_WAYS)] >= _LEADER:
            end = ax.transData.inverted().transform(np.clip(at, boxes[best, :2], boxes[best, 2:]))
            ax.plot(*np.array([label.at, end]).T, lw=0.5, color="0.5", zorder=8)
        taken = np.vstack([taken, boxes[best]])
        out.append(text)
    return out


def _centres(at: Array, half: Array, pixels: float) -> Array:
    """Centres (K, 2) to choose from for a box of this half size, near places first."""
    every = [at + _WAYS * half + np.sign(_WAYS) * (far * pixels * _lean(_WAYS)) for far in _FAR]
    return np.vstack(every)


def _lean(ways: Array) -> Array:
    """Oblique ways are split between both directions."""
    return np.where((ways != 0).all(axis=1), np.sqrt(0.5), 1.0)[:, None]


def _costs(boxes: Array, taken: Array, markers: Array, dense: Array, frame: Sequence[float] | Array) -> Array:
    """What speaks against each box (K, 4): texts above all, the frame, markers, lines."""
    low, high = boxes[:, None, :2], boxes[:, None, 2:]
    on_text = ((low < taken[None, :, 2:]) & (high > taken[None, :, :2])).all(axis=2).sum(axis=1)
    out = (boxes[:, 0] < frame[0]) | (boxes[:, 1] < frame[1]) | (boxes[:, 2] > frame[2]) | (boxes[:, 3] > frame[3])
    on = [((low < p[None]) & (high > p[None])).all(axis=2).sum(axis=1) for p in (markers, dense)]
    return np.asarray(_ON_TEXT * (on_text + out) + _ON_MARKER * on[0] + _ON_LINE * on[1])


def _dense(ax: Axes, lines: Sequence[Array], step: float) -> Array:
    """Places in pixels along lines, a step apart, within the axes."""
    out = [np.zeros((0, 2))]
    for line in lines:
        at = ax.transData.transform(line)
        for a, b in pairwise(at):
            count = int(min(np.hypot(*(b - a)) / step, 400)) + 1
            out.append(a + (b - a) * np.linspace(0, 1, count, endpoint=False)[:, None])
    return np.vstack(out)
