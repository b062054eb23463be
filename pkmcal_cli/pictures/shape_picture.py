"""Displacements without a name: the curve that a diagnosis found, over its axis, with its uncertainty."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.diagnosis.shape_findings import ShapeFinding
from pkmcal_cli.pictures.parts import Part, shown_unit, size_text
from pkmcal_cli.pictures.picture import AFTER, FITTED, NOISE
from pkmcal_cli.pictures.titles import plain
from pkmcal_cli.report.shape_text import shape_file_units
from pkmcal_cli.units.file_units import FileUnits

if TYPE_CHECKING:
    from matplotlib.figure import SubFigure

_POINTS, _BEYOND = 241, 0.08  # points of the curve; how far it is drawn beyond its knots, of the distance between them


def curve_of(finding: ShapeFinding, x: Array) -> tuple[Array, Array]:
    """Deviation (N,) at places x (N,), m, rad or s, and its standard uncertainty (N,); m or rad.

    Between the knots what the values there leave open adds to the uncertainty, beyond them it grows to the spread.
    """
    shape = finding.shape
    basis = shape.basis(x)
    return basis @ shape.weights, np.sqrt(basis**2 @ shape.known_std**2 + shape.missing_variance(x))


def shape_in_words(finding: ShapeFinding) -> str:
    """What the picture of a shape shows."""
    highest = size_text(float(np.abs(finding.curve).max()), "angle" if finding.rotary else "length")
    return f"{finding.hypothesis.name}: deviation over {finding.depends_on}, up to {highest}, with its 95 % band."


def shape_part(finding: ShapeFinding, units: FileUnits) -> Part:
    """The curve with its 95 % band and its knots; beyond these it is drawn only to show that nothing is known there."""
    along, _ = shape_file_units(units, finding.hypothesis.at, finding.rotary)
    dimension = "angle" if finding.rotary else "length"
    knots = np.array(finding.shape.knots)
    room = _BEYOND * (knots[-1] - knots[0])
    x = np.linspace(knots[0] - room, knots[-1] + room, _POINTS)
    middle, std = curve_of(finding, x)
    inside = (x >= knots[0]) & (x <= knots[-1])
    unit = shown_unit(dimension, float(np.abs(middle[inside]).max()))

    def draw(figure: SubFigure) -> None:
        ax: Any = figure.add_subplot()
        at = np.array([along.from_si(v) for v in x])
        y, band = middle / unit.scale, 1.96 * std / unit.scale
        ax.axhline(0.0, color=NOISE, lw=0.8, ls="--", zorder=1)
        ax.fill_between(at, y - band, y + band, color=FITTED, alpha=0.15, lw=0, label="95 %")
        ax.plot(at[inside], y[inside], "-", color=FITTED, lw=1.3, label="found", zorder=3)
        low, high = (y - band)[inside].min(), (y + band)[inside].max()
        ax.set_ylim(low - 0.15 * (high - low), high + 0.15 * (high - low))
        ax.plot([along.from_si(v) for v in knots], finding.curve / unit.scale, ls="none", marker="s", ms=4, mec=AFTER,
                mfc="white", label="knots", zorder=4)  # fmt: skip
        ax.set_xlabel(f"{plain(finding.depends_on)} [{along.text}]")
        ax.set_ylabel(f"deviation [{unit.text}]")
        ax.set_title(plain(finding.hypothesis.name), fontsize=9)
        ax.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False)

    return Part(3.0, draw)
