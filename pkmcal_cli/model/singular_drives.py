"""Whether the drives hold the platform as it is drawn, and those that are not redundant in the whole workspace.

Redundancy is often built in to remove singularities, so there may be poses that all drives hold together, while those
of the substructure, to which `linear` and `rigid` refer, do not: det dq/dp of the substructure vanishes on the way.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations, islice

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.even_points import even_points
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.equilibrium.kinematics import point_poses, reference_state
from pkmcal_cli.model.freedoms import REGULAR, ClosedPoses, smallest_singular_value
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.tool_motion import DIRECTIONS

_CHOICES = 500
_SPREAD = 32  # poses over a workspace
_HARDLY = 0.1  # of how well the platform is held about the drawing; one much smaller than its machine is held less


@dataclass(frozen=True)
class SingularDrives:
    """Poses at which the substructure alone is singular, or beyond a singular pose; regular with all drives.

    pose (f,): the nearest to the reference configuration of those that were tried, SI; better: sets of redundant drives
    with which none is.
    """

    pose: Array
    better: tuple[tuple[str, ...], ...]


def hardly_held(model: Model) -> str | None:
    """The coordinate that all drives together hardly hold as the machine is drawn; None where they hold all.

    A drawing in or next to a singular pose, of a machine that its drives hold elsewhere: assemblies meet there, so that
    rows about it may be solved in either.
    """
    if not 0 < model.motion_of(model.posed).freedoms <= len(model.held_drives):
        return None
    state = reference_state(model.topology, model.reference_coefficients, 1, model.freedoms.system.constraints)
    drawn = model.freedoms.reached(model.reference_coefficients, state, np.zeros((0, len(model.freedoms.home))))
    if not drawn.closed[0] or smallest_singular_value(drawn.jacobian)[0] >= REGULAR:
        return None  # most machines, at little cost
    poses = model.starts
    held = smallest_singular_value(poses.jacobian)
    if not poses.closed[0] or held[0] >= min(REGULAR, _HARDLY * float(np.median(held[poses.closed]))):
        return None
    weakest = np.linalg.svd(np.nan_to_num(poses.jacobian[0]))[2][-1]
    return model.freedoms.coordinates[int(np.argmax(np.abs(weakest)))]


def singular_drives(model: Model) -> SingularDrives | None:
    """None where there is no such pose about the reference configuration, or no redundancy."""
    if not model.overdetermined:
        return None
    freedoms, poses = model.freedoms, _poses(model)
    jacobian = poses.jacobian  # (n, D, f)
    usable = poses.closed & _within_limits(model, poses) & ~poses.singular
    names = [model.actuators[a].name for a in freedoms.drives]
    kept = _kept(model)
    if not usable[0] or len(kept) != jacobian.shape[2]:
        return None
    usable &= _within_workspace(model, poses)
    lost = usable & ~_held_by(jacobian, kept)
    if not lost.any():
        return None
    every = range(len(names))
    choices = islice(combinations(every, len(kept)), _CHOICES)
    good = [c for c in choices if _held_by(jacobian, list(c))[usable].all()]
    better = tuple(tuple(names[k] for k in every if k not in choice) for choice in good)
    first = int(np.argmin(np.where(lost, np.abs(poses.poses - freedoms.home).max(axis=1), np.inf)))
    return SingularDrives(poses.poses[first] * freedoms.unit, better)


def substructure_holds(model: Model) -> bool:
    """Whether the substructure holds the platform at all poses about the reference configuration that all drives hold.

    For an overdetermined model.
    """
    poses, kept = model.starts, _kept(model)
    usable = poses.closed & ~poses.singular
    return len(kept) == poses.jacobian.shape[2] and bool(_held_by(poses.jacobian, kept)[usable].all())


def _kept(model: Model) -> list[int]:
    """Drives of the substructure, by number among those that hold a position."""
    return [k for k, a in enumerate(model.freedoms.drives) if not model.topology.drives[a].redundant]


def _poses(model: Model) -> ClosedPoses:
    """The reference configuration, poses about it, and poses all over the workspace where one is declared."""
    workspace, freedoms, starts = model.workspace, model.freedoms, model.starts
    if workspace is None or model.posed.point != model.tool.point:
        return starts
    columns = [DIRECTIONS.index(name) for name in freedoms.coordinates]
    low, high = (bounds[columns] / freedoms.unit for bounds in workspace.bounds)
    if not np.isfinite([low, high]).all():
        return starts
    wide = low + even_points(_SPREAD, len(columns)) * (high - low)
    state = starts.state.take(np.zeros(1, dtype=np.intp))
    return freedoms.reached(model.reference_coefficients, state, np.concatenate([starts.poses[1:], wide]))


def _held_by(jacobian: Array, drives: list[int]) -> NDArray[np.bool_]:
    """Poses (n,) that some drives hold, on the same side of their singular poses as the reference configuration."""
    part = jacobian[:, drives]
    sign = np.linalg.slogdet(part)[0]
    return np.asarray((smallest_singular_value(part) > REGULAR) & (sign == sign[0]))


def _readings(model: Model, poses: ClosedPoses) -> Array:
    """Readings (n, A) of the drives at poses; of those in force control as in the reference configuration."""
    freedoms = model.freedoms
    out = np.tile(model.reference_readings, (len(poses.poses), 1))
    out[:, freedoms.drives] += poses.misfit * freedoms.size / model.reference_coefficients[0, freedoms.gains]
    return out


def _within_limits(model: Model, poses: ClosedPoses) -> NDArray[np.bool_]:
    """Poses (n,) that the drives' limits of travel allow."""
    drives = model.freedoms.drives
    readings, (low, high) = _readings(model, poses)[:, drives], np.array([model.actuators[a].limits for a in drives]).T
    return np.asarray(((readings >= low) & (readings <= high)).all(axis=1))


def _within_workspace(model: Model, poses: ClosedPoses) -> NDArray[np.bool_]:
    """Poses (n,) that lie in the declared workspace, if there is one."""
    if model.workspace is None:
        return np.ones(len(poses.poses), dtype=bool)
    tool = model.tool
    places = point_poses(model.topology, model.reference_coefficients, poses.state, tool.point, tool.rotation)
    return model.workspace.holds(places, _readings(model, poses))
