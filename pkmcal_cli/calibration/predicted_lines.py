"""Positioning along lines as a model predicts it: what the control commands by nominal parameters, what is attained."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.model.tool_channels import tcp_model
from pkmcal_cli.model.tool_motion import DIRECTIONS
from pkmcal_cli.prediction import Rows, predict
from pkmcal_cli.prediction.inverse_kinematics import drive_positions

_TARGETS = 21
_FEWEST = 5
_ROUNDING = 1e-12  # of the machine's size: less than that is not a deviation
_INSIDE = 0.05, 0.95  # quantiles of the measured coordinate between which a line lies


@dataclass(frozen=True)
class PredictedLine:
    """Deviations (m, 2) of a coordinate at targets (m,), m, from below and from above; other coordinates `others`."""

    coordinate: str
    others: tuple[tuple[str, float], ...]
    targets: Array
    deviations: Array

    @property
    def E(self) -> float:
        """Systematic deviation of both sides together, m (ISO 230-2:2014, 3.18, of a model)."""
        return float(np.ptp(self.deviations))

    @property
    def M(self) -> float:
        """Range of the mean of both sides, m."""
        return float(np.ptp(self.deviations.mean(axis=1)))

    @property
    def B(self) -> float:
        """Largest reversal, m."""
        return float(np.abs(self.deviations[:, 0] - self.deviations[:, 1]).max())


def predicted_lines(problem: Problem, values: Array, at_rest: Rows) -> list[PredictedLine]:
    """Lines along each coordinate through the middle of the measured region, at parameter values (P,).

    at_rest: one row with the conditions that effects need. Lines of which fewer than 5 of 21 targets can be reached are
    left out, and machines whose tool point no coordinates place by themselves.
    """
    places = {name: at for name, at in problem.nominal_poses.items() if name in "xyz"}
    lines = []
    for name, at in places.items():
        low, high = np.quantile(at, _INSIDE)
        poses = np.full((_TARGETS, len(DIRECTIONS)), np.nan)
        for other, coordinate in places.items():
            poses[:, DIRECTIONS.index(other)] = float(np.median(coordinate))
        poses[:, DIRECTIONS.index(name)] = np.linspace(low, high, _TARGETS)
        line = _line(problem, values, at_rest, poses, name)
        if high > low and line is not None:
            others = tuple((n, float(np.median(c))) for n, c in places.items() if n != name)
            lines.append(PredictedLine(name, others, *line))
    return lines


def _line(problem: Problem, values: Array, at_rest: Rows, poses: Array, name: str) -> tuple[Array, Array] | None:
    """Targets (m,) and deviations (m, 2); None where too few are reached."""
    model = tcp_model(problem.model)
    inverse = drive_positions(model, poses, model.nominal)
    readings = inverse.readings[inverse.reached]
    targets = poses[inverse.reached, DIRECTIONS.index(name)]
    if len(targets) < _FEWEST:
        return None
    ways = np.sign(np.gradient(readings, axis=0))
    channel = [c.name for c in model.channels].index(name)
    attained = []
    for side in (1, -1):
        columns = {key: np.full(len(targets), column[0]) for key, column in at_rest.columns.items()}
        columns |= {f"dir.{a.name}": side * ways[:, k] for k, a in enumerate(model.actuators)}
        rows = Rows(readings, np.repeat(at_rest.forces, len(targets), axis=0), columns)
        attained.append(predict(model, values, rows).values[:, channel])
    least = _ROUNDING * model.length
    deviations = np.round((np.column_stack(attained) - targets[:, None]) / least) * least
    known = np.isfinite(deviations).all(axis=1)
    return (targets[known], deviations[known]) if known.sum() >= _FEWEST else None
