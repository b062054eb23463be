"""Errors after calibration against the number of points: one panel a kind of parameter, and the tool point."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from pkmcal_cli.calibration.study_figures import TOOL, CaseFigures, Mean
from pkmcal_cli.pictures.parts import Part, composed, plain_log
from pkmcal_cli.pictures.picture import AFTER, BEFORE, FITTED, OTHER, Picture
from pkmcal_cli.pictures.titles import Titles, plain, shortened
from pkmcal_cli.report.number_format import three_digits
from pkmcal_cli.report.study import StudyReport
from pkmcal_cli.units.unit_text import Unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import SubFigure

_LINES = ((AFTER, "s", "-"), (BEFORE, "o", "--"), (OTHER, "^", "-."), (FITTED, "D", ":"))
_HEIGHT = 3.4  # inches
_WIDE = 3  # panels side by side
_NAME = 30  # characters
_SHADE = 0.2
_TWICE = 1.96  # standard uncertainties


def study_picture(report: StudyReport, titles: Titles) -> Picture:
    """Lines of every machine, with bands of 95 %, both axes logarithmic."""
    kinds = list(report.units)
    panels: list[tuple[str, Unit, Callable[[CaseFigures], Mean | None]]] = [
        (f"mean error of {kind} parameters", report.units[kind], lambda c, kind=kind: c.kinds.get(kind))  # type: ignore[misc]
        for kind in kinds
    ]
    panels.append((f"mean error of the {TOOL}", report.tool_unit, lambda c: c.tool))
    rows = [panels[k : k + _WIDE] for k in range(0, len(panels), _WIDE)]

    def part(some: list[tuple[str, Unit, Callable[[CaseFigures], Mean | None]]]) -> Part:
        def draw(figure: SubFigure) -> None:
            axes = np.ravel(figure.subplots(1, len(some), squeeze=False))
            for ax, (label, unit, of) in zip(axes, some, strict=True):
                _panel(ax, report, unit, of)
                ax.set_ylabel(f"{label} [{unit.text}]")
                ax.set_xlabel(f"measured points (noise {plain(report.noise)}); bands: 95 %")
            handles, labels = axes[-1].get_legend_handles_labels()
            figure.legend(handles, labels, loc="outside upper center", ncols=len(labels), frameon=False, fontsize=8)

        return Part(_HEIGHT, draw)

    last = [c for c in report.cases if c.points == report.study.counts[-1]]
    scale = report.tool_unit
    texts = [f"{c.machine} {three_digits(c.tool.value / scale.scale)} {scale.text}" for c in last]
    alt = f"Mean errors against the number of points; {TOOL} with {report.study.counts[-1]}: {'; '.join(texts)}."
    return composed("study", titles, alt, [part(some) for some in rows])


def _panel(ax: Axes, report: StudyReport, unit: Unit, of: Callable[[CaseFigures], Mean | None]) -> None:
    """One kind of error."""
    for machine, (colour, marker, style) in zip(report.study.machines, _LINES * 8, strict=False):
        cases = [(c.points, of(c)) for c in report.cases if c.machine == machine.name]
        known = [(count, mean) for count, mean in cases if mean is not None and np.isfinite(mean.value)]
        if not known:
            continue
        count, mean = np.array([n for n, _ in known]), np.array([m.value for _, m in known]) / unit.scale
        half = _TWICE * np.nan_to_num([m.std for _, m in known]) / unit.scale
        label = shortened(plain(machine.name), _NAME)
        ax.plot(count, mean, color=colour, marker=marker, ls=style, ms=4, label=label)
        ax.fill_between(count, np.maximum(mean - half, mean / 10), mean + half, color=colour, alpha=_SHADE, lw=0)
    plain_log(ax)
    plain_log(ax, "y")
