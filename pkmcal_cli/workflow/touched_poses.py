"""Poses of a command moved to where probes touch, as the control does that moves until the probe triggers."""

from __future__ import annotations

import numpy as np

from pkmcal_cli.base.listener import Listener
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.loading.load_machine import LoadedMachine
from pkmcal_cli.loading.pose_channels import Channels, known_channels, touched_channels
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction.touching import touching
from pkmcal_cli.workflow.pose_set import PoseSet


def readings_at_touch(model: Model, touched: Channels) -> Array:
    """What probes read where they touch (N, C), SI; nan elsewhere."""
    return np.where(touched, [c.known for c in model.channels], np.nan)


def touching_poses(to: Listener, loaded: LoadedMachine, values: Array, poses: PoseSet) -> PoseSet:
    """Poses at whose commands probes touch, at parameter values (P,); those of a grid that do not are lost, and it is
    told that they were moved. Raises BadInput for such rows of a table.
    """
    model, used = loaded.model, poses.poses
    touched = touched_channels(model, loaded.machine, len(used), used.touched)
    moved, done = touching(model, values, used.rows, readings_at_touch(model, touched))
    lost = {int(k): no_touch(model, touched[k]) for k in np.nonzero(~done)[0]}
    touched_set = poses.with_readings(moved.readings, touched).without_points(lost)
    if not len(touched_set.kept):
        touched_set.failed.show(to)
    if count := int(touched[done].any(axis=1).sum()):
        to.notes([touches_text(model, count, len(touched))])
    return touched_set


def no_touch(model: Model, touched: Channels) -> str:
    """Why a row has no solution: probes of these channels (C,) are not reached."""
    names = ", ".join(f"`{model.channels[k].name}`" for k in np.nonzero(touched)[0])
    return f"{names} cannot be brought to touch from this pose"


def touches_text(model: Model, touched: int, rows: int) -> str:
    """That so many of the rows were moved until a probe touched."""
    names = [f"`{c.name}`" for c, known in zip(model.channels, known_channels(model), strict=True) if known]
    return f"{touched} of {rows} poses are moved to where {' or '.join(names)} touches"
