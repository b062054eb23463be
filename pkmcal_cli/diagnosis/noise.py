"""The noise that tests stand on: the stated sigma, or what the residual shows where the statement is too small."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from scipy.special import chdtrc, chdtri, ndtr

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.holdout import replicate_groups
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.diagnosis.groups import TEMPERATURE, TIME, group_columns
from pkmcal_cli.diagnosis.linear import Linear, Memory, Scale

_SURELY = 1e-4  # chance of so little noise at which the stated sigma is too large
_MOSTLY = 0.5  # of chi-square that one row must explain to be left out of the noise
_FEWEST = 20  # values that must be free once shapes are projected out
_REPEATED = 20  # degrees of freedom from which repeated poses tell the noise
_DOUBT = 0.2  # the stated sigma is kept unless so improbable: an estimate costs little, a sigma too small false alarms
_ALIKE = 1e-4  # p value below which successive rows are not independent
_FREE = 0.2  # share of a value's variance that must be left once shapes are projected out
_FEWEST_ROWS = 30  # rows of a sensor that can show how its noise depends on distance
_LARGEST = 16.0  # squares count up to this, so that a few odd rows are no growth of noise
_TRIM = 0.05  # share of the largest squares left out, so that bad rows do not count as noise


def noise_scale(linear: Linear, problem: Problem, groups: Mapping[str, Array]) -> Scale:
    """Scale of the noise: of repeated poses where there are some, else of what no smooth group explains."""
    repeated = _pure_error(linear, problem, groups)
    if repeated is not None:
        return repeated
    if linear.dof > 0 and linear.chi2 < float(chdtri(linear.dof, 1 - _SURELY)):  # whatever effects may be in it
        return Scale(linear.chi2 / linear.dof, float(linear.dof))
    shapes = np.hstack([*_none(linear), *map(linear.whitened, groups.values())])
    free = linear.projecting(linear.projected, extra=shapes)
    kept = free.freedom > _FREE  # else the shapes follow the value
    dof = free.dof
    if dof < _FEWEST or kept.sum() < _FEWEST:  # few rows: what declared parameters leave, effects included
        return _of_few(linear, problem)
    squares = np.sort(free.rest[kept] ** 2 / free.freedom[kept])
    inner = squares[: int((1 - _TRIM) * len(squares))]
    return _doubted(float(inner.sum()) / len(squares) / _trimmed_share(), dof)


def _of_few(linear: Linear, problem: Problem) -> Scale:
    """Noise by all that declared parameters leave, but for a single row that is most of it."""
    rows, channels = problem.readings.shape
    worst = int(np.argmax((linear.rest.reshape(rows, channels) ** 2).sum(axis=1)))
    alone = np.zeros((rows, channels, channels))
    alone[worst] = np.eye(channels)
    without = linear.projecting(linear.projected, extra=alone.reshape(-1, channels))
    kept = without if without.chi2 < _MOSTLY * linear.chi2 and without.dof > 0 else linear
    return _doubted(kept.chi2 / kept.dof, kept.dof) if kept.dof > 0 else Scale()


def _none(linear: Linear) -> list[Array]:
    return [np.zeros((len(linear.residual), 0))]


def _doubted(variance: float, dof: int) -> Scale:
    """The stated noise, unless an estimate makes it improbable."""
    return Scale(variance, float(dof)) if variance > float(chdtri(dof, _DOUBT)) / dof else Scale()


def _pure_error(linear: Linear, problem: Problem, groups: Mapping[str, Array]) -> Scale | None:
    """Noise within repeated poses of one session, approached from the same sides; None with few of them.

    What is smooth in time and temperature is taken off before.
    """
    if linear.memory is not None:
        return None  # rows that were made independent are no repeated poses any more
    slow = [groups[name] for name in (TIME, TEMPERATURE) if name in groups]
    columns = problem.rows.columns
    same = [columns[n] for n in columns if n.startswith(("dir.", "session.")) or n == "payload"]
    keys = np.column_stack([replicate_groups(problem), *same]) if same else replicate_groups(problem)[:, None]
    _, label = np.unique(np.nan_to_num(keys), axis=0, return_inverse=True)
    label = label.ravel()
    channels = problem.readings.shape[1]
    free = linear.projecting(linear.projected, extra=np.hstack([*_none(linear), *slow]))
    rest = (free.rest / np.sqrt(np.maximum(free.freedom, _FREE))).reshape(-1, channels) if slow else linear.residual
    rest = rest.reshape(-1, channels)
    whole = linear.on.all(axis=1)
    counts = np.bincount(label[whole])
    dof = int(np.maximum(counts - 1, 0).sum()) * channels
    if dof < _REPEATED:
        return None
    means = np.stack([np.bincount(label[whole], c[whole]) for c in rest.T], axis=1) / np.maximum(counts, 1)[:, None]
    return _doubted(float(((rest[whole] - means[label[whole]]) ** 2).sum()) / dof, dof)


def _trimmed_share() -> float:
    """Mean square of a standard normal variable without its largest squares, over all."""
    from scipy.special import ndtri

    z = float(ndtri(1 - _TRIM / 2))
    density = np.exp(-z * z / 2) / np.sqrt(2 * np.pi)
    return float(1 - _TRIM - 2 * z * density)


def time_order(problem: Problem) -> NDArray[np.intp]:
    """Rows (N,) in the order in which they were measured: by time where it is known, else as they stand."""
    time = problem.rows.columns.get("time")
    known = time is not None and bool(np.isfinite(time).all())
    return np.argsort(time, kind="stable") if known and time is not None else np.arange(len(problem))


def successive(linear: Linear, problem: Problem) -> tuple[float, float]:
    """Correlation of successive rows' residuals, and its p value; large residuals count as three times the usual."""
    rest = linear.rest.reshape(problem.readings.shape)[time_order(problem)]
    size = np.sqrt((rest**2).mean())
    on = linear.on[time_order(problem)]
    pairs = on[1:] & on[:-1]
    rest = np.clip(rest / size, -3.0, 3.0)
    squares = np.where(pairs, rest[1:] ** 2, 0.0).sum() * np.where(pairs, rest[:-1] ** 2, 0.0).sum()
    share = float(np.where(pairs, rest[1:] * rest[:-1], 0.0).sum() / np.sqrt(squares)) if squares > 0 else 0.0
    return share, float(chdtrc(1, share**2 * pairs.sum()))


def independent(linear: Linear, problem: Problem) -> Linear:
    """The problem with successive rows made independent, where noise with a memory explains best that they are not.

    A step or an oscillation in time makes them alike too; these are for others to find.
    """
    if linear.memory is not None:
        return linear
    slow = group_columns(problem).get(TIME)  # a drift is no memory
    share, p = successive(linear if slow is None else linear.projecting(linear.projected, extra=slow), problem)
    if share <= 0 or p > _ALIKE:
        return linear
    rest = linear.rest.reshape(problem.readings.shape)[time_order(problem)]
    made = linear.prewhitened(Memory(time_order(problem), share, linear.on))
    size, n = rest.shape[1], np.log(rest.size)
    memory = 0.5 * (linear.chi2 - made.chi2 - (len(rest) - 1) * size * np.log(1 - share**2)) - 0.5 * n
    step = 0.5 * _step(rest) - 0.5 * (size + 1) * n
    wave = 0.5 * _wave(rest) - 0.5 * (2 * size + 1) * n
    return made if memory > max(step, wave) else linear


def _step(rest: Array) -> float:
    """How much of the sum of squares of residuals (N, C) the best single step in their order explains."""
    rows = len(rest)
    first = np.arange(1, rows)
    sums = np.cumsum(rest - rest.mean(axis=0), axis=0)[:-1]
    return float(((sums**2).sum(axis=1) * rows / (first * (rows - first))).max())


def _wave(rest: Array) -> float:
    """How much the best single oscillation in their order explains."""
    power = np.abs(np.fft.rfft(rest, axis=0)) ** 2
    return float(power[1:-1].sum(axis=1).max() * 2 / len(rest))


@dataclass(frozen=True)
class RangeNoise:
    """Noise of a sensor that grows with the distance from its origin: sigma^2 = stated^2 + (slope distance)^2.

    `slope` and its standard uncertainty, m/m; p value of no growth.
    """

    sensor: str
    slope: float
    std: float
    p_value: float


def range_noise(linear: Linear, problem: Problem, scale: Scale) -> list[RangeNoise]:
    """Sensors whose residuals grow with distance: score test of the slope, one for each sensor of positions.

    Breusch and Pagan 1979: squares of standardised residuals against the squared distance over the stated variance.
    """
    shape = problem.readings.shape
    free = linear.freedom.reshape(shape)
    found = []
    for sensor in problem.model.sensors:
        places = [channel for channel, _ in sensor.places]
        rows = linear.on[:, places].all(axis=1) & (free[:, places] > _FREE).all(axis=1)
        if len(places) < 2 or rows.sum() < _FEWEST_ROWS:
            continue
        rest = linear.rest.reshape(shape)[rows][:, places]
        squares = (rest**2 / free[rows][:, places] / scale.variance).ravel()
        distance2 = (problem.readings[:, places][rows] ** 2).sum(axis=1)
        grown = (distance2[:, None] / (problem.sigma[:, places][rows] ** 2 * scale.variance)).ravel()
        level = grown - grown.mean()
        score = float(level @ np.minimum(squares, _LARGEST)) / np.sqrt(2 * float(level @ level) + 1e-300)
        if score > 0:
            found.append(RangeNoise(sensor.name, *_slope(squares, grown), float(ndtr(-score))))
    return found


def _slope(squares: Array, grown: Array) -> tuple[float, float]:
    """The likeliest slope and its standard uncertainty: squares (n,) of variance 1 + slope^2 grown."""

    def cost(slope: float) -> float:
        variance = 1 + slope**2 * grown
        return float((np.log(variance) + squares / variance).sum())

    most = 10 * float(np.sqrt(squares.mean() / np.median(grown)))
    slope = float(minimize_scalar(cost, bounds=(0.0, most), method="bounded", options={"xatol": 1e-6 * most}).x)
    information = 0.5 * float(((grown / (1 + slope**2 * grown)) ** 2).sum())  # of the slope's square
    return slope, 0.5 / (slope * np.sqrt(information)) if slope > 0 else float("inf")
