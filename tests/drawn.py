"""What a picture really draws: its texts with their boxes, and lines by name, as matplotlib's own renderer has them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import combinations
from unittest.mock import patch

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from pkmcal_cli.pictures.picture import Picture, drawn

_TOUCH = 1.0  # pixels by which boxes may overlap: they are rounded up


@dataclass(frozen=True)
class Written:
    """A text as it was drawn, in pixels."""

    text: str
    box: Bbox

    def on(self, other: Written) -> bool:
        """Whether one lies on the other."""
        a, b = self.box, other.box
        across = min(a.x1, b.x1) - max(a.x0, b.x0)
        up = min(a.y1, b.y1) - max(a.y0, b.y0)
        return across > _TOUCH and up > _TOUCH


@contextmanager
def figure_of(picture: Picture) -> Iterator[tuple[Figure, list[Written]]]:
    """The figure after it was drawn, and its texts."""
    found: list[Written] = []
    draw = Text.draw

    def recorded(self: Text, renderer: object, *more: object, **named: object) -> None:
        draw(self, renderer, *more, **named)  # type: ignore[arg-type]
        if self.get_visible() and self.get_text().strip():
            found.append(Written(self.get_text(), self.get_window_extent(renderer)))  # type: ignore[arg-type]

    with drawn(picture) as figure, patch.object(Text, "draw", recorded):
        FigureCanvasAgg(figure).draw()  # the layout settles
        found.clear()
        FigureCanvasAgg(figure).draw()
        yield figure, found


def collisions(picture: Picture) -> list[tuple[str, str]]:
    """Texts that lie on others, or outside the picture (with "")."""
    with figure_of(picture) as (figure, texts):
        return collisions_of(figure, texts)


def collisions_of(figure: Figure, texts: list[Written]) -> list[tuple[str, str]]:
    """The same of a figure that was drawn."""
    width, height = figure.get_size_inches() * figure.dpi
    over = [(a.text, b.text) for a, b in combinations(texts, 2) if a.on(b)]
    page = Bbox([[-_TOUCH, -_TOUCH], [width + _TOUCH, height + _TOUCH]])
    out = [(t.text, "") for t in texts if not (page.contains(*t.box.min) and page.contains(*t.box.max))]
    return over + out


def lines(figure: Figure, gid: str) -> list[np.ndarray]:  # type: ignore[type-arg]
    """Data (K, 2) of the lines of a name."""
    return [np.asarray(line.get_xydata()) for ax in figure.axes for line in ax.lines if line.get_gid() == gid]
