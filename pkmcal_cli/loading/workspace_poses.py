"""Poses all over the workspace of a machine, evenly spread and the same in every run."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from pkmcal_cli.base.errors import BadInput
from pkmcal_cli.base.even_points import even_points
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.loading.covariates import at_rest
from pkmcal_cli.loading.load_machine import LoadedMachine
from pkmcal_cli.loading.nearby_poses import rows_before
from pkmcal_cli.loading.poses import Poses, RowOrigin
from pkmcal_cli.loading.tool_coordinates import kept_note, tool_motion
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.tool_motion import DIRECTIONS
from pkmcal_cli.model.workspace import Workspace
from pkmcal_cli.prediction import Rows
from pkmcal_cli.prediction.inverse_kinematics import DrivePositions, drive_positions
from pkmcal_cli.prediction.rigid_pose import placed_tool_poses

_ROUNDS = 8
_TRIED = 8  # drawn in each round, for each that is wanted


def workspace_poses(loaded: LoadedMachine, workspace: Workspace, count: int) -> tuple[Poses, tuple[str, ...]]:
    """So many poses in the workspace, and what is said of them. Raises BadInput where none can be reached.

    Spread over the coordinates that box and cylinder limit, others as in the reference configuration; where they limit
    none, over the readings of the drives that are not redundant.
    """
    model, motion = loaded.model, tool_motion(loaded)
    low, high = workspace.bounds
    limited = [c for c, one, other in zip(DIRECTIONS, low, high, strict=True) if np.isfinite([one, other]).all()]
    held = motion.most_of([c for c in limited if c in motion.names])
    spread = [c for c in held if c in limited]
    ways = _by_coordinates(model, held, spread, low, high, count) if spread else _by_drives(loaded, workspace, count)
    parts: list[Array] = []
    for inverse in ways:
        inside = workspace.holds(inverse.poses, inverse.readings)
        parts = [*parts, inverse.readings[inside]]
        if sum(len(part) for part in parts) >= count:
            break
    readings = np.concatenate(parts)[:count]
    if not len(readings):
        raise out_of_workspace(loaded)
    rows = at_rest(model, replace(Rows.at(readings), partner=rows_before(model, len(readings))))
    kept = [c for c in held if c not in spread] if spread else []
    notes = (kept_note(kept),) if kept else ()
    return Poses(rows, np.ones(len(rows), dtype=bool), lambda row: RowOrigin(None, row + 1, "")), notes


def out_of_workspace(loaded: LoadedMachine) -> BadInput:
    """No pose of the workspace can be reached."""
    hint = "correct its limits or their units; the reference configuration is a pose that the machine reaches"
    message = "the machine reaches no pose of its workspace"
    return BadInput([loaded.machine.source.fault("workspace", message, ("workspace",), hint, at_key=True)])


def _by_coordinates(
    model: Model, held: tuple[str, ...], spread: list[str], low: Array, high: Array, count: int
) -> Iterator[DrivePositions]:
    """Poses at coordinates between their limits."""
    columns = [DIRECTIONS.index(c) for c in spread]
    for share in _shares(len(spread), count):
        poses = np.full((len(share), len(DIRECTIONS)), np.nan)
        poses[:, columns] = low[columns] + share * (high - low)[columns]
        yield drive_positions(model, poses, held=held)


def _by_drives(loaded: LoadedMachine, workspace: Workspace, count: int) -> Iterator[DrivePositions]:
    """Poses at readings of the drives that are not redundant, between their limits."""
    model = loaded.model
    placing = [a for a, d in enumerate(model.topology.drives) if not (d.redundant or d.force_controlled)]
    low, high = workspace.drives[placing].T
    if not np.isfinite(workspace.drives[placing]).all():
        message = "the workspace limits neither coordinates of the tool point nor all drives that are not redundant"
        hint = "add a `box` or a `cylinder`, or `limits` to the actuators"
        raise BadInput([loaded.machine.source.fault("workspace", message, ("workspace",), hint, at_key=True)])
    for share in _shares(len(placing), count):
        readings = np.tile(model.reference_readings, (len(share), 1))
        readings[:, placing] = low + share * (high - low)
        yield drive_positions(model, placed_tool_poses(model, readings))


def _shares(width: int, count: int) -> Iterator[Array]:
    """Points (n, width) that fill the unit cube evenly, a run of them after another."""
    size = _TRIED * count
    for first in range(1, _ROUNDS * size, size):
        yield even_points(size, width, first)
