"""Noise that is larger on one side of the workspace, or far from the instrument: rows then count by it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.diagnosis.groups import varying_axes
from pkmcal_cli.diagnosis.linear import Linear
from pkmcal_cli.diagnosis.scale import Scale
from pkmcal_cli.units.measurands import Measurand

DISTANCE = "distance"
_FREE = 0.2  # share of a value's variance that must be left by what is projected out
_FEWEST_ROWS = 30  # rows of a sensor that can show how its noise depends on the place
_LARGEST = 16.0  # squares count up to this, so that a few odd rows are no growth of noise
_STEEPEST = 4.0  # logarithm of the ratio of standard deviations, that is looked for


@dataclass(frozen=True, kw_only=True)
class NoiseGrowth:
    """Noise of a sensor that grows `towards` a side, such as "x+", or with the distance from its origin.

    ratio: standard deviation at the far end of the table over that at the near end, and its standard uncertainty;
    slope: m/m, of sigma^2 = level stated^2 + (slope distance)^2, nan for a side; factor (N, C): sigma of all rows over
    what is stated, 1 in the mean square and for other sensors.
    """

    sensor: str
    towards: str
    ratio: float
    ratio_std: float
    slope: float
    slope_std: float
    p_value: float
    factor: Array


@dataclass(frozen=True)
class _Squares:
    """Squares of standardised residuals (n, c) of one sensor at some rows (N,), its channels; `scale`: what the squares
    were divided by."""

    values: Array
    rows: NDArray[np.bool_]
    channels: list[int]
    scale: float

    def score(self, level: Array) -> float:
        """How far sizes of residuals grow with a level (n,), in standard deviations of sizes that do not.

        Of sizes as they scatter, normal or not (Glejser 1969, studentised as by Koenker 1981): squares, which scatter
        most where noise is largest, show much less of a growth that is large.
        """
        sizes = np.sqrt(np.minimum(self.values, _LARGEST))
        level = np.repeat((level - level.mean())[:, None], sizes.shape[1], axis=1)
        spread = float(np.sqrt((level**2).sum() * sizes.var()))
        return float((level * sizes).sum()) / spread if spread > 0 else 0.0


def noise_growth(linear: Linear, problem: Problem, scale: Scale, alpha: float) -> tuple[NoiseGrowth, ...]:
    """Of each sensor the strongest growth of its noise, where that is significant at alpha for all of them together."""
    every = [tests for tests in _tests(linear, problem, scale) if tests]
    count = sum(map(len, every))
    strongest = (min(tests, key=lambda test: test[0]) for tests in every)
    return tuple(estimated(p) for p, estimated in strongest if p * count < alpha)


def weighted(problem: Problem, growths: tuple[NoiseGrowth, ...]) -> Problem:
    """The problem with sigma as its noise grows."""
    factor = np.prod([g.factor for g in growths], axis=0)
    return replace(problem, sigma=problem.sigma * factor)


_Test = tuple[float, Callable[[float], NoiseGrowth]]
"""The p value of a growth, and the growth of this p value, which is estimated where it is significant."""


def _tests(linear: Linear, problem: Problem, scale: Scale) -> Iterator[list[_Test]]:
    """Of each sensor with enough rows: towards every side that noise grows to, and with the distance."""
    axes = varying_axes(problem)
    for sensor in problem.model.sensors:
        channels = [channel for channel, _ in sensor.places]
        squares = _squares(linear, problem, scale, channels)
        if squares is None:
            continue
        there = {name: axis for name, axis in axes.items() if np.ptp(axis[squares.rows]) > 0}
        yield [
            *(_towards_side(sensor.name, name, axis, squares, problem) for name, axis in there.items()),
            *_with_distance(sensor.name, squares, problem),
        ]


def _squares(linear: Linear, problem: Problem, scale: Scale, channels: list[int]) -> _Squares | None:
    """Squares of a sensor's rows that take part; None where they are too few, or readings are of two rows each."""
    shape = problem.readings.shape
    free = linear.freedom.reshape(shape)[:, channels]
    rows = np.asarray(linear.on[:, channels].all(axis=1) & (free > _FREE).all(axis=1))
    if rows.sum() < _FEWEST_ROWS or not channels:
        return None
    residual = linear.unexplained.reshape(shape)[rows][:, channels]
    return _Squares(residual**2 / free[rows] / scale.variance, rows, channels, scale.variance)


def _towards_side(sensor: str, name: str, axis: Array, squares: _Squares, problem: Problem) -> _Test:
    """Along a coordinate (N,) of -1 ... 1: standard deviations grow as its exponential."""
    p_value = 2.0 * float(ndtr(-abs(squares.score(axis[squares.rows]))))
    return p_value, partial(_along_side, sensor, name, axis, squares, problem)


def _along_side(
    sensor: str, name: str, axis: Array, squares: _Squares, problem: Problem, p_value: float
) -> NoiseGrowth:
    along = axis[squares.rows]
    level = np.repeat(along[:, None], squares.values.shape[1], axis=1)
    values = np.minimum(squares.values, _LARGEST)

    def cost(power: float) -> float:
        return float(np.log((values * np.exp(-power * level)).mean()) + power * level.mean())

    power = _least(cost, -_STEEPEST, _STEEPEST)
    std = float(np.sqrt(2.0 / ((level - level.mean()) ** 2).sum()))
    sign = "+" if power > 0 else "-"
    return NoiseGrowth(
        sensor=sensor,
        towards=f"{name}{sign}",
        ratio=float(np.exp(abs(power))),
        ratio_std=float(np.exp(abs(power))) * std,
        slope=float("nan"),
        slope_std=float("nan"),
        p_value=p_value,
        factor=_factor(problem, squares, np.exp(power * axis)[:, None]),
    )


def _with_distance(sensor: str, squares: _Squares, problem: Problem) -> list[_Test]:
    """With the distance of a position from the sensor's origin; nothing where it does not grow, or is no position."""
    channels = problem.model.channels
    of_position = [k for k, c in enumerate(squares.channels) if channels[c].measurand is Measurand.POSITION]
    if len(of_position) < 2:  # else its reading is no place
        return []
    places = [squares.channels[k] for k in of_position]
    distance2 = (problem.readings[:, places] ** 2).sum(axis=1)
    distance2 = np.where(np.isfinite(distance2), distance2, distance2[squares.rows].mean())
    grown = distance2[:, None] / problem.sigma[:, places] ** 2  # (N, c)
    positions = replace(squares, values=squares.values[:, of_position], channels=places)
    score = positions.score(distance2[squares.rows])
    if score <= 0:
        return []
    return [(float(ndtr(-score)), partial(_along_distance, sensor, grown, positions, problem))]


def _along_distance(sensor: str, grown: Array, positions: _Squares, problem: Problem, p_value: float) -> NoiseGrowth:
    """grown (N, c): squares of the distance in those of sigma."""
    relative, std, level = _slope(grown[positions.rows], np.minimum(positions.values, _LARGEST))
    there, variance = grown[positions.rows], 1 + relative**2 * grown
    far, near = variance[positions.rows].max(), variance[positions.rows].min()
    ratio = float(np.sqrt(far / near))
    by_slope = float(relative * (there.max() / far - there.min() / near)) * ratio  # derivative of the ratio
    root = np.sqrt(level * positions.scale)
    return NoiseGrowth(
        sensor=sensor,
        towards=DISTANCE,
        ratio=ratio,
        ratio_std=abs(by_slope) * std,
        slope=root * relative,
        slope_std=root * std,
        p_value=p_value,
        factor=_factor(problem, positions, variance),
    )


def _slope(grown: Array, values: Array) -> tuple[float, float, float]:
    """The likeliest slope, its standard uncertainty, and level, of squares (n, c) of level (1 + slope^2 grown)."""

    def cost(slope: float) -> float:  # of the likeliest level
        variance = 1 + slope**2 * grown
        return float(np.log((values / variance).mean()) + np.log(variance).mean())

    slope = _least(cost, 0.0, 10 / float(np.sqrt(np.median(grown))))
    variance = 1 + slope**2 * grown
    share = grown / variance
    information = 0.5 * float(((share - share.mean()) ** 2).sum())  # of the slope's square, whatever the level
    std = 0.5 / (slope * np.sqrt(information)) if slope > 0 and information > 0 else float("inf")
    return slope, std, float((values / variance).mean())


def _least(cost: Callable[[float], float], low: float, high: float) -> float:
    """Where a cost is least between bounds."""
    from scipy.optimize import minimize_scalar  # seldom needed, and dear to import

    minimum = minimize_scalar(cost, bounds=(low, high), method="bounded", options={"xatol": 1e-6 * (high - low)})
    return float(minimum.x)


def _factor(problem: Problem, squares: _Squares, variance: Array) -> Array:
    """Sigma of all rows (N, C) over what is stated, by relative variances (N, 1 or c) of a sensor's rows."""
    out = np.ones(problem.readings.shape)
    out[:, squares.channels] = np.sqrt(variance / variance[squares.rows].mean(axis=0))
    return out
