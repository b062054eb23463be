"""Expected standard uncertainties of parameters, as shares of their ranges."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from pkmcal_cli.pictures.picture import AFTER, FITTED, Picture

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MOST = 60  # parameters
_LEAST = 1e-6  # share that is drawn


def shares(title: str, parameters: Mapping[str, float]) -> Picture:
    """A bar for each parameter: standard uncertainty over range, on a logarithmic axis; nan: undetermined."""
    shown = dict(list(parameters.items())[:_MOST])
    more = f" (first {_MOST} of {len(parameters)})" if len(parameters) > _MOST else ""
    alt = f"standard uncertainty over range of {len(shown)} parameters{more}"
    size = (6.5, 0.24 * max(len(shown), 2) + 1.2)
    return Picture("uncertainties", title + more, alt, size, partial(_draw, title=title + more, shown=shown))


def _draw(figure: Figure, title: str, shown: Mapping[str, float]) -> None:
    ax = figure.subplots()
    figure.suptitle(title, fontsize=10)
    known = {name: max(share, _LEAST) for name, share in shown.items() if np.isfinite(share)}
    least = min([*known.values(), 0.1]) / 2
    for k, (name, _) in enumerate(shown.items()):
        if name in known:
            ax.barh(k, known[name] - least, left=least, color=AFTER, height=0.6)
        else:
            ax.annotate("undetermined", (least, k), xytext=(4, 0), textcoords="offset points", va="center", fontsize=8)
    ax.axvline(0.5, color=FITTED, ls="--", lw=1)  # what its range tells already
    ax.set_xscale("log")
    ax.set_xlim(least, max([*known.values(), 1.0]) * 1.5)
    ax.set_yticks(range(len(shown)), list(shown))
    ax.set_ylim(len(shown) - 0.5, -0.5)
    ax.set_xlabel("standard uncertainty / range (dashed: what the range tells by itself)")
