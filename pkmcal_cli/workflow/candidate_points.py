"""Points that a plan may add: random poses within reach and workspace, each approached in a way that can be had."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.problem import Problem, design_problem
from pkmcal_cli.loading.load_machine import LoadedMachine
from pkmcal_cli.loading.pose_channels import known_channels, planned_channels
from pkmcal_cli.loading.workspace_poses import out_of_workspace
from pkmcal_cli.model.limits import drive_limits
from pkmcal_cli.model.tool_motion import DIRECTIONS
from pkmcal_cli.prediction import Request, Rows, predict
from pkmcal_cli.prediction.inverse_kinematics import drive_positions
from pkmcal_cli.prediction.touching import tcp_places, touching
from pkmcal_cli.workflow.approaches import Approaches, ApproachFrom, approaches, no_approach
from pkmcal_cli.workflow.tensioned_poses import tensioned, tensions_ropes
from pkmcal_cli.workflow.touched_poses import readings_at_touch

IntArray = NDArray[np.intp]

_ROUNDS = 10  # draws of candidate points, until there are enough in the workspace
_WIDER = 0.1  # by which share of the plan's box candidates may lie outside it


def candidate_points(
    loaded: LoadedMachine, problem: Problem, values: Array, size: int, seed: int, like: IntArray | None = None
) -> tuple[Problem, Approaches]:
    """Random points, and how they are approached. Raises BadInput where there is none.

    like: rows of the plan whose covariates they have, the session among them; all without.
    """
    model, rng = problem.model, np.random.default_rng(seed)
    poses, readings = _drawn(loaded, tcp_places(model, values, problem.rows), size, rng)
    some = rng.choice(np.arange(len(problem)) if like is None else like, len(readings))
    columns = {name: column[some] for name, column in problem.rows.columns.items()}
    rows = Rows(readings, np.full(readings.shape, np.nan), columns)
    if tensions_ropes(model) and len(poses):
        made = tensioned(model, values, poses, rows)
        poses, rows = (poses[made.kept], made.rows) if len(made.kept) else (poses, rows)
    touched = np.tile(known_channels(model) & problem.measured.all(axis=0), (len(rows), 1))  # at every pose of the plan
    rows, done = touching(model, values, rows, readings_at_touch(model, touched))
    if touched.any():
        poses = tcp_places(model, values, rows)
    towards = approaches(model, values, rows, poses, rng, ApproachFrom.of(model, values, rows, touched))
    rows = replace(rows, columns={**rows.columns, **towards.columns(model)})
    done[list(towards.refused)] = False
    good = np.nonzero(done & predict(model, values, rows, Request()).solved)[0]
    if towards.refused and not len(good):
        raise no_approach(model, towards.refused)
    channels = planned_channels(model, None, touched[good])
    return design_problem(model, rows.take(good), channels), towards.take(good)


def _drawn(loaded: LoadedMachine, places: Array, size: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Random poses (n, 6) in the workspace, and their drive readings (n, A). Raises BadInput where there is none.

    In coordinates that it does not limit, and where there is none: in the box of places (N, 6), and a little around it.
    """
    model, workspace = loaded.model, loaded.model.workspace
    places = places[np.isfinite(places).all(axis=1)]  # rows without a solution at these values are nowhere
    low, high = places.min(axis=0), places.max(axis=0)
    wide, held = _WIDER * (high - low), model.independent_coordinates
    low, high = low - wide, high + wide
    limits = drive_limits(model.actuators)
    if workspace is not None:
        ends = np.stack(workspace.bounds)
        limited = np.isfinite(ends).all(axis=0)
        low, high = np.where(limited, ends, [low, high])
        held = model.tool_motion.most_of([c for c, some in zip(DIRECTIONS, limited, strict=True) if some])
    parts_drawn: list[tuple[Array, Array]] = []
    for _ in range(_ROUNDS if workspace is not None else 1):
        drawn = rng.uniform(low, high, (size, len(DIRECTIONS)))
        drawn[:, [k for k, c in enumerate(DIRECTIONS) if c not in held]] = np.nan
        inverse = drive_positions(model, drawn, held=held)
        good = inverse.reached & ((inverse.readings >= limits[:, 0]) & (inverse.readings <= limits[:, 1])).all(axis=1)
        good &= True if workspace is None else workspace.holds(inverse.poses, inverse.readings)
        parts_drawn.append((inverse.poses[good], inverse.readings[good]))
        if sum(len(poses) for poses, _ in parts_drawn) >= size:
            break
    poses, readings = (np.concatenate(parts)[:size] for parts in zip(*parts_drawn, strict=True))
    if workspace is not None and not len(poses):
        raise out_of_workspace(loaded)
    return poses, readings
