"""Numbers of a table's rows, a panel for each quantity: before and after, with the stated noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.pictures.picture import AFTER, BEFORE, FITTED, MARKERS, NOISE, OTHER, Picture

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MOST = 8  # panels
_COLOURS = {"before": BEFORE, "after": AFTER}
_WIDTH, _HEIGHT = 7.0, 1.7  # inches, of a panel


@dataclass(frozen=True)
class Panel:
    """Numbers (N,) of a quantity in a unit, by what they are; noise (N,): standard deviations about zero."""

    name: str
    unit: str
    series: Mapping[str, Array]
    noise: Array = field(default_factory=lambda: np.zeros(0))


def by_row(title: str, quantity: str, panels: Sequence[Panel]) -> Picture:
    """Panels one below the other; what: the quantity in words."""
    shown = tuple(panels[:_MOST])
    names = ", ".join(p.name for p in shown) or "nothing"
    more = f" (first {_MOST} of {len(panels)} channels)" if len(panels) > _MOST else ""
    size = (_WIDTH, _HEIGHT * max(len(shown), 1) + 0.6)
    alt = f"{quantity} by row: {names}{more}"
    return Picture("rows", title + more, alt, size, partial(_draw, title=title + more, quantity=quantity, panels=shown))


def _draw(figure: Figure, title: str, quantity: str, panels: Sequence[Panel]) -> None:
    figure.suptitle(title, fontsize=10)
    if not panels:
        figure.text(0.5, 0.5, "nothing to show", ha="center")
        return
    figure.supylabel(quantity, fontsize=9)
    axes = np.atleast_1d(np.asarray(figure.subplots(len(panels), 1, sharex=True)))
    for ax, panel in zip(axes, panels, strict=True):
        if len(panel.noise):
            rows = np.arange(1, len(panel.noise) + 1)
            ax.fill_between(rows, -2 * panel.noise, 2 * panel.noise, color=NOISE, alpha=0.3, lw=0, label="2 sigma")
        for name, values in panel.series.items():
            colour = _COLOURS.get(name, FITTED if len(panel.series) == 1 else OTHER)
            marker, rows = MARKERS.get(colour, "."), np.arange(1, len(values) + 1)
            ax.plot(rows, values, marker, color=colour, ms=3, label=name if len(panel.series) > 1 else None)
        ax.set_ylabel(f"{panel.name} [{panel.unit}]" if panel.unit not in ("", "1") else panel.name)
    if len(panels[0].series) > 1 or len(panels[0].noise):
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower right", ncols=3, fontsize=8)
    axes[-1].set_xlabel("row")
