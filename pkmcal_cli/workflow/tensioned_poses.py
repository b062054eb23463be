"""Poses of the tool point at which redundant drives hold ropes, with set values at which all of these pull.

The inverse model has no strain: by it such ropes hang loose, and nobody measures there.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.listener import Listener
from pkmcal_cli.base.plural import count
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.correction.commands import OUT_OF_REACH, corrected
from pkmcal_cli.correction.set_values import Aim
from pkmcal_cli.loading.load_machine import LoadedMachine
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import Rows
from pkmcal_cli.workflow.pose_set import PoseSet

UNTENSIONED = "the set values strain nothing, so ropes may hang loose; state `t_min` of the ropes to tension them"
TENSIONED = "with set values of least forces at which ropes keep `t_min`"


@dataclass(frozen=True, kw_only=True)
class TensionedRows:
    """Those of some poses, by their numbers `kept` (n,), that have such set values; why others have none."""

    kept: NDArray[np.intp]
    rows: Rows
    lost: dict[int, str]


def holds_ropes(model: Model) -> bool:
    """Whether redundant drives that hold positions decide how ropes pull."""
    return bool(model.exact.ropes and model.redundant_drives)


def tensions_ropes(model: Model) -> bool:
    """Whether such drives do, and it is stated how much the ropes shall pull."""
    return holds_ropes(model) and bool(model.least_tensions)


def tensioned(model: Model, values: Array, poses: Array, rows: Rows) -> TensionedRows:
    """Rows with the set values of least force at poses (N, 6), at parameter values (P,); ropes keep their `t_min`."""
    made = corrected(model, values, Aim(poses=poses, held=model.independent_coordinates, rows=rows), "min-force")
    if made is None:
        none = np.zeros(0, dtype=np.intp)
        return TensionedRows(kept=none, rows=rows.take(none), lost=dict.fromkeys(range(len(rows)), OUT_OF_REACH))
    kept = made.kept[made.good]
    good = replace(rows.take(kept), readings=made.rows.readings[made.good])
    return TensionedRows(kept=kept, rows=good, lost=made.failed)


def tensioned_poses(to: Listener, loaded: LoadedMachine, values: Array, poses: PoseSet) -> PoseSet:
    """Poses of the tool point where ropes state `t_min`, tensioned; those of a grid at which that cannot be are lost.

    Rows of set values stay as they are. Raises BadInput for rows of a table that cannot be tensioned.
    """
    model, used = loaded.model, poses.poses
    if used.targets is None or not holds_ropes(model):
        return poses
    posed = np.nonzero(np.isfinite(used.targets).all(axis=1))[0]
    if not len(posed):
        return poses
    if not tensions_ropes(model):
        to.notes([UNTENSIONED])
        return poses
    made = tensioned(model, values, used.targets[posed], used.rows.take(posed))
    readings = used.rows.readings.copy()
    readings[posed[made.kept]] = made.rows.readings
    left = poses.with_readings(readings).without_points({int(posed[k]): why for k, why in made.lost.items()})
    if not len(left.kept):
        left.failed.show(to)
    to.notes([f"{count(len(made.kept), 'pose')} {TENSIONED}"])
    return left
