"""What a fit saw: ranges of its rows, and what it left beyond noise."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.errors_before_after import ErrorFigures, kinds_of
from pkmcal_cli.calibration.expected_noise import fitted_noise
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.loading.evidence import TOOL, Evidence
from pkmcal_cli.model.tool_channels import tcp_model
from pkmcal_cli.prediction import predict

_CHANCE = 1.645  # standard deviations of a mean square, beyond which it is one of twenty
_LOGGED = {"T": "degC", "payload": "kg"}
_MANY = 10_000  # rows by which it is told where the tool point was
_SHOWN = {"length": "mm", "angle": "rad"}


def evidence_of(
    problem: Problem,
    fit: Fit,
    errors: Mapping[str, ErrorFigures],
    fitted: bool,
    noise: Mapping[str, float] | None = None,
) -> Evidence:
    """Of the rows that were used; errors: by kind, of the rows that were `fitted`, or of rows held out; noise: what
    makes these (`HeldOut.noise`), where it is known.
    """
    used: NDArray[np.bool_] = np.asarray(problem.measured.any(axis=1))
    rows, drives = problem.rows.readings[used], problem.model.actuators
    columns = {a.name: (rows[:, k], a.unit) for k, a in enumerate(drives)}
    for name, column in problem.rows.columns.items():
        kind = name.partition(".")[0]
        if kind in _LOGGED or kind == "dir":
            columns[name] = (np.asarray(column)[used], _LOGGED.get(kind, ""))
    columns |= {f"{TOOL}{axis}": (along, unit) for axis, along, unit in _tool_coordinates(problem, fit, used)}
    known = {n: (c[np.isfinite(c)], u) for n, (c, u) in columns.items()}
    ranges = {n: (float(c.min()), float(c.max())) for n, (c, _) in known.items() if len(c)}
    share = problem.unknowns(fit.selected) / max(int(problem.measured.sum()), 1)
    made = fitted_noise(problem, fit) if fitted else noise or {}
    left = _unexplained(problem, errors, made, max(1.0 - share, 0.0) if fitted else 1.0 + share)
    return Evidence(ranges, left, {n: u for n, (_, u) in columns.items()}, float(np.sqrt(fit.excess)))


def _tool_coordinates(
    problem: Problem, fit: Fit, used: NDArray[np.bool_]
) -> Iterator[tuple[str, Array, str]]:
    """Where the tool point was, m and rad, by coordinate, and the unit in which it is shown; of many rows some."""
    rows = np.nonzero(used)[0]
    rows = rows[:: max(len(rows) // _MANY, 1)]
    tool = tcp_model(problem.model)
    alone = replace(problem.rows.take(rows), partner=None, measured=None)
    values = predict(tool, fit.values, alone, start=fit.last.start.take(rows)).values
    for k, channel in enumerate(tool.channels):
        yield channel.name, values[:, k], _SHOWN[channel.dimension]


def _unexplained(
    problem: Problem, errors: Mapping[str, ErrorFigures], by_kind: Mapping[str, float], otherwise: float
) -> dict[str, float]:
    """Standard deviation, beyond noise, of one coordinate or length of each kind.

    by_kind: mean square of errors that noise makes over that of noise; `otherwise`: where that is not known. Nothing
    where noise by itself is as large in one of twenty tables. Errors of rows that were held out together depend on each
    other, the more the more the fit of the others adds to them, so that their mean scatters more; errors of fitted rows
    have only the freedom that the fit leaves.
    """
    out = {}
    for kind, columns in kinds_of(problem.model).items():
        figures = errors.get(kind)
        if figures is None or (figures.dimension != "length" and kind != "orientation"):
            continue
        on = problem.measured[:, columns]
        count = len(columns) if problem.model.channels[columns[0]].measurand.of_pose else 1
        made = max(by_kind.get(kind, otherwise), 1e-9)
        noise = made * _noise(problem.sigma[:, columns][on])
        variance = figures.rms**2 / count - noise
        scatter = np.sqrt(2.0 / max(int(on.sum()), 1)) * (made if made > 1.0 else made**-0.5)
        if variance > noise * _CHANCE * scatter:
            out[kind] = float(np.sqrt(variance))
    return out


def _noise(sigma: Array) -> float:
    """Mean variance of readings."""
    return float(np.nanmean(sigma**2)) if np.isfinite(sigma).any() else 0.0
