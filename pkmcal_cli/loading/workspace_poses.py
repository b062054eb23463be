"""Poses all over the workspace of a machine, evenly spread and the same in every run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pkmcal_cli.base.errors import BadInput
from pkmcal_cli.base.even_points import even_points
from pkmcal_cli.base.listener import Listener
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.language.tool_point import tool_point_of
from pkmcal_cli.loading.covariates import at_rest
from pkmcal_cli.loading.load_machine import LoadedMachine
from pkmcal_cli.loading.nearby_poses import rows_before
from pkmcal_cli.loading.poses import Poses, RowOrigin
from pkmcal_cli.loading.tool_coordinates import kept_note, tool_motion
from pkmcal_cli.model.limits import drive_limits
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.tool_motion import DIRECTIONS
from pkmcal_cli.model.workspace import Workspace
from pkmcal_cli.prediction import Rows
from pkmcal_cli.prediction.inverse_kinematics import DrivePositions, drive_positions
from pkmcal_cli.prediction.rigid_pose import placed_tool_poses

_OF_LIMITS = "the machine file has no `workspace`: poses are spread between the `limits` of the drives"
_TRIED = 64  # drawn at most, for each that is wanted
_FEWEST, _TOGETHER = 64, 512  # drawn at once


@dataclass(frozen=True, kw_only=True)
class WorkspacePoints:
    """Poses (N, 6) of the tool point in the workspace and readings (N, A) of the drives there.

    held: coordinates that the drives were asked for; spread: those of them that fill the workspace, none where the
    readings of drives do; others are as in the reference configuration. tried, lost: readings that were, and those of
    them that are out of reach; declared: whether the machine file has a workspace.
    """

    poses: Array
    readings: Array
    held: tuple[str, ...]
    spread: tuple[str, ...]
    tried: int
    lost: int
    declared: bool

    @property
    def notes(self) -> tuple[str, ...]:
        """Which coordinates are kept, or where readings lie and how many are out of reach."""
        if self.spread:
            kept = [c for c in self.held if c not in self.spread]
            return (kept_note(kept),) if kept else ()
        where = [] if self.declared else [_OF_LIMITS]
        where += [f"{self.lost} of {self.tried} drive positions tried are out of reach"] if self.lost else []
        return ("; ".join(where),) if where else ()


def usable_workspace(loaded: LoadedMachine) -> Workspace | None:
    """The declared workspace, else what the limits of the drives leave.

    None without either, and where no tool point shows what they leave.
    """
    model = loaded.model
    if model.workspace is not None:
        return model.workspace
    motion = model.tool_motion
    shown = tool_point_of(loaded.machine) is not None and motion.shown == motion.freedoms
    if not shown or not _placing(model) or unlimited_drives(model):
        return None
    return Workspace.of_drives(drive_limits(model.actuators))


def unlimited_drives(model: Model) -> tuple[str, ...]:
    """Names of the drives that are not redundant and have no limits."""
    placing = [model.actuators[a] for a in _placing(model)]
    return tuple(a.name for a in placing if not np.isfinite(a.limits).all())


def workspace_remedy(loaded: LoadedMachine) -> str:
    """How a machine gets a workspace."""
    names = unlimited_drives(loaded.model)
    limits = f", or `limits` to {', '.join(names)}" if names else ""
    return f"add `workspace:` to the machine file{limits}"


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
    ends = {c: np.array([b[DIRECTIONS.index(c)] for b in (low, high)]) for c in spread}
    if not spread:
        _check_drives(loaded, workspace)
    poses, readings, tried, reached = np.zeros((0, len(DIRECTIONS))), np.zeros((0, len(model.actuators))), 0, 0
    with to.progress("pose", count) as tick:
        for share in _shares(len(spread) or len(_placing(model)), count):
            inverse = _at_coordinates(model, held, ends, share) if ends else _at_drives(model, workspace, share)
            inside = workspace.holds(inverse.poses, inverse.readings)
            tried, reached = tried + len(share), reached + int(inside.sum())
            tick(min(int(inside.sum()), count - len(readings)))
            poses, readings = np.vstack([poses, inverse.poses[inside]]), np.vstack([readings, inverse.readings[inside]])
            if len(readings) >= count:
                break
    if not len(readings):
        raise out_of_workspace(loaded)
    return WorkspacePoints(
        poses=poses[:count], readings=readings[:count], held=held, spread=spread, tried=tried, lost=tried - reached,
        declared=loaded.machine.workspace is not None,
    )  # fmt: skip


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
    if loaded.machine.workspace is None:
        message = "the machine reaches no pose between the `limits` of its drives"
        return BadInput([loaded.machine.source.fault("workspace", message, ("actuators",), hint, at_key=True)])
    message = "the machine reaches no pose of its workspace"
    return BadInput([loaded.machine.source.fault("workspace", message, ("workspace",), hint, at_key=True)])


def _check_drives(loaded: LoadedMachine, workspace: Workspace) -> None:
    """Whether a workspace without limits of coordinates limits all drives that place the tool. Raises BadInput."""
    if not np.isfinite(workspace.drives[_placing(loaded.model)]).all():
        message = "the workspace limits neither coordinates of the tool point nor all drives that are not redundant"
        hint = "add a `box` or a `cylinder`, or `limits` to the actuators"
        raise BadInput([loaded.machine.source.fault("workspace", message, ("workspace",), hint, at_key=True)])


def _placing(model: Model) -> list[int]:
    """Drives that place the tool: those that hold a position and are not redundant."""
    return [a for a, d in enumerate(model.topology.drives) if not (d.redundant or d.force_controlled)]


def _at_coordinates(model: Model, held: Sequence[str], ends: Mapping[str, Array], share: Array) -> DrivePositions:
    """Poses at shares (n, w) of the way between the ends of coordinates, `held` at them."""
    poses = np.full((len(share), len(DIRECTIONS)), np.nan)
    low, high = np.array(list(ends.values())).T
    poses[:, [DIRECTIONS.index(c) for c in ends]] = low + share * (high - low)
    return drive_positions(model, poses, held=tuple(held))


def _at_drives(model: Model, workspace: Workspace, share: Array) -> DrivePositions:
    """Poses at shares (n, w) of the travel of the drives that place the tool; only those that there are."""
    placing = _placing(model)
    low, high = workspace.drives[placing].T
    readings = np.tile(model.reference_readings, (len(share), 1))
    readings[:, placing] = low + share * (high - low)
    return drive_positions(model, placed_tool_poses(model, readings))


def _shares(width: int, count: int) -> Iterator[Array]:
    """Points (n, width) that fill the unit cube evenly, a run of them after another."""
    size = min(max(count + count // 4, _FEWEST), _TOGETHER)
    for first in range(1, _TRIED * count + 1, size):
        yield even_points(size, width, first)
