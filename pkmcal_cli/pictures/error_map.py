"""Errors of positions as arrows, at one scale before and after, once more magnified where the latter are small."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from textwrap import wrap
from typing import TYPE_CHECKING

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.pictures.parts import WIDTH, Part, composed, rounded, size_text, thinned
from pkmcal_cli.pictures.picture import AFTER, BEFORE, FITTED, NOISE, Picture
from pkmcal_cli.pictures.titles import Titles
from pkmcal_cli.units.measurands import Measurand
from pkmcal_cli.units.unit_text import Unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import SubFigure

_TYPICAL, _LONGEST = 0.07, 0.3  # lengths of the typical and of the longest arrow, of the region's width
_SMALL = 8.0  # times smaller: arrows that cannot be seen are shown magnified
_MOST = 1000.0  # times they are magnified at most
_SHOWN = 400  # arrows
_AROUND = 0.05  # of the region: room around arrows
_LEFT, _RIGHT, _BETWEEN, _BOTTOM, _KEY = 0.85, 0.15, 0.3, 0.55, 0.72  # inches
_LOWEST, _HIGHEST = 1.3, 4.6  # inches, of a panel
_CIRCLE = 0.2  # inches, radius of a circle of noise that has room in the key
_ALONE = 0.01  # m, around a single position
_UNSEEN = 1e-9  # m: less is what a solver leaves, and no instrument sees it
_NOTHING = 1e-12  # m: rounding
_ROUNDING = 1e-6  # of the errors of the first stage: the same of what is solved for
_LETTER, _LINES = 0.08, 2  # inches, of a letter of a panel's title, and its lines at most


@dataclass(frozen=True)
class PlaneErrors:
    """Positions (N, 2) and their errors by stage (N, 2), SI, in a plane; sigma: of a coordinate, nan where unknown.

    axes: name of the instrument in whose axes they are, "" for those of the machine.
    """

    plane: str
    at: Array
    stages: tuple[tuple[str, Array], ...]
    sigma: float
    axes: str = ""

    def label(self, k: int, unit: Unit) -> str:
        """Of one of its axes."""
        return f"{self.plane[k]}{f' of {self.axes}' if self.axes else ''} [{unit.text}]"


@dataclass(frozen=True)
class _Panel:
    title: str
    errors: Array
    magnified: float
    colour: str


def places_of(problem: Problem, stages: Sequence[tuple[str, Array]]) -> list[PlaneErrors]:
    """Positions and errors of the first point that is measured, plane by plane; none without positions.

    stages: names and residuals (N, C), measured minus predicted.
    """
    channels = position_channels(problem)
    whole = problem.measured[:, channels].all(axis=1)
    whole &= np.all([np.isfinite(r[:, channels]).all(axis=1) for _, r in stages], axis=0)
    if len(channels) < 2 or not whole.any():
        return []
    at = problem.readings[whole][:, channels]
    sigma = float(np.sqrt((problem.sigma[whole][:, channels] ** 2).mean()))
    instrument = problem.model.channels[channels[0]].instrument
    axes = instrument if instrument in problem.model.fitted_frames else ""
    letters = [problem.model.channels[k].name.rpartition(".")[2] for k in channels]
    pairs = [(0, 1)] if len(channels) == 2 else [(0, 1), (0, 2)]
    out = []
    for pair in pairs:
        pair_columns = [channels[k] for k in pair]
        errors = tuple((n, r[whole][:, pair_columns]) for n, r in stages)
        out.append(PlaneErrors("".join(letters[k] for k in pair), at[:, list(pair)], errors, sigma, axes))
    return out


def position_channels(problem: Problem) -> list[int]:
    """Channels of the coordinates of the first point whose positions are measured."""
    every = problem.model.measuring(Measurand.POSITION)
    first = next((problem.model.channels[k].index for k in every), None)
    return [k for k in every if problem.model.channels[k].index == first]


def error_map(places: Sequence[PlaneErrors], titles: Titles, length: Unit, name: str = "errors") -> Picture:
    """All planes in one picture; `length`: unit of the axes."""
    return composed(name, titles, errors_in_words(places), [map_part(p, length) for p in places])


def errors_in_words(places: Sequence[PlaneErrors]) -> str:
    """What the arrows say."""
    by_plane = [f"{p.plane}: " + ", ".join(f"{n} {size_text(_rms(e))} rms" for n, e in p.stages) for p in places]
    return "Errors of positions as arrows. " + "; ".join(by_plane) + "."


def map_part(places: PlaneErrors, length: Unit) -> Part:
    """One plane as a part of a picture: a panel for each stage."""
    panels, factor = _panels(places), _factor(places)
    ends = [places.at, *(places.at + factor * p.magnified * p.errors for p in panels)]
    limits = _limits(np.vstack(ends), _region(places.at))
    width = (WIDTH - _LEFT - _RIGHT - (len(panels) - 1) * _BETWEEN) / len(panels)
    size = np.ptp(limits, axis=0)
    height = float(np.clip(width * size[1] / size[0], _LOWEST, _HIGHEST))
    per_inch = float(max(size[0] / width, size[1] / height))  # of what is drawn, m
    half = 0.5 * per_inch * np.array([width, height])
    limits = np.array([limits.mean(axis=0) - half, limits.mean(axis=0) + half])
    total = _KEY + height + _BOTTOM

    def draw(figure: SubFigure) -> None:
        for k, panel in enumerate(panels):
            left = _LEFT + k * (width + _BETWEEN)
            ax = figure.add_axes((left / WIDTH, _BOTTOM / total, width / WIDTH, height / total))
            shown = thinned(len(places.at), _SHOWN)
            at, moved = places.at[shown] / length.scale, factor * panel.magnified * panel.errors[shown] / length.scale
            ax.plot(*at.T, ls="none", marker="o", ms=1.6, mec="none", color=NOISE, zorder=2)
            ax.quiver(*at.T, *moved.T, angles="xy", scale_units="xy", scale=1, units="inches", width=0.016,
                      color=panel.colour, zorder=3)  # fmt: skip
            ax.set_xlim(*limits[:, 0] / length.scale)
            ax.set_ylim(*limits[:, 1] / length.scale)
            few = "" if len(shown) == len(places.at) else f"; {len(shown)} of {len(places.at)} rows are shown"
            ax.set_xlabel(f"{places.label(0, length)}{few}", fontsize=8 if few else 9)
            ax.locator_params(nbins=5)
            if k:
                ax.set_yticklabels([])
            else:
                ax.set_ylabel(places.label(1, length))
            key = figure.add_axes((left / WIDTH, (_BOTTOM + height) / total, width / WIDTH, _KEY / total))
            _key(key, panel, places, factor * panel.magnified / per_inch, width)

    return Part(total, draw)


def _panels(places: PlaneErrors) -> list[_Panel]:
    """A panel for each stage, and the last one magnified where it is much smaller than the first."""
    colours = [BEFORE] + [AFTER] * (len(places.stages) - 1) if len(places.stages) > 1 else [AFTER]
    out = [_Panel(n, e, 1.0, c) for (n, e), c in zip(places.stages, colours, strict=True)]
    first, last = _rms(places.stages[0][1]), _rms(places.stages[-1][1])
    if len(out) > 1 and last > _negligible(places) and first > _SMALL * last:
        power = float(np.clip(10.0 ** np.floor(np.log10(first / last) + 0.3), 10.0, _MOST))
        out.append(_Panel(f"{power:g} x", places.stages[-1][1], power, AFTER))
    return out


def _negligible(places: PlaneErrors) -> float:
    """Errors, m, that are what solving leaves, not what a machine does."""
    return max(_UNSEEN, _ROUNDING * _rms(places.stages[0][1]))


def _rms(errors: Array) -> float:
    return float(np.sqrt((errors**2).sum(axis=1).mean()))


def _factor(places: PlaneErrors) -> float:
    """How much larger errors are drawn than positions, at the scale of the first stage."""
    region = _region(places.at)
    largest = max(places.stages, key=lambda stage: _rms(stage[1]))[1]
    typical, longest = _rms(largest), float(np.sqrt((largest**2).sum(axis=1)).max())
    if typical <= _NOTHING:
        typical = longest = places.sigma if np.isfinite(places.sigma) else 1e-6
    return min(_TYPICAL * region / typical, _LONGEST * region / longest)


def _region(at: Array) -> float:
    """Width of the region of positions (N, 2), m; of a single one, a little."""
    width = float(np.ptp(at, axis=0).max())
    return width if width > 0 else _ALONE


def _limits(places: Array, region: float) -> Array:
    """Corners (2, 2) of what lies around places (K, 2)."""
    low, high = places.min(axis=0), places.max(axis=0)
    most = max(float((high - low).max()), region)
    lacking = np.maximum(0.15 * most - (high - low), 0.0) / 2 + _AROUND * most
    return np.array([low - lacking, high + lacking])


def _heading(panel: _Panel, negligible: float, letters: int) -> str:
    """What a panel shows and how much it is, in lines of so many letters."""
    if panel.magnified != 1:
        return f"the same, arrows {panel.title}"
    rms = _rms(panel.errors)
    size = f": {size_text(rms if rms > negligible else 0.0)} rms"
    lines = wrap(panel.title, letters, max_lines=_LINES, placeholder=" ...") or [""]
    if len(lines[-1]) + len(size) <= letters:
        return "\n".join([*lines[:-1], lines[-1] + size])
    return "\n".join([*lines[: _LINES - 1], size[2:]]) if len(lines) >= _LINES else "\n".join([*lines, size[2:]])


def _key(ax: Axes, panel: _Panel, places: PlaneErrors, inches: float, width: float) -> None:
    """Above a panel: what it shows, the scale arrow and the circle of noise; `inches` per metre of error."""
    from matplotlib.patches import Circle

    ax.set_axis_off()
    ax.set_xlim(0, width)
    ax.set_ylim(0, _KEY)
    text = _heading(panel, _negligible(places), int((width + 0.5 * _BETWEEN) / _LETTER))
    ax.text(0.02, _KEY - 0.02, text, va="top", size=9, weight="bold", color=panel.colour, gid="stage")
    size = rounded(0.45 / inches)
    ax.quiver([0.05], [0.22], [size * inches], [0.0], angles="xy", scale_units="xy", scale=1, units="inches",
              width=0.016, color=FITTED, gid="scale")  # fmt: skip
    ax.text(0.52, 0.22, size_text(size), va="center", size=8)
    radius = 2 * places.sigma * inches
    if not np.isfinite(radius):
        return
    fits, least = radius <= _CIRCLE, 0.01
    if fits:  # what is smaller than a line is a dot
        ax.add_patch(Circle((1.32, 0.22), max(radius, least), fill=radius < least, color=NOISE, lw=1.2, gid="noise"))
    label = f"2 sigma: {size_text(2 * places.sigma)}"
    ax.text(1.36 + radius if fits else 1.25, 0.22, label, va="center", size=8, color="0.35")
