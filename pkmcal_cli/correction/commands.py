"""From targets to commands: within reach, and from the side from which the commands themselves approach.

Backlash follows the direction of the last motion, and this follows the commands: where corrections turn a drive round,
the search is repeated with the sides of its own result.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.correction.internal_force import InternalForces
from pkmcal_cli.correction.redundancy import Choice
from pkmcal_cli.correction.set_values import Aim, SetValues, set_values
from pkmcal_cli.correction.strained_pose import LoadedTool, StrainedPose
from pkmcal_cli.loading.covariates import with_sides
from pkmcal_cli.mechanism.topology import Index
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.tool_motion import DIRECTIONS
from pkmcal_cli.prediction import Rows
from pkmcal_cli.prediction.inverse_kinematics import DrivePositions, drive_positions
from pkmcal_cli.prediction.unknown_sides import sided_drives

OUT_OF_REACH = "out of reach: no set values for this pose of the tool point"
_ROUNDS = 4
_UPWARDS = 0.1  # of the way from the next target


@dataclass(frozen=True, kw_only=True)
class Correction:
    """Of the targets `kept` (n,) that are within reach: rows with commands; the machine before and after.

    aim: with the set values of the nominal machine, at which the machine is `before`, nan where there are none;
    internal: of the forces after; failed: why targets have no commands, by their numbers among all; turned (n,):
    whether a row is approached from another side than that for which it was corrected.
    """

    kept: Index
    aim: Aim
    rows: Rows
    before: StrainedPose
    after: StrainedPose
    internal: InternalForces
    failed: dict[int, str]
    turned: NDArray[np.bool_]

    @property
    def good(self) -> Index:
        """Numbers of the rows that have commands, among those kept."""
        return np.array([n for n, k in enumerate(self.kept) if int(k) not in self.failed], dtype=np.intp)


def corrected(model: Model, values: Array, aim: Aim, choice: Choice) -> Correction | None:
    """Commands for the poses of `aim`, whose rows have no readings yet; None where no target is within reach."""
    strainless = drive_positions(model, aim.poses, values, aim.held, rows=aim.rows, derivatives=True)
    nominal = drive_positions(model, aim.poses, None, aim.held)
    kept = np.nonzero(strainless.reached)[0]
    if not len(kept):
        return None
    kept_aim, strainless = aim.take(kept), strainless.take(kept)
    commands = np.where(nominal.reached[kept, None], nominal.readings[kept], strainless.readings)
    kept_rows = replace(kept_aim.rows, readings=commands)
    kept_aim = replace(kept_aim, rows=_directed(model, kept_rows))
    before = LoadedTool(model, aim.held).at(values, kept_aim.rows, kept_aim.targets)
    before = before.without(np.nonzero(~nominal.reached[kept])[0])
    solution, turned = _from_own_sides(model, values, kept_aim, kept_rows.columns, strainless, choice)
    failed = {int(k): OUT_OF_REACH for k in np.setdiff1d(np.arange(len(aim.rows)), kept)}
    failed |= {int(kept[k]): why for k, why in solution.failed.items()}
    return Correction(
        kept=kept, aim=kept_aim, rows=solution.rows, before=before, after=solution.after, internal=solution.internal,
        failed=dict(sorted(failed.items())), turned=turned,
    )  # fmt: skip


def depends_on_sides(model: Model) -> bool:
    """Whether the machine has an effect that depends on the side from which a drive is approached."""
    return any("direction" in e.effect.needs for e in model.effects if e.sites)


def with_first_sides(model: Model, values: Array, aim: Aim) -> Rows:
    """The rows of an aim with sides for a program that itself sees to it from where its first target is approached.

    As if it came from the next target, and all coordinates a little upwards: no drive stands, and one move of the tool
    has all sides. Sides that are stated stay.
    """
    at = drive_positions(model, aim.poses, values, aim.held, rows=aim.rows, derivatives=True)
    assert at.by_pose is not None
    held = [DIRECTIONS.index(c) for c in aim.held]
    size = np.where([c in DIRECTIONS[:3] for c in aim.held], model.length, 1.0)
    here = aim.poses[:, held] / size
    step = here - np.vstack([here[1:], here[-1:]])
    length = np.sqrt((step**2).sum(axis=1, keepdims=True))
    way = step / np.where(length > 0, length, 1.0) + _UPWARDS / (1.0 + np.arange(len(held)))
    sides = np.sign((np.nan_to_num(at.by_pose) @ (way * size)[..., None])[..., 0])
    derived, columns = _directed(model, replace(aim.rows, readings=at.readings)).columns, dict(aim.rows.columns)
    for a in sided_drives(model):
        name = f"dir.{model.actuators[a].name}"
        stated = columns.get(name, np.full(len(aim.rows), np.nan))
        columns[name] = np.where(np.isnan(stated) & (derived[name] == 0), sides[:, a], stated)
    return replace(aim.rows, columns=columns)


def _from_own_sides(
    model: Model, values: Array, aim: Aim, columns: Mapping[str, Array], strainless: DrivePositions, choice: Choice
) -> tuple[SetValues, NDArray[np.bool_]]:
    """Set values, and which rows (n,) they approach from another side, or from none; `columns`: columns that stay."""
    solution = set_values(model, values, aim, strainless, choice)
    if not depends_on_sides(model):
        return solution, np.zeros(len(aim.rows), dtype=bool)
    for left in reversed(range(_ROUNDS)):
        directed = _directed(model, replace(solution.rows, columns=columns))
        turned = _differ(solution.rows, directed)
        if not (turned.any() and left):
            break
        nominal = replace(directed, readings=aim.rows.readings)
        solution = set_values(model, values, replace(aim, rows=nominal), strainless, choice)
    return solution, turned | _without_side(model, solution.rows)


def _without_side(model: Model, rows: Rows) -> NDArray[np.bool_]:
    """Rows (n,) in which a drive whose side counts is approached from none: the first one, unless a side is stated."""
    names = [model.actuators[a].name for a in sided_drives(model)]
    none = [rows.columns[f"dir.{name}"] == 0 for name in names if f"dir.{name}" in rows.columns]
    return np.asarray(np.any(none, axis=0)) if none else np.zeros(len(rows), dtype=bool)


def _directed(model: Model, rows: Rows) -> Rows:
    return with_sides(rows, model)


def _differ(one: Rows, other: Rows) -> NDArray[np.bool_]:
    """Rows (n,) with different sides of approach."""
    names = [name for name in other.columns if name.startswith("dir.")]
    return np.asarray(np.any([one.columns[n] != other.columns[n] for n in names], axis=0))
