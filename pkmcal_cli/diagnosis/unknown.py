"""Is something left that is in no catalogue? Smooth groups, oscillations, runs in time, and bad rows side by side."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.diagnosis.groups import group_columns
from pkmcal_cli.diagnosis.linear import Linear
from pkmcal_cli.diagnosis.noise_tests import independent, successive, without_odd_row
from pkmcal_cli.diagnosis.scale import Scale

_LARGEST = 2.5  # root mean squares
TESTS = 10  # groups, oscillations, runs, clusters, local effects and range noise share the false-alarm rate


@dataclass(frozen=True)
class Unknown:
    """Something that depends on `depends_on` and is no effect of the catalogue; `rms` in standard uncertainties.

    `hint`: more in words, such as the period of an oscillation; `replaces`: accepted effects that it explains better;
    `row`: the first one after a step in time.
    """

    depends_on: str
    p_value: float
    rms: float
    hint: str = ""
    replaces: tuple[str, ...] = ()
    row: int | None = None


def unknown_effects(
    linear: Linear, problem: Problem, scale: Scale, alpha: float, bad: tuple[int, ...]
) -> list[Unknown]:
    """What is significant at `alpha` altogether, and not by one odd row alone."""
    linear = without_odd_row(linear)
    runs, linear = _runs(linear, problem), independent(linear, problem)
    groups = [*_groups(linear, problem, scale), *_oscillations(linear, problem, scale), *runs]
    return [u for u in groups if u.p_value < alpha / TESTS] + _clustered(problem, bad, alpha / TESTS)


def _groups(linear: Linear, problem: Problem, scale: Scale) -> list[Unknown]:
    """Smooth groups, each against all the rest."""
    out = []
    for name, columns in group_columns(problem).items():
        statistic, count = linear.explained(linear.whitened(columns))
        p = float(scale.p_value(np.array([statistic]), np.array([count]))[0])
        out.append(Unknown(name, p, _excess(statistic, count, scale, linear)))
    return out


def _excess(statistic: float, count: int, scale: Scale, linear: Linear) -> float:
    """Root mean square of what is explained beyond noise, in stated standard uncertainties."""
    return float(np.sqrt(max(statistic - count * scale.variance, 0.0) / linear.used))


def _oscillations(linear: Linear, problem: Problem, scale: Scale) -> list[Unknown]:
    """Periodograms along time and along each drive."""
    drives = [(a.name, q) for a, q in zip(problem.model.actuators, problem.rows.readings.T, strict=True)]
    axes = [("position", f"along {name}", q) for name, q in drives if np.ptp(q) > 0 and not np.isnan(q).any()]
    time = problem.rows.columns.get("time")
    if time is not None and np.isfinite(time).all() and np.ptp(time) > 0:
        axes.append(("time", "in time", time))
    return [
        u
        for name, words, x in axes
        if (u := _periodogram(linear, problem, scale, x=x, depends_on=name, words=words, axes=len(axes)))
    ]


def _periodogram(
    linear: Linear, problem: Problem, scale: Scale, x: Array, depends_on: str, words: str, axes: int
) -> Unknown | None:
    """The strongest oscillation along x (N,), its p value corrected for all frequencies and axes."""
    rows, channels = problem.readings.shape
    residual = (linear.unexplained / np.sqrt(scale.variance)).reshape(rows, channels)
    most = _LARGEST * float(np.sqrt((residual**2).mean()))  # more than that is an odd value, and no oscillation
    residual = np.clip(residual, -most, most)
    spread = float(np.ptp(x))
    cycles = np.arange(3.0, rows / 2.0, 0.5)
    if not len(cycles):
        return None
    phase = 2 * np.pi * np.outer(cycles, (x - x.min()) / spread)
    power = (np.abs(np.exp(1j * phase) @ residual) ** 2).sum(axis=1) * 2 / rows / (linear.freedom.sum() / linear.used)
    best = int(np.argmax(power))
    count = 2 * channels
    single = float(Scale(1.0, scale.dof).p_value(np.array(power[best]), np.array(count)))
    p = float(-np.expm1(len(cycles) * axes * np.log1p(-min(single, 0.5))))
    size = float(np.sqrt(max(power[best] - count, 0.0) * scale.variance / linear.used))
    return Unknown(depends_on, p, size, f"oscillation {words}, {cycles[best]:g} periods over its range")


def _runs(linear: Linear, problem: Problem) -> list[Unknown]:
    """Correlation of successive rows, in the order of time."""
    share, p = successive(linear, problem)
    if share <= 0:
        return []
    size = float(np.sqrt((linear.unexplained**2).mean() * share))
    return [Unknown("time", p, size, f"successive rows are correlated ({share:.2f})")]


def _clustered(problem: Problem, bad: tuple[int, ...], alpha: float) -> list[Unknown]:
    """Bad rows that lie side by side along a drive or in time: a local effect, no outliers."""
    if len(bad) < 3:
        return []
    out = []
    drives = zip(problem.model.actuators, problem.rows.readings.T, strict=True)
    axes = [(f"position of {a.name}", q) for a, q in drives if not np.isnan(q).any()]
    if "time" in problem.rows.columns:
        axes.append(("time", problem.rows.columns["time"]))
    for name, x in axes:
        rank = np.argsort(np.argsort(x, kind="stable"))[list(bad)]
        p = _nearness(np.sort(rank), len(problem)) * len(axes)
        if p < alpha:
            where = "time" if name == "time" else "pose"
            out.append(Unknown(where, p, float("nan"), f"bad rows cluster in {name}"))
    return out[:1]


def _nearness(ranks: NDArray[np.intp], rows: int) -> float:
    """Chance that k random ranks out of `rows` lie within as short a stretch."""
    k, width = len(ranks), int(ranks[-1] - ranks[0]) + 1
    share = width / rows
    return float(min(k * share ** (k - 1), 1.0))
