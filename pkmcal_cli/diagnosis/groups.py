"""Nonparametric groups: smooth shapes of pose, time, temperature, direction and load, for what no effect explains."""

from __future__ import annotations

from collections.abc import Mapping
from math import comb

import numpy as np
from numpy.polynomial.legendre import legvander

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.problem import Problem

POSE, TIME, TEMPERATURE, DIRECTION, LOAD = "pose", "time", "temperature", "direction", "load"
_SHARE = 6  # rows for each shape, at least
_CONSTANT = 1e-6  # share of the largest spread of a coordinate at which another one does not vary
_TIME_DEGREE, _WARM_DEGREE = 6, 3


def group_columns(problem: Problem) -> dict[str, Array]:
    """Columns (N * C, k) of every group that the table has, in whitened channels."""
    return {name: by_channel(problem, shapes) for name, shapes in _shapes(problem).items() if shapes.shape[1]}


def by_channel(problem: Problem, shapes: Array) -> Array:
    """Each shape (N, k) in each channel, zero where nothing was measured: (N * C, k * C)."""
    rows, channels = problem.readings.shape
    out = np.zeros((rows, channels, shapes.shape[1], channels))
    for c in range(channels):
        out[:, c, :, c] = shapes * problem.measured[:, c, None]
    return out.reshape(rows * channels, -1)


def _shapes(problem: Problem) -> Mapping[str, Array]:
    columns = problem.rows.columns
    shapes = {POSE: pose_shapes(problem)}
    if _varies(columns.get("time")):
        shapes[TIME] = drift_shapes(columns["time"])
    warm = [values for name, values in columns.items() if (name == "T" or name.startswith("T.")) and _varies(values)]
    if warm:
        shapes[TEMPERATURE] = np.hstack([legvander(scaled(v), _WARM_DEGREE)[:, 1:] for v in warm])
    directions = [values for name, values in columns.items() if name.startswith("dir.") and _varies(values)]
    if directions:
        shapes[DIRECTION] = np.stack(directions, axis=1)
    if _varies(columns.get("payload")):
        shapes[LOAD] = legvander(scaled(columns["payload"]), 2)[:, 1:]
    return shapes


def drift_shapes(time: Array) -> Array:
    """Legendre polynomials (N, k) of times (N,)."""
    return np.asarray(legvander(scaled(time), _TIME_DEGREE)[:, 1:])


def _varies(values: Array | None) -> bool:
    return values is not None and bool(np.isfinite(values).all()) and bool(np.ptp(values) > 0)


def scaled(values: Array) -> Array:
    """Values (N,) on -1 ... 1."""
    low, spread = values.min(), np.ptp(values)
    return np.asarray(2 * (values - low) / spread - 1)


def pose_axes(problem: Problem) -> list[Array]:
    """Coordinates (N,) in which a pose is told, on -1 ... 1: where the nominal machine is at the drives' readings.

    Not the measured positions: their noise would be in the shapes, which would explain themselves with it. Those that
    vary by rounding only are none.
    """
    return list(varying_axes(problem).values())


def varying_axes(problem: Problem) -> dict[str, Array]:
    """The same by the names of the coordinates."""
    spread = {name: float(np.ptp(axis)) for name, axis in problem.nominal_poses.items()}
    least = _CONSTANT * max(spread.values(), default=0.0)
    return {name: scaled(axis) for name, axis in problem.nominal_poses.items() if spread[name] > least}


def pose_shapes(problem: Problem, degree: int | None = None) -> Array:
    """Products of Legendre polynomials (N, k) of the pose, none where they are too many for the rows.

    Without a degree the highest one that the rows allow, at most 5.
    """
    axes = pose_axes(problem)
    best = np.zeros((len(problem), 0))
    for d in range(1, 6) if degree is None else [degree]:
        count = comb(len(axes) + d, d)
        if axes and count * _SHARE <= len(problem):
            best = _products(axes, d)
    return best


def _products(axes: list[Array], degree: int) -> Array:
    """All products of total degree up to `degree`."""
    tables = [legvander(u, degree) for u in axes]
    powers = np.array(np.meshgrid(*[np.arange(degree + 1)] * len(axes), indexing="ij")).reshape(len(axes), -1).T
    chosen = powers[powers.sum(axis=1) <= degree]
    out = np.ones((len(axes[0]), len(chosen)))
    for table, power in zip(tables, chosen.T, strict=True):
        out *= table[:, power]
    return out
