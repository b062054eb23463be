"""Error figures by kind of instrument: RMS, largest, the paper's criterion; line lengths from the measured pose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.fitted_frames import of_unplaced
from pkmcal_cli.calibration.measured_pose import measured_poses
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import Evaluation
from pkmcal_cli.calibration.unknown_sides import sided
from pkmcal_cli.mechanism.topology import Drive, DriveKind
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import drive_travels
from pkmcal_cli.units.measurands import Measurand


@dataclass(frozen=True)
class ErrorFigures:
    """Error of one kind, SI: `rms` and `largest` of a point (position), a body (orientation) or a reading (others).

    `criterion`: sum of squares over all rows (Ecorchard 2010, eq. 24), m^2 or rad^2; `count`: points or readings.
    """

    kind: str
    rms: float
    largest: float
    criterion: float
    count: int
    dimension: str


def error_figures(problem: Problem, evaluation: Evaluation, lengths: bool = True) -> dict[str, ErrorFigures]:
    """Figures of every kind that was measured, and of the drives' lengths where the pose was.

    Without rows of unknown side of approach, which are off by what nobody knows, and readings of instruments that stand
    nobody knows where.
    """
    problem = _with_known_errors(problem, evaluation)
    out: dict[str, ErrorFigures] = {}
    channels = problem.model.channels
    for name, columns in kinds_of(problem.model).items():
        squares = point_squares(problem.model, columns, evaluation.residual, problem.measured)
        if len(squares):
            out[name] = _figures(name, squares, channels[columns[0]].dimension)
    squares = length_residuals(problem, evaluation.values).ravel() ** 2 if lengths else np.zeros(0)
    squares = squares[~np.isnan(squares)]
    if len(squares):
        out["length"] = _figures("length", squares, "length")
    return out


def _with_known_errors(problem: Problem, evaluation: Evaluation) -> Problem:
    """The problem without readings whose errors are those of a side of approach or a frame that nobody knows."""
    problem = sided(problem)
    unknown = of_unplaced(problem, evaluation.values)
    return replace(problem, measured=problem.measured & ~unknown) if unknown.any() else problem


def kinds_of(model: Model) -> dict[str, list[int]]:
    """Channels by kind: positions, orientations, then each kind of instrument that reads numbers, and drives.

    A kind whose readings have several dimensions has a figure for each.
    """
    kinds = {int(k): s.kind.keyword for s in model.sensors if not s.kind.reads_coordinates for k in s.channels}
    numbers = sorted(range(len(model.channels)), key=lambda k: list(Measurand).index(model.channels[k].measurand))
    dimensions: dict[str, dict[str, list[int]]] = {}
    for k in numbers:
        channel = model.channels[k]
        kind = kinds.get(k, channel.measurand.label)
        dimensions.setdefault(kind, {}).setdefault(channel.dimension, []).append(k)
    return {
        kind if len(some) == 1 else f"{kind} ({dimension})": columns
        for kind, some in dimensions.items()
        for dimension, columns in some.items()
    }


def point_squares(model: Model, columns: Sequence[int], residual: Array, on: NDArray[np.bool_]) -> Array:
    """Squares of the errors (n,), SI, of all points, or bodies: each target of a sensor in each row; or of numbers.

    columns: channels of one kind; residual (N, C), SI; on (N, C): what counts.
    """
    if not model.channels[columns[0]].measurand.of_pose:
        return np.asarray(residual[:, columns][on[:, columns]] ** 2)
    by_point: dict[int, list[int]] = {}
    for k in columns:
        by_point.setdefault(model.channels[k].index, []).append(k)
    squares = np.where(on, residual, 0.0) ** 2  # (N, C)
    return np.concatenate([squares[on[:, some].any(axis=1)][:, some].sum(axis=1) for some in by_point.values()])


def channel_figures(problem: Problem, evaluation: Evaluation) -> dict[str, ErrorFigures]:
    """Figures of every single channel that was measured, by its name, of the same readings as `error_figures`."""
    problem = _with_known_errors(problem, evaluation)
    out: dict[str, ErrorFigures] = {}
    for k, channel in enumerate(problem.model.channels):
        used = problem.measured[:, k]
        if used.any():
            out[channel.name] = _figures(channel.name, evaluation.residual[used, k] ** 2, channel.dimension)
    return out


def pooled(figures: Sequence[dict[str, ErrorFigures]]) -> dict[str, ErrorFigures]:
    """Figures of several parts of a table together."""
    out: dict[str, ErrorFigures] = {}
    for kind in dict.fromkeys(k for f in figures for k in f):
        some = [f[kind] for f in figures if kind in f]
        count, total = sum(f.count for f in some), sum(f.criterion for f in some)
        largest = max(f.largest for f in some)
        out[kind] = ErrorFigures(kind, float(np.sqrt(total / count)), largest, total, count, some[0].dimension)
    return out


def _figures(kind: str, squares: Array, dimension: str) -> ErrorFigures:
    total = float(squares.sum())
    count = len(squares)
    return ErrorFigures(kind, float(np.sqrt(total / count)), float(np.sqrt(squares.max())), total, count, dimension)


def length_residuals(problem: Problem, values: Array) -> Array:
    """Measured line or leg length minus that which the measured pose asks for, (N, L) m, of the L drives that set one.

    The drives are strain-free at the measured pose; nan where the pose was not fully measured.
    """
    model = problem.model
    drives = [a for a, drive in enumerate(model.topology.drives) if sets_length(model, drive)]
    measured = measured_poses(problem, values)
    out = np.full((len(problem), len(drives)), np.nan)
    if not drives or not len(measured.rows):
        return out
    needed = measured.drive_readings(values)
    coefficients = model.topology.coefficients.values(model.by_name(values))
    gains = np.array([coefficients[model.actuators[a].gain_coefficient] for a in drives])
    travels = drive_travels(model, values, drive_readings(problem), problem.rows)
    out[measured.rows] = travels[measured.rows][:, drives] - needed[:, drives] * gains
    return out


def sets_length(model: Model, drive: Drive) -> bool:
    """Whether a drive sets the length of a bar or rope: a telescopic leg or a spool."""
    if drive.kind is not DriveKind.STRAIN:
        return False
    group, _, m = drive.target
    return model.topology.groups[group].element.strains[m] == "elongation"


def drive_readings(problem: Problem) -> Array:
    """Readings of all drives (N, A): inputs, or measured channels of force-controlled ones."""
    read = problem.rows.readings.copy()
    for k, channel in enumerate(problem.model.channels):
        if channel.measurand is Measurand.DRIVE:
            read[:, channel.index] = problem.readings[:, k]
    return read
