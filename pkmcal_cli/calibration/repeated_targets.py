"""Which rows of a table are repeats of targets, by the side of approach, as acceptance standards want them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.holdout import replicate_groups
from pkmcal_cli.calibration.positioning_accuracy import (
    FEWEST_APPROACHES,
    FEWEST_CYCLES,
    FEWEST_TARGETS,
    AxisAccuracy,
    PoseAccuracy,
    axis_accuracy,
    pose_accuracy,
)
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import Evaluation
from pkmcal_cli.calibration.same_poses import poses_alike
from pkmcal_cli.model.commanded import forced
from pkmcal_cli.units.measurands import Measurand

_LINE = 1e-3  # share of the workspace by which targets of one line may lie beside it
_ROUND = 0.02  # spread of the radius below which targets lie on a circle
_FEWEST_ON_CIRCLE = 12


@dataclass(frozen=True)
class AxisRun:
    """Targets along one coordinate, m, where the others stay at `others`; figures by ISO 230-2."""

    coordinate: str
    others: tuple[tuple[str, float], ...]
    figures: AxisAccuracy


@dataclass(frozen=True)
class PoseRun:
    """One target, m by coordinate, approached again and again from one side; figures by ISO 9283."""

    at: tuple[tuple[str, float], ...]
    figures: PoseAccuracy


@dataclass(frozen=True)
class MeasuredTargets:
    """Positions (n, d) that were commanded and their errors (n, d), m, of the first point measured, in rows (n,).

    `names` (d,) of the coordinates; `group` (n,): number of the target; `side` (n, d): of approach along each
    coordinate (1 from below, -1 from above, 0 unknown).
    """

    names: tuple[str, ...]
    rows: NDArray[np.intp]
    commanded: Array
    errors: Array
    group: NDArray[np.intp]
    side: NDArray[np.intp]


def measured_targets(problem: Problem, commanded: Evaluation) -> MeasuredTargets | None:
    """Targets of a table; `commanded`: predicted as the control believes. None where no position was measured whole."""
    model = problem.model
    positions = model.measuring(Measurand.POSITION)
    first = [k for k in positions if model.channels[k].index == model.channels[positions[0]].index]
    if not first:
        return None
    channels = np.array(first, dtype=np.intp)
    rows = np.nonzero(problem.measured[:, first].all(axis=1) & np.isfinite(commanded.residual[:, first]).all(axis=1))[0]
    if not len(rows):
        return None
    errors = commanded.residual[np.ix_(rows, channels)]
    return MeasuredTargets(
        names=tuple("xyz"[model.channels[k].component] for k in first),
        rows=rows,
        commanded=problem.readings[np.ix_(rows, channels)] - errors,
        errors=errors,
        group=replicate_groups(problem)[rows],
        side=_sides(problem, commanded, first)[rows],
    )


def _sides(problem: Problem, commanded: Evaluation, channels: list[int]) -> NDArray[np.intp]:
    """Side of approach (N, d) along each coordinate: where the drives' last moves took the point to."""
    by_drive, columns = commanded.prediction.by_drive, problem.rows.columns
    names = [f"dir.{a.name}" for a in problem.model.actuators]
    if by_drive is None or not all(n in columns for n in names):
        return np.zeros((len(problem), len(channels)), dtype=np.intp)
    last = np.column_stack([np.nan_to_num(columns[n]) for n in names])
    last = np.where(forced(problem.model), 0.0, last)  # they follow the others
    moved = np.einsum("nca,na->nc", np.nan_to_num(by_drive)[:, channels], last)
    return np.asarray(np.sign(moved), dtype=np.intp)


def axis_runs(targets: MeasuredTargets) -> list[AxisRun]:
    """Lines of targets along coordinates with enough approaches from both sides for ISO 230-2."""
    number, first = np.unique(targets.group, return_index=True)
    target_pose = targets.commanded[first]  # (t, d) of the targets
    runs = []
    for k, name in enumerate(targets.names):
        others = [j for j in range(len(targets.names)) if j != k]
        span = max(float(np.ptp(target_pose, axis=0).max()), 1e-12)
        line = np.zeros(len(target_pose), dtype=np.intp)
        if others:
            line = poses_alike(np.vstack([target_pose[:, others], target_pose[:1, others] + span]), _LINE)[:-1]
        for one in np.unique(line):
            run = _run(targets, k, number[line == one])
            if run is not None:
                at = target_pose[line == one][:, others].mean(axis=0)
                runs.append(AxisRun(name, tuple((targets.names[j], float(v)) for j, v in zip(others, at)), run))
    return runs


def _run(targets: MeasuredTargets, k: int, groups: NDArray[np.intp]) -> AxisAccuracy | None:
    """Figures along coordinate k of those targets that were approached often enough; None for too few."""
    positions = []
    for g in groups:
        rows = targets.group == g
        sides = tuple(targets.errors[rows & (targets.side[:, k] == s), k] for s in (1, -1))
        if min(len(s) for s in sides) >= FEWEST_APPROACHES:
            positions.append((float(targets.commanded[rows, k].mean()), sides))
    if len(positions) < FEWEST_TARGETS:
        return None
    positions.sort(key=lambda f: f[0])
    return axis_accuracy(np.array([t for t, _ in positions]), tuple((s[0], s[1]) for _, s in positions))


def pose_runs(targets: MeasuredTargets) -> list[PoseRun]:
    """Targets that were attained often enough from one side for ISO 9283."""
    runs = []
    for g in np.unique(targets.group):
        rows = np.nonzero(targets.group == g)[0]
        _, side, counts = np.unique(targets.side[rows], axis=0, return_inverse=True, return_counts=True)
        rows = rows[side.ravel() == int(np.argmax(counts))]
        if len(rows) >= FEWEST_CYCLES:
            attained = targets.commanded[rows] + targets.errors[rows]
            middle = targets.commanded[rows].mean(axis=0)
            at = tuple((n, float(v)) for n, v in zip(targets.names, middle))
            runs.append(PoseRun(at, pose_accuracy(attained, middle)))
    return runs


def circular(targets: MeasuredTargets) -> tuple[Array, float] | None:
    """Measured path (n, 2), m, and the radius commanded, m, where the targets lie on a circle of the x, y plane."""
    if len(targets.names) < 2:
        return None
    at = targets.commanded[:, :2]
    middle = 0.5 * (at.min(axis=0) + at.max(axis=0))
    radius = np.linalg.norm(at - middle, axis=1)
    if len(at) < _FEWEST_ON_CIRCLE or not radius.mean() > 0 or radius.std() > _ROUND * radius.mean():
        return None
    return at + targets.errors[:, :2], float(radius.mean())
