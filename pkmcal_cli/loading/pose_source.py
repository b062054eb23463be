"""The poses of a command: blocks of those of a table or a grid, as drive readings; tool poses become them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from pkmcal_cli.base.errors import UsageError
from pkmcal_cli.base.listener import Listener
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.language.tool_point import ToolPoint
from pkmcal_cli.loading.covariates import at_rest, resting, with_covariates
from pkmcal_cli.loading.grid import Grid, parse_grid, spread_count, spread_over
from pkmcal_cli.loading.load_machine import LoadedMachine
from pkmcal_cli.loading.pose_channels import table_channels
from pkmcal_cli.loading.poses import Poses, RowOrigin, failed_rows, joined_poses, origin_of, reference_poses
from pkmcal_cli.loading.tool_coordinates import required_tool_point, tool_motion
from pkmcal_cli.loading.unstated_forces import unstated_forces
from pkmcal_cli.loading.workspace_poses import workspace_poses
from pkmcal_cli.model.tool_motion import DIRECTIONS
from pkmcal_cli.model.travel_limits import TravelLimits
from pkmcal_cli.prediction import Rows
from pkmcal_cli.prediction.inverse_kinematics import DrivePositions, drive_positions
from pkmcal_cli.tables.measurement_set import Measurements, concatenate
from pkmcal_cli.tables.measurements import MeasurementStream

_BLOCK = 1 << 15  # rows of a block of poses
_TOGETHER = 10**6  # positions of a grid that are analysed together
_APART = 1e-9  # of the machine's size, or rad: less is rounding


@dataclass(kw_only=True)
class PoseSource:
    """The poses of a command: those of a table or of a grid.

    Iterating gives blocks. After the first one `inputs` (sha256 by file) is known, after the last one `notes`, what
    `travel_limits` has to say, and whether poses are those of the `tool` point.
    """

    loaded: LoadedMachine
    to: Listener
    path: str | None
    grid: str | None
    notes: tuple[str, ...] = ()
    inputs: dict[str, str] = field(default_factory=dict)
    forces: bool = False  # the table has forces of force-controlled drives
    covariates: tuple[str, ...] = ()  # columns of the table beside the positions, and its sessions where it has some
    tool: ToolPoint | None = None

    def __post_init__(self) -> None:
        self.travel_limits = TravelLimits(self.loaded.model)
        both = self.path is not None and self.grid is not None
        if both or (self.path is None and self.grid is None and not self.stands):
            raise UsageError(
                "give either a table of poses or --grid",
                hint='for example --grid "x=0:950:3,y=160:390:77", or with a `workspace` in the machine file --grid 40',
            )
        self._asked: Grid | Poses | None = None
        if self.grid is not None:
            self.tool = required_tool_point(self.loaded)
            number = spread_count(self.grid)
            self._asked, notes = self._gridded(self.grid) if number is None else self._spread(number)
            self.notes = (self.tool.text, *notes)
        if self.path is None and (note := resting(self.loaded.model)):
            self.notes = (*self.notes, note)
        if self.path is None:
            self.notes = (*self.notes, *unstated_forces(self.loaded.machine))

    def __iter__(self) -> Iterator[Poses]:
        model = self.loaded.model
        whole = bool(model.effects) or any(p.per_session for p in model.parameters)  # these see the whole table
        for poses in [joined_poses(model, list(self._blocks()))] if whole else self._blocks():
            self.travel_limits.add(poses.rows.readings, poses.row_origin)
            yield poses

    def _gridded(self, text: str) -> tuple[Grid, tuple[str, ...]]:
        points = parse_grid(self.loaded, text)
        return points, points.notes

    def _spread(self, number: int) -> tuple[Poses, tuple[str, ...]]:
        workspace = spread_over(self.loaded, number)
        return workspace_poses(self.loaded, workspace, number, self.to)

    @property
    def total(self) -> int | None:
        """How many poses a grid has; None for a table."""
        return None if self._asked is None else len(self._asked)

    @property
    def stands(self) -> bool:
        """Whether no actuator holds a position: the machine has one configuration, whatever its loads."""
        return all(d.force_controlled for d in self.loaded.model.topology.drives)

    def _blocks(self) -> Iterator[Poses]:
        if isinstance(self._asked, Poses):
            yield self._asked
        elif self._asked is not None:
            yield from _grid_blocks(self.loaded, self._asked)
        elif self.path is not None:
            yield from self._table_blocks(self.path)
        else:
            yield reference_poses(self.loaded.model)

    def _table_blocks(self, path: str) -> Iterator[Poses]:
        stream = MeasurementStream([path], self.loaded.machine, "poses")
        table = TablePoses(self.loaded)
        for block in stream if not self._joins else [concatenate(stream)]:
            self.inputs |= block.inputs
            poses = table.of(block)
            self.forces = self.forces or not np.isnan(block.forces).all()
            self.covariates = self.covariates or _stated_covariates(block)
            yield poses
        self.notes, self.tool = (*stream.notes, *table.notes), table.tool

    @property
    def _joins(self) -> bool:
        """Whether a sensor joins rows, which must then be there together."""
        return any(s.kind.joins for s in self.loaded.model.sensors)

    def together(self) -> Poses:
        """All poses at once. Raises BadInput with those of a table that are out of reach; a grid's are `lost`."""
        if self._asked is not None and len(self._asked) > _TOGETHER:
            raise UsageError(f"--grid: more than {_TOGETHER} poses", hint="use a coarser grid")
        poses = joined_poses(self.loaded.model, list(self._blocks()))
        self.travel_limits.add(poses.rows.readings, poses.row_origin)
        if poses.lost and self.grid is None:
            raise failed_rows(poses.row_origin, poses.lost, len(poses))
        return poses if self.grid is None else replace(poses, sides=None)


@dataclass
class TablePoses:
    """Poses of a table, block by block: drive readings as they are, or those for the coordinates of the tool point."""

    loaded: LoadedMachine
    tool: ToolPoint | None = None  # whose coordinates the table gives; None where it gives drive readings
    lacking: tuple[str, ...] = ()
    unused: dict[str, float] = field(default_factory=dict)  # by coordinate: how far it is from where it follows

    def of(self, block: Measurements) -> Poses:
        """Poses of the rows of a block. Raises BadInput where coordinates do not say where the mechanism is."""
        model = self.loaded.model
        readings, forces = np.array(block.actuators, dtype=float), np.array(block.forces, dtype=float)
        held = [a for a, d in enumerate(model.topology.drives) if not d.force_controlled]
        reachable = np.ones(len(block), dtype=bool)
        missing = np.nonzero(np.isnan(readings[:, held]).any(axis=1))[0]
        targets = np.full((len(block), len(DIRECTIONS)), np.nan) if block.coordinates else None
        if len(missing):
            poses = np.full((len(missing), len(DIRECTIONS)), np.nan)
            poses[:, [DIRECTIONS.index(c) for c in block.coordinates]] = block.targets[missing]
            inverse = self._inverse(poses)
            readings[missing], reachable[missing] = inverse.readings, inverse.reached
            assert targets is not None
            targets[missing] = inverse.poses
        rows = with_covariates(Rows(readings, forces, partner=block.partners), block)
        measured, touched = table_channels(model, block)
        return Poses(
            rows=rows, reachable=reachable, row_origin=lambda row: origin_of(block, row), measured=measured,
            touched=touched, targets=targets,
        )  # fmt: skip

    def _inverse(self, poses: Array) -> DrivePositions:
        """Drive readings for poses (N, 6), held at the coordinates that are given, so far as they are independent."""
        motion, self.tool = tool_motion(self.loaded), required_tool_point(self.loaded)
        coordinates = [DIRECTIONS[k] for k in np.nonzero(~np.isnan(poses).all(axis=0))[0]]
        held = motion.most_of(coordinates)
        self.lacking = tuple(c for c in held if c not in coordinates)
        inverse = drive_positions(self.loaded.model, poses, held=held)
        for name in coordinates:
            if name not in held:
                k = DIRECTIONS.index(name)
                apart = np.nan_to_num(np.abs(poses[:, k] - inverse.poses[:, k])).max()
                self.unused[name] = max(self.unused.get(name, 0.0), float(apart))
        return inverse

    @property
    def notes(self) -> list[str]:
        """Coordinates that the table lacks, and those that follow from the others."""
        notes = [self.tool.text] if self.tool is not None else []
        if self.lacking:
            names = ", ".join(f"`{c}`" for c in self.lacking)
            notes.append(f"no column for {names}: the reference configuration is used")
        return notes + [self._unused(name, apart) for name, apart in self.unused.items()]

    def _unused(self, name: str, apart: float) -> str:
        units = self.loaded.machine.file_units
        turning = name.startswith("r")
        text = f"not used: `{name}`, which the mechanism does not move independently"
        if apart <= _APART * (1.0 if turning else self.loaded.model.length):
            return text
        unit = units.angle if turning else units.length
        return f"{text}; the table differs by up to {unit.format(apart, 3)} from the value that follows"


def _stated_covariates(block: Measurements) -> tuple[str, ...]:
    """Columns that a table gives beside its positions."""
    return (*block.covariates, *(("session",) if "session" in block.labels else ()))


def _grid_blocks(loaded: LoadedMachine, grid: Grid) -> Iterator[Poses]:
    for first in range(0, len(grid), _BLOCK):
        inverse = drive_positions(loaded.model, grid.poses(first, min(first + _BLOCK, len(grid))), held=grid.held)
        rows = at_rest(loaded.model, Rows.at(inverse.readings))
        point = lambda row, first=first: RowOrigin(None, first + row + 1, "")  # type: ignore[misc]  # noqa: E731
        yield Poses(rows=rows, reachable=inverse.reached, row_origin=point, targets=inverse.poses)
