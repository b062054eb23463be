"""Targets of the tool point: poses that are wanted, and under which circumstances."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from pkmcal_cli.base.errors import BadInput, Location, UsageError
from pkmcal_cli.base.files import input_name
from pkmcal_cli.base.listener import Listener
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.language.tool_point import ToolPoint
from pkmcal_cli.loading.covariates import lagging, reference_conditions, with_covariates, without_effect
from pkmcal_cli.loading.grid import parse_grid, spread_count, spread_over
from pkmcal_cli.loading.load_machine import LoadedMachine
from pkmcal_cli.loading.poses import RowOrigin, origin_of
from pkmcal_cli.loading.tool_coordinates import kept_note, required_tool_point, tool_motion, unusable_set
from pkmcal_cli.loading.unstated_forces import unstated_forces
from pkmcal_cli.loading.workspace_poses import workspace_points
from pkmcal_cli.model.tool_motion import DIRECTIONS
from pkmcal_cli.prediction import Rows
from pkmcal_cli.tables.measurements import read_measurements

_MOST = 10**6  # targets, which are worked on together
_LABELS = ("session", "replicate")  # columns on which no effect depends by what they say


@dataclass(frozen=True, kw_only=True)
class Targets:
    """Poses (N, 6) of the tool point, held at coordinates `held`; rows (N): circumstances, no drive readings yet.

    coordinates: those that were given; covariates: columns that a table of the rows needs; grid: whether points may be
    out of reach; without_effect: circumstances that change nothing.
    """

    poses: Array
    held: tuple[str, ...]
    coordinates: tuple[str, ...]
    rows: Rows
    row_origin: Callable[[int], RowOrigin]
    tool: ToolPoint
    covariates: tuple[str, ...]
    forces: bool
    grid: bool
    notes: tuple[str, ...]
    inputs: Mapping[str, str]
    without_effect: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.poses)


def read_targets(
    loaded: LoadedMachine, path: str | None, grid: str | None, at: Mapping[str, float], to: Listener, session: str = ""
) -> Targets:
    """Targets of a table or of a grid; `at`: columns of all rows, SI; their session. Raises UsageError and BadInput."""
    if (path is None) == (grid is None):
        raise UsageError("give either a table of targets or --grid", hint='for example --grid "x=0:950:3,y=160:390:77"')
    motion = tool_motion(loaded)
    if not motion.freedoms:
        message, _ = unusable_set(loaded, [])
        raise BadInput.single(message, Location(loaded.model.name), "a machine that moves can be corrected", "targets")
    targets = _of_grid(loaded, grid, to) if grid is not None else _of_table(loaded, path or "")
    if session and "session" not in targets.covariates:
        covariates = (*targets.covariates, "session")
        targets = replace(targets, rows=targets.rows.of_session(session), covariates=covariates)
    elif session:
        at = {**at, "session": np.nan}
    if twice := [name for name in at if name in (*targets.rows.columns, *targets.covariates)]:
        message = f"--at: the table has a column `{twice[0]}`"
        raise UsageError(message, hint="give a circumstance in the table or with `--at`, not in both")
    in_table, by_option = (tuple(without_effect(loaded.model, names)) for names in (_circumstances(targets), at))
    columns = {**targets.rows.columns, **{name: np.full(len(targets), value) for name, value in at.items()}}
    at_reference, words = reference_conditions(loaded.model, columns)
    columns |= {name: np.full(len(targets), value) for name, value in at_reference.items()}
    if time_note := _time_note(loaded, columns):
        columns["time"], at_reference["time"] = np.zeros(len(targets)), 0.0
    poses = targets.poses.copy()
    kept = [DIRECTIONS.index(c) for c in targets.held if c not in targets.coordinates]
    poses[:, kept] = loaded.model.tool.reference[kept]
    return replace(
        targets,
        poses=poses,
        rows=replace(targets.rows, columns=columns),
        covariates=tuple(dict.fromkeys([*targets.covariates, *at, *at_reference])),
        notes=(
            *targets.notes, *filter(None, [words, time_note]), *_idle(path or "", in_table), *_idle("--at", by_option),
        ),
        without_effect=(*in_table, *by_option),
    )  # fmt: skip


def _time_note(loaded: LoadedMachine, columns: Mapping[str, Array]) -> str:
    """What is to be said where parts lag behind temperatures that never change, and nobody gives the time."""
    felt = [column for name, column in columns.items() if name.partition(".")[0] == "T"]
    if not lagging(loaded.model) or "time" in columns or any(np.ptp(column) > 0 for column in felt):
        return ""
    return "no column `time`: all parts have settled at their temperatures"


def _circumstances(targets: Targets) -> list[str]:
    """Columns of a table of targets that are there because something may depend on them."""
    return [name for name in targets.covariates if name not in _LABELS]


def _idle(place: str, names: tuple[str, ...]) -> list[str]:
    """What is to be said of circumstances that change nothing, and where they stand."""
    if not names:
        return []
    every = ", ".join(f"`{name}`" for name in names)
    nothing, them = ("changes nothing", "it") if len(names) == 1 else ("change nothing", "them")
    return [f"{input_name(place)}: {every} {nothing}: no effect of the machine file depends on {them}"]


def _of_grid(loaded: LoadedMachine, text: str, to: Listener) -> Targets:
    tool, number = required_tool_point(loaded), spread_count(text)
    points = _gridded(loaded, text) if number is None else _spread(loaded, number, to)
    empty = np.full((len(points.poses), len(loaded.model.actuators)), np.nan)
    return Targets(
        poses=points.poses, held=points.held, coordinates=points.coordinates,
        rows=Rows(empty, empty), row_origin=lambda row: RowOrigin(None, row + 1, ""), tool=tool, covariates=(),
        forces=False, grid=True, notes=(tool.text, *points.notes, *unstated_forces(loaded.machine)), inputs={},
    )  # fmt: skip


@dataclass(frozen=True)
class _Points:
    """Poses (N, 6), coordinates at which they are held, and those of them that were asked for."""

    poses: Array
    held: tuple[str, ...]
    coordinates: tuple[str, ...]
    notes: tuple[str, ...]


def _gridded(loaded: LoadedMachine, text: str) -> _Points:
    grid = parse_grid(loaded, text)
    if len(grid) > _MOST:
        raise UsageError(f"--grid: more than {_MOST} poses", hint="use a coarser grid")
    return _Points(grid.poses(0, len(grid)), grid.held, tuple(a.name for a in grid.axes), grid.notes)


def _spread(loaded: LoadedMachine, number: int, to: Listener) -> _Points:
    points = workspace_points(loaded, spread_over(loaded, number), number, to)
    return _Points(points.poses, points.held, points.spread or points.held, points.notes)


def _of_table(loaded: LoadedMachine, path: str) -> Targets:
    tool, model = required_tool_point(loaded), loaded.model
    measured = read_measurements([path], loaded.machine, "targets")
    if len(measured) > _MOST:
        raise BadInput.single(f"more than {_MOST} targets", Location(measured.files[0]), "split the table", "targets")
    poses = np.full((len(measured), len(DIRECTIONS)), np.nan)
    poses[:, [DIRECTIONS.index(c) for c in measured.coordinates]] = measured.targets
    coordinates = tuple(DIRECTIONS[k] for k in np.nonzero(~np.isnan(poses).all(axis=0))[0])
    held = model.tool_motion.with_all(coordinates)
    if held is None:
        message, hint = unusable_set(loaded, coordinates)
        raise BadInput.single(
            message, Location(measured.files[0], 1), hint.replace("`--grid`", "the others"), "targets"
        )
    kept = [name for name in held if name not in coordinates]
    forces = np.array(measured.forces, dtype=float)
    rows = with_covariates(Rows(np.full(forces.shape, np.nan), forces, partner=measured.partners), measured)
    sessions = ("session",) if "session" in measured.labels else ()
    forced = [a for a, d in enumerate(model.topology.drives) if d.force_controlled]
    return Targets(
        poses=poses, held=held, coordinates=coordinates, rows=rows, tool=tool,
        row_origin=lambda row: origin_of(measured, row), covariates=(*measured.covariates, *sessions),
        forces=bool(np.isfinite(forces[:, forced]).any()), grid=False,
        notes=(*measured.notes, tool.text, *([kept_note(kept)] if kept else [])), inputs=measured.inputs,
    )  # fmt: skip
