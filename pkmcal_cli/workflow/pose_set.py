"""The poses of an analysis or plan: all those of a table, those of a grid or of the workspace that can be used."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.listener import Listener
from pkmcal_cli.base.plural import count
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.language.tool_point import ToolPoint
from pkmcal_cli.loading.covariates import resting
from pkmcal_cli.loading.load_machine import LoadedMachine
from pkmcal_cli.loading.pose_channels import Channels
from pkmcal_cli.loading.pose_source import PoseSource
from pkmcal_cli.loading.poses import Poses, failed_rows, reference_poses
from pkmcal_cli.loading.tool_coordinates import required_tool_point
from pkmcal_cli.loading.unstated_forces import unstated_forces
from pkmcal_cli.loading.workspace_poses import usable_workspace, workspace_poses
from pkmcal_cli.report.failed_rows import GRID_POINT, FailedRows, SkippedPoints

_SPREAD = 50  # poses over the workspace


@dataclass(frozen=True, kw_only=True)
class PoseSet:
    """Poses that are used, out of all; `tool`: the tool point, where they are poses of it.

    kept (n,): numbers of those that are used; lost: why the others cannot be used, by their numbers.
    """

    every: Poses
    kept: NDArray[np.intp]
    skipping: str = ""  # what poses are called that may fail; "" where all count
    tool: ToolPoint | None = None
    inputs: dict[str, str] = field(default_factory=dict)
    lost: Mapping[int, str] = field(default_factory=dict)

    @property
    def poses(self) -> Poses:
        """Those that are used."""
        return self.every.take(self.kept) if self.lost else self.every

    @property
    def failed(self) -> FailedRows:
        """Those that are not."""
        if self.skipping:
            return SkippedPoints(self.lost, self.every.row_origin, len(self.every), self.skipping)
        return FailedRows(self.lost, self.every.row_origin, len(self.every))

    def with_readings(self, readings: Array, touched: Channels | None = None) -> PoseSet:
        """The set with other drive readings (n, A) of the poses that are used, and probes that touch there (n, C)."""
        every = self.every.rows.readings.copy()
        every[self.kept] = readings
        touches = self.every.touched
        if touched is not None:
            touches = np.zeros((len(self.every), touched.shape[1]), dtype=bool)
            touches[self.kept] = touched
        rows = replace(self.every.rows, readings=every)
        return replace(self, every=replace(self.every, rows=rows, touched=touches))

    def without(self, reasons: Mapping[int, str]) -> PoseSet:
        """The set without some of the poses that are used, by their number among these."""
        lost = {int(self.kept[k]): why for k, why in reasons.items()}
        return replace(self, kept=np.delete(self.kept, list(reasons)), lost={**self.lost, **lost})

    def without_points(self, reasons: Mapping[int, str]) -> PoseSet:
        """The same where poses may fail. Raises BadInput for rows of a table, all of which count."""
        if reasons and not self.skipping:
            raise failed_rows(self.poses.row_origin, dict(reasons), len(self.poses))
        return self.without(reasons)


def pose_set(to: Listener, loaded: LoadedMachine, path: str | None, grid: str | None) -> PoseSet:
    """All poses of a table or grid, without either some all over the workspace.

    Raises BadInput with rows of a table that are out of reach, UsageError where nothing says which poses.
    """
    if path is None and grid is None and usable_workspace(loaded) is not None:
        return default_poses(to, loaded)
    source = PoseSource(loaded=loaded, to=to, path=path, grid=grid)
    poses = source.together()
    to.notes(source.notes)
    for text in source.travel_limits.warnings():
        to.warn(text)
    kept = np.nonzero(poses.reachable)[0]
    skipping = GRID_POINT if grid is not None else ""
    solved = PoseSet(every=poses, kept=kept, skipping=skipping, tool=source.tool, inputs=source.inputs, lost=poses.lost)
    if not len(kept):
        solved.failed.show(to)
    return solved


def default_poses(to: Listener, loaded: LoadedMachine) -> PoseSet:
    """Poses where none are given: spread over the workspace, else the reference configuration alone."""
    model = loaded.model
    at_reference = [*([note] if (note := resting(model)) else []), *unstated_forces(loaded.machine)]
    if (workspace := usable_workspace(loaded)) is not None:
        poses, notes = workspace_poses(loaded, workspace, _SPREAD, to)
        tool = required_tool_point(loaded)
        summary = f"no poses given: {count(len(poses), 'pose')} spread over the workspace"
        to.notes([summary, tool.text, *notes, *at_reference])
        return PoseSet(every=poses, kept=np.arange(len(poses)), skipping="pose", tool=tool)
    to.notes(["no poses given: only the reference configuration is used", *at_reference])
    return PoseSet(every=reference_poses(model), kept=np.zeros(1, dtype=np.intp))
