"""Poses all over the workspace of a machine, evenly spread and the same in every run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pkmcal_cli.base.errors import BadInput
from pkmcal_cli.base.even_points import even_points
from pkmcal_cli.base.listener import Listener
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

_TRIED = 64  # drawn at most, for each that is wanted
_FEWEST, _TOGETHER = 64, 512  # drawn at once


@dataclass(frozen=True, kw_only=True)
class WorkspacePoints:
    """Poses (N, 6) of the tool point in the workspace and readings (N, A) of the drives there.

    held: coordinates that the drives were asked for; spread: those of them that fill the workspace, none where the
    readings of drives do; others are as in the reference configuration.
    """

    poses: Array
    readings: Array
    held: tuple[str, ...]
    spread: tuple[str, ...]

    @property
    def notes(self) -> tuple[str, ...]:
        """Which coordinates are kept."""
        kept = [c for c in self.held if c not in self.spread] if self.spread else []
        return (kept_note(kept),) if kept else ()


def workspace_points(loaded: LoadedMachine, workspace: Workspace, count: int, to: Listener) -> WorkspacePoints:
    """So many points in the workspace, fewer where few of those tried are. Raises BadInput where none can be reached.

    Spread over the coordinates that box and cylinder limit, others as in the reference configuration; where they limit
    none, over the readings of the drives that are not redundant.
    """
    model, motion = loaded.model, tool_motion(loaded)
    low, high = workspace.bounds
    limited = [c for c, one, other in zip(DIRECTIONS, low, high, strict=True) if np.isfinite([one, other]).all()]
    held = motion.most_of([c for c in limited if c in motion.names])
    spread = tuple(c for c in held if c in limited)
    ways = _by_coordinates(model, held, spread, low, high, count) if spread else _by_drives(loaded, workspace, count)
    poses, readings = np.zeros((0, len(DIRECTIONS))), np.zeros((0, len(model.actuators)))
    with to.progress("pose", count) as tick:
        for inverse in ways:
            inside = workspace.holds(inverse.poses, inverse.readings)
            tick(min(int(inside.sum()), count - len(readings)))
            poses, readings = np.vstack([poses, inverse.poses[inside]]), np.vstack([readings, inverse.readings[inside]])
            if len(readings) >= count:
                break
    if not len(readings):
        raise out_of_workspace(loaded)
    return WorkspacePoints(poses=poses[:count], readings=readings[:count], held=held, spread=spread)


def workspace_poses(
    loaded: LoadedMachine, workspace: Workspace, count: int, to: Listener
) -> tuple[Poses, tuple[str, ...]]:
    """The same as poses of a machine at rest, and what is said of them. Raises BadInput where none can be reached."""
    model, points = loaded.model, workspace_points(loaded, workspace, count, to)
    at = replace(Rows.at(points.readings), partner=rows_before(model, len(points.readings)))
    rows = at_rest(model, at)
    point = lambda row: RowOrigin(None, row + 1, "")  # noqa: E731
    reachable = np.ones(len(rows), dtype=bool)
    return Poses(rows=rows, reachable=reachable, row_origin=point, targets=points.poses), points.notes


def out_of_workspace(loaded: LoadedMachine) -> BadInput:
    """No pose of the workspace can be reached."""
    hint = "correct its limits or their units; the reference configuration is a pose that the machine reaches"
    message = "the machine reaches no pose of its workspace"
    return BadInput([loaded.machine.source.fault("workspace", message, ("workspace",), hint, at_key=True)])


def _by_coordinates(
    model: Model, held: tuple[str, ...], spread: Sequence[str], low: Array, high: Array, count: int
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
    size = min(max(count + count // 4, _FEWEST), _TOGETHER)
    for first in range(1, _TRIED * count + 1, size):
        yield even_points(size, width, first)
