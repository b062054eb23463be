"""The way of a program from target to target: from the side that each was corrected for, straining nothing in between.

Where the way from the target before comes from another side than that of the correction, the tool point first goes a
little past: the shortest way of it on which all drives whose side counts run far enough, a small quadratic programme.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.plural import count
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.correction.export_case import ExportCase
from pkmcal_cli.correction.overruns import overruns
from pkmcal_cli.correction.quadratic_programme import Programme, solve
from pkmcal_cli.correction.waypoints import Stations, waypoints
from pkmcal_cli.mechanism.topology import Index
from pkmcal_cli.model.limits import drive_limits
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.tool_motion import DIRECTIONS
from pkmcal_cli.prediction.inverse_kinematics import DrivePositions, drive_positions
from pkmcal_cli.prediction.unknown_sides import sided_drives

_LATE = 0.02  # of a way: its end
_STILL = 1e-9  # m or rad; a drive that moves less has not moved
_LONGEST = 0.1  # of the machine's size, or rad: a way of the tool point past a target
_IN_THE_WAY = 1e-6  # of an overrun: a side that is not had
_SHOWN = 5  # targets that are named


@dataclass(frozen=True)
class ProgramPath:
    """Stations (m) in the order of the program; targets (n,): which of them are the usable targets.

    notes: sides that the program does not approach from, in words.
    """

    stations: Stations
    targets: Index
    notes: tuple[str, ...] = ()


def program_path(case: ExportCase, *, straight_tool: bool) -> ProgramPath:
    """The way past all usable targets; straight_tool: the control itself moves the tool point straight."""
    there = Stations(case.corrected, case.poses)
    drives = np.array(sided_drives(case.model), dtype=np.intp)
    sides = case.corrected_sides[:, drives]
    arriving = _arriving(case, drives, sides, straight_tool or case.model.overdetermined)
    rows = ((sides != 0) & (sides != arriving)).any(axis=1).nonzero()[0]
    past, had = _passed(case, rows, drives, sides[rows]) if len(rows) else (there.take(rows), rows > 0)
    order, stations = _in_order(there, past.take(had.nonzero()[0]), rows[had])
    ways = [there.set_values[:0]] * len(order) if straight_tool else _ways(case, stations)
    columns = [
        (np.vstack([way, at]), np.vstack([np.full((len(way), 6), np.nan), pose]))
        for way, at, pose in zip(ways, stations.set_values, stations.poses, strict=True)
    ]
    ends = np.cumsum([len(way) + 1 for way in ways]) - 1
    every = Stations(*(np.concatenate(column) for column in zip(*columns, strict=True)))
    return ProgramPath(every, ends[order], _refused(case, rows[~had]))


def _in_order(there: Stations, past: Stations, rows: Index) -> tuple[NDArray[np.bool_], Stations]:
    """Targets, some `rows` of which come after a station past them, and which (m,) of all these are targets."""
    count = len(there.poses)
    order = np.argsort(np.concatenate([rows - 0.5, np.arange(count)]))
    joined = (np.vstack(both)[order] for both in ((past.set_values, there.set_values), (past.poses, there.poses)))
    return order >= len(rows), Stations(*joined)


def _ways(case: ExportCase, stations: Stations) -> list[Array]:
    """Set values (k, A) on the way to each station; none to the first."""

    def inverse(poses: Array) -> Array:
        return drive_positions(case.model, poses, case.values, case.made.aim.held).readings

    between = waypoints(case.model, inverse, stations.take(slice(-1)), stations.take(slice(1, None)))
    return [stations.set_values[:0], *between]


def _arriving(case: ExportCase, drives: Index, sides: Array, straight: bool) -> Array:
    """Sides (n, d) from which drives come on the way from the target before, 0 at the first; straight: of the tool.

    A drive that stands keeps the side it has: that of `sides` (n, d).
    """
    poses, held = case.poses, case.made.aim.held
    step = np.diff(case.corrected[:, drives], axis=0)
    if straight and len(poses) > 1:
        late = poses[1:] - _LATE * np.diff(poses, axis=0)
        readings = [drive_positions(case.model, at, case.values, held).readings for at in (late, poses[1:])]
        step = np.nan_to_num((readings[1] - readings[0])[:, drives])
    kept = np.where(np.abs(step) > _STILL, np.sign(step), sides[:-1])
    return np.vstack([np.zeros((1, len(drives))), kept])


def _passed(case: ExportCase, rows: Index, drives: Index, sides: Array) -> tuple[Stations, NDArray[np.bool_]]:
    """Stations (n) past targets, from which all drives come from their sides (n, d), and where (n,) these are had."""
    model, held = case.model, case.made.aim.held
    poses, corrected = case.poses[rows], case.corrected[rows]
    at = drive_positions(model, poses, case.values, held, derivatives=True)
    columns = [DIRECTIONS.index(c) for c in held]
    size = np.where([c in "xyz" for c in held], model.length, 1.0)
    step = _shortest(at, drives, size, sides, overruns(model, case.corrected, drives))
    had = (np.abs(step) <= _LONGEST).all(axis=1)
    step[~had] = 0.0
    begin, last = corrected, corrected
    for share in (0.5, 1.0):  # both halves of the way: no drive turns round on it
        past, last = poses.copy(), begin
        past[:, columns] -= share * step * size
        back = drive_positions(model, past, case.values, held)
        begin = corrected + (back.readings - at.readings)
        arriving = sides * (last - begin)[:, drives]
        had &= back.reached & _within_travel(model, begin) & ((arriving > 0) | (sides == 0)).all(axis=1)
    return Stations(begin, past), np.asarray(had)


def _shortest(at: DrivePositions, drives: Index, size: Array, sides: Array, overrun: Array) -> Array:
    """Shortest ways (n, h) of the tool point, in sizes, on which drives go to their sides (n, d) by their overrun."""
    assert at.by_pose is not None
    forward = np.nan_to_num(at.by_pose[:, drives]) * size / overrun[:, None]  # (n, d, h): overruns per size
    matrix = -sides[:, :, None] * forward
    bound = np.where(sides != 0, -1.0, 0.0)
    identity = np.tile(np.eye(len(size)), (len(sides), 1, 1))
    slope = np.zeros((len(sides), len(size)))
    optimum = solve(Programme(curvature=identity, slope=slope, matrix=matrix, bound=bound))
    return np.where(optimum.excess[:, None] < _IN_THE_WAY, optimum.y, np.inf)


def _within_travel(model: Model, set_values: Array) -> NDArray[np.bool_]:
    low, high = drive_limits(model.actuators).T
    return np.asarray(((set_values >= low) & (set_values <= high) | np.isnan(set_values)).all(axis=1))


def _refused(case: ExportCase, rows: Sequence[int] | Index) -> tuple[str, ...]:
    if not len(rows):
        return ()
    names = ", ".join(f"`{case.names[k]}`" for k in rows[:_SHOWN]) + (", ..." if len(rows) > _SHOWN else "")
    text = f"{count(len(rows), 'target')} ({names}): no move of the tool point comes from the sides of `dir`"
    return (f"{text}; the program approaches from others, and the error there is larger than stated",)
