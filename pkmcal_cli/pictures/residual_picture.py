"""What is left of the readings over the drives, before and after a calibration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.errors_before_after import drive_readings, kinds_of, length_residuals, sets_length
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.pictures.error_map import errors_in_words, map_part, places_of
from pkmcal_cli.pictures.parameter_picture import parameter_part, without_frames
from pkmcal_cli.pictures.parts import Part, brief, composed, dots, shown_unit, thinned
from pkmcal_cli.pictures.picture import AFTER, BEFORE, LOOKS, NOISE, Picture
from pkmcal_cli.pictures.titles import Titles
from pkmcal_cli.report.calibration import CalibrationReport
from pkmcal_cli.units.unit_text import Unit, parse_unit

if TYPE_CHECKING:
    from matplotlib.figure import SubFigure

_COLUMNS, _ROW = 4, 2.3  # panels side by side, inches of a row of them
_SHOWN = 2000  # rows


@dataclass(frozen=True)
class _Series:
    """One cloud of a panel: name, values (N,) in SI, nan where nothing was measured."""

    name: str
    values: Array


def calibration_picture(report: CalibrationReport, titles: Titles, length: Unit, name: str = "calibration") -> Picture:
    """Error map before and after, where positions are measured; what is left over each drive; the parameters."""
    problem, fit = report.problem, report.fit
    places = places_of(problem, [("before", fit.before.residual), ("calibrated", fit.after.residual)])
    parts = [map_part(p, length) for p in places]
    left = residual_parts(problem, fit)
    alt = (errors_in_words(places) + " " if places else "") + "Residuals over the reading of each drive."
    return composed(name, titles, alt, [*parts, *left, parameter_part(without_frames(report.rows, report.model))])


def residual_parts(problem: Problem, fit: Fit) -> list[Part]:
    """Residuals over the drives' readings: of the lengths that drives set, else of every kind that was measured."""
    lengths = length_residuals(problem, fit.values)
    if np.isfinite(lengths).any():
        return [_length_part(problem, fit, lengths)]
    out = []
    for kind, columns in kinds_of(problem.model).items():
        on = problem.measured[:, columns]
        if on.any() and problem.model.actuators:
            residual = np.where(on, fit.after.residual[:, columns], np.nan)
            names = [problem.model.channels[k].name for k in columns]
            series = [_Series(n, residual[:, k]) for k, n in enumerate(names)]
            out.append(_by_drive(problem, f"residual of {kind}", series, problem.model.channels[columns[0]].dimension))
    return out


def kind_part(problem: Problem, kind: str, columns: Sequence[int], stages: Sequence[tuple[str, Array]]) -> Part:
    """Residuals of one kind (its `columns`) over the drives' readings, by stage: names and residuals (N, C), SI."""
    series, looks = list[_Series](), list[tuple[str, str]]()
    for (stage, residual), look in zip(stages, ((BEFORE, "o"), (AFTER, "s")), strict=False):
        for k in columns:
            name = stage if k == columns[0] else f"_{stage}"  # one entry in the legend
            series.append(_Series(name, np.where(problem.measured[:, k], residual[:, k], np.nan)))
            looks.append(look)
    dimension = problem.model.channels[columns[0]].dimension
    return _by_drive(problem, f"residual of {kind}", series, dimension, looks)


def _length_part(problem: Problem, fit: Fit, after: Array) -> Part:
    """Measured less needed lengths of lines and legs, each over its own drive."""
    before = length_residuals(problem, fit.before.values)
    drives = [a for a, d in enumerate(problem.model.topology.drives) if sets_length(problem.model, d)]
    unit = shown_unit("length", _typical([before, after]))
    readings = problem.model.actuators

    def draw(figure: SubFigure) -> None:
        axes = np.ravel(figure.subplots(*_shape(len(drives)), sharey=True, squeeze=False))
        for k, (ax, a) in enumerate(zip(axes, drives, strict=False)):
            drive_unit = parse_unit(readings[a].unit)
            x = drive_readings(problem)[:, a] / drive_unit.scale
            for values, colour, marker, label in ((before, BEFORE, "o", "before"), (after, AFTER, "s", "calibrated")):
                dots(ax, x, values[:, k] / unit.scale, colour, marker, label)
            ax.axhline(0, color=NOISE, lw=0.8)
            ax.set_xlabel(f"{brief(readings[a].name)} [{drive_unit.text}]")
            if k % _COLUMNS == 0:
                ax.set_ylabel(f"length, measured - predicted [{unit.text}]", fontsize=8)
        _finish(figure, axes, len(drives))

    return Part(_height(len(drives)), draw)


def _by_drive(
    problem: Problem,
    quantity: str,
    series: Sequence[_Series],
    dimension: str,
    looks: Sequence[tuple[str, str]] = LOOKS,
) -> Part:
    """Panels of one kind, one for each drive."""
    unit = shown_unit(dimension, _typical([s.values for s in series]))
    drives = list(range(len(problem.model.actuators)))
    rows = thinned(len(problem), _SHOWN)

    def draw(figure: SubFigure) -> None:
        axes = np.ravel(figure.subplots(*_shape(len(drives)), sharey=True, squeeze=False))
        for k, (ax, a) in enumerate(zip(axes, drives, strict=False)):
            drive_unit = parse_unit(problem.model.actuators[a].unit)
            x = drive_readings(problem)[:, a] / drive_unit.scale
            for (colour, marker), one in zip(looks, series, strict=False):
                dots(ax, x[rows], one.values[rows] / unit.scale, colour, marker, brief(one.name))
            for one in series[len(looks) :]:
                dots(ax, x[rows], one.values[rows] / unit.scale, NOISE, ".")
            ax.axhline(0, color=NOISE, lw=0.8)
            ax.set_xlabel(f"{brief(problem.model.actuators[a].name)} [{drive_unit.text}]")
            if k % _COLUMNS == 0:
                ax.set_ylabel(f"{quantity} [{unit.text}]")
        _finish(figure, axes, len(drives))

    return Part(_height(len(drives)), draw)


def _typical(values: Sequence[Array]) -> float:
    every = np.concatenate([v.ravel() for v in values])
    every = np.abs(every[np.isfinite(every)])
    return float(np.quantile(every, 0.95)) if len(every) else 0.0


def _shape(count: int) -> tuple[int, int]:
    return -(-count // _COLUMNS), min(count, _COLUMNS)


def _height(count: int) -> float:
    return 0.35 + _ROW * _shape(count)[0]


def _finish(figure: SubFigure, axes: Array, used: int) -> None:
    """No panel without a drive, and one legend for all, above."""
    for ax in axes[used:]:
        ax.set_visible(False)
    handles, labels = axes[0].get_legend_handles_labels()
    if len(labels) > 1:
        figure.legend(handles, labels, loc="outside upper center", ncols=len(labels), frameon=False, fontsize=8)
