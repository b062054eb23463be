"""Configurations to work on: blocks of poses from a table or a grid, as drive readings; TCP poses become them."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import accumulate

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.errors import BadInput, Fault, Location, UsageError, did_you_mean
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.loading.covariates import at_rest, resting, with_covariates, with_directions
from pkmcal_cli.loading.machine import LoadedMachine
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.travel_limits import Travels
from pkmcal_cli.prediction import Rows, joined_rows
from pkmcal_cli.prediction.inverse_kinematics import DIRECTIONS, drive_positions, independent_coordinates
from pkmcal_cli.tables.measurement_set import Measurements, concatenate
from pkmcal_cli.tables.measurements import MeasurementStream
from pkmcal_cli.units.unit_text import Unit, UnitError, parse_value

OUT_OF_REACH = "out of reach: no drive positions for this TCP pose"
_BLOCK = 1 << 15  # rows of a block of poses
_MOST = 10**9  # positions of a grid
_TOGETHER = 10**6  # positions of a grid that are analysed together
_SHOWN = 50  # failed rows told one by one


@dataclass(frozen=True)
class Place:
    """Where a row came from: file, line and `id`, or the number of a grid point."""

    file: str | None
    line: int
    id: str

    def __str__(self) -> str:
        if self.file is None:
            return f"--grid point {self.line}" if self.line else "the drawing"
        return f"{self.file}:{self.line}" + (f" ({self.id})" if self.id else "")

    def fault(self, reason: str) -> Fault:
        """Why this row cannot be used, as a fault."""
        hint = "check the columns that give the poses and their units, or take the row out"
        if self.file is None:
            return Fault("row", reason, Location(str(self)), "choose positions within the workspace")
        return Fault("row", f"row `{self.id}`: {reason}" if self.id else reason, Location(self.file, self.line), hint)


def place_of(measurements: Measurements, row: int) -> Place:
    """Where a row of a table stands."""
    name = measurements.ids[row] if "id" in measurements.labels else ""
    return Place(measurements.files[measurements.file_index[row]], int(measurements.line[row]), name)


def failed_rows(place: Callable[[int], Place], reasons: dict[int, str]) -> BadInput:
    """Rows that cannot be predicted, as one error with all of them."""
    shown = sorted(reasons)[:_SHOWN]
    return BadInput([place(row).fault(reasons[row]) for row in shown], len(reasons))


@dataclass(frozen=True)
class Poses:
    """A block of configurations: drive readings and forces, and where each came from.

    reachable (N,): False where no drive readings were found for a TCP pose. measured (N, C): which channels a table
    has readings of; None where it has none at all, or poses only.
    """

    rows: Rows
    reachable: NDArray[np.bool_]
    place: Callable[[int], Place]
    measured: NDArray[np.bool_] | None = None

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def lost(self) -> dict[int, str]:
        """Rows out of reach."""
        return {int(k): OUT_OF_REACH for k in np.nonzero(~self.reachable)[0]}


@dataclass(kw_only=True)
class PoseSource:
    """The poses of a command: those of a table or of a grid.

    Iterating gives blocks. After the first one `inputs` (sha256 by file) is known, after the last one `notes` and
    what `travels` has to say.
    """

    loaded: LoadedMachine
    path: str | None
    grid: str | None
    notes: tuple[str, ...] = ()
    inputs: dict[str, str] = field(default_factory=dict)
    forces: bool = False  # the table has forces of force-controlled drives
    covariates: tuple[str, ...] = ()  # columns of the table beside the positions, and its sessions where it has some

    def __post_init__(self) -> None:
        self.travels = Travels(self.loaded.model)
        if (self.path is None) == (self.grid is None):
            raise UsageError("give either a table of poses or --grid", hint='--grid "x=0:950:3,y=160:390:77"')
        self.axes = parse_grid(self.loaded, self.grid) if self.grid is not None else []
        if self.grid is not None and (note := resting(self.loaded.model)):
            self.notes = (note,)

    def __iter__(self) -> Iterator[Poses]:
        model = self.loaded.model
        whole = bool(model.effects) or any(p.per_session for p in model.parameters)  # these see the whole table
        for poses in [_joined(model, list(self._blocks()))] if whole else self._blocks():
            self.travels.add(poses.rows.readings)
            yield poses

    def _blocks(self) -> Iterator[Poses]:
        if self.path is None:
            yield from _grid_blocks(self.loaded, self.axes)
            return
        stream = MeasurementStream([self.path], self.loaded.machine, "poses")
        more: dict[str, None] = {}
        for block in stream if not self._joins else [concatenate(stream)]:
            self.inputs |= block.inputs
            poses, notes = _table_poses(self.loaded, block)
            more |= dict.fromkeys(notes)
            self.forces = self.forces or not np.isnan(block.forces).all()
            self.covariates = self.covariates or _given(block)
            yield poses
        self.notes = (*stream.notes, *more)

    @property
    def _joins(self) -> bool:
        """Whether a sensor joins rows, which must then be there together."""
        return any(s.kind.joins for s in self.loaded.model.sensors)

    def together(self) -> Poses:
        """All poses at once, every one within reach. Raises BadInput with those that are not."""
        if math.prod(a.count for a in self.axes) > _TOGETHER:
            raise UsageError(f"--grid: more than {_TOGETHER} positions", hint="take a coarser grid")
        poses = _joined(self.loaded.model, list(self))
        if poses.lost:
            raise failed_rows(poses.place, poses.lost)
        return poses


def _joined(model: Model, blocks: list[Poses]) -> Poses:
    """All blocks as one, with the directions of motion in the order of all rows."""
    starts = [0, *accumulate(len(b) for b in blocks)]

    def place(row: int) -> Place:
        k = bisect_right(starts, row) - 1
        return blocks[k].place(row - starts[k])

    rows = with_directions(joined_rows([b.rows for b in blocks]), [a.name for a in model.actuators])
    known = [b.measured for b in blocks if b.measured is not None]
    measured = np.concatenate(known) if len(known) == len(blocks) else None
    return Poses(rows, np.concatenate([b.reachable for b in blocks]), place, measured)


def _table_poses(loaded: LoadedMachine, block: Measurements) -> tuple[Poses, list[str]]:
    """The poses of some rows of a table, and what is to be said of them."""
    readings = np.array(block.actuators, dtype=float)
    forces = np.array(block.forces, dtype=float)
    held = [a for a, d in enumerate(loaded.model.layout.drives) if not d.force_controlled]
    given = ~np.isnan(readings[:, held]).any(axis=1) if held else np.ones(len(block), dtype=bool)
    reachable = np.ones(len(block), dtype=bool)
    missing = np.nonzero(~given)[0]
    targets, notes = block.targets, []
    if len(missing):
        poses = np.full((len(missing), 6), np.nan)
        poses[:, [DIRECTIONS.index(c) for c in block.coordinates]] = targets[missing]
        found = drive_positions(loaded.model, poses)
        readings[missing] = found.readings
        reachable[missing] = found.status == 0
        told = [DIRECTIONS[k] for k in np.nonzero(~np.isnan(poses).all(axis=0))[0]]
        notes = _pose_notes(found.aimed, told)
    rows = with_covariates(Rows(readings, forces, partner=block.partners), block)
    return Poses(rows, reachable, lambda row: place_of(block, row), _measured(loaded.model, block)), notes


def _measured(model: Model, block: Measurements) -> NDArray[np.bool_] | None:
    """Which channels of the model (N, C) a table of drive readings has readings of; None where it has none."""
    if not (block.has_readings and block.has_actuators):
        return None
    out = np.zeros((len(block), len(model.channels)), dtype=bool)
    for k, channel in enumerate(model.channels):
        if channel.name in block.channels:
            out[:, k] = block.measured[:, block.channels.index(channel.name)]
    return out


def _given(block: Measurements) -> tuple[str, ...]:
    """Columns that a table gives beside its positions."""
    return (*block.covariates, *(("session",) if "session" in block.labels else ()))


def _pose_notes(aimed: tuple[str, ...], given: list[str]) -> list[str]:
    """Coordinates that the table lacks, and those that the mechanism does not move on their own."""
    lacking = [f"`{c}`" for c in aimed if c not in given]
    idle = [f"`{c}`" for c in given if c not in aimed]
    notes = [f"no column for {', '.join(lacking)}: as in the drawing"] if lacking else []
    return notes + ([f"the mechanism does not move {', '.join(idle)} freely: not asked for"] if idle else [])


@dataclass(frozen=True)
class Axis:
    """`count` values of a TCP coordinate from `start` to `stop`, both included, SI."""

    name: str
    start: float
    stop: float
    count: int

    def values(self, index: NDArray[np.intp]) -> Array:
        """Values at indices (n,) from 0 to count - 1."""
        if self.count == 1:
            return np.full(len(index), self.start)
        share = index / (self.count - 1)
        return np.asarray(self.start * (1 - share) + self.stop * share)


def _grid_blocks(loaded: LoadedMachine, axes: list[Axis]) -> Iterator[Poses]:
    counts = [a.count for a in axes]
    total = math.prod(counts)
    for first in range(0, total, _BLOCK):
        index = np.unravel_index(np.arange(first, min(first + _BLOCK, total)), counts)
        poses = np.full((len(index[0]), 6), np.nan)
        for axis, where in zip(axes, index, strict=True):
            poses[:, DIRECTIONS.index(axis.name)] = axis.values(where)
        found = drive_positions(loaded.model, poses)
        rows = at_rest(loaded.model, Rows.at(found.readings))
        yield Poses(rows, found.status == 0, lambda row, first=first: Place(None, first + row + 1, ""))  # type: ignore[misc]


def parse_grid(loaded: LoadedMachine, text: str) -> list[Axis]:
    """Axes of a grid "x=0:950:3,...", the last one fastest. Raises UsageError."""
    valid = ("x", "y", "rz") if loaded.model.layout.planar else DIRECTIONS
    free = independent_coordinates(loaded.model)
    axes: list[Axis] = []
    for part in text.split(","):
        axis = _axis(loaded, part.strip(), valid)
        if axis.name not in free:
            hint = f"it moves {', '.join(free)} freely" if free else None
            raise UsageError(f"--grid: this mechanism does not move `{axis.name}` freely", hint=hint)
        if axis.name in (a.name for a in axes):
            raise UsageError(f"--grid: `{axis.name}` is given twice", hint="give every axis once")
        axes.append(axis)
    if math.prod(a.count for a in axes) > _MOST:
        raise UsageError(f"--grid: more than {_MOST} positions", hint="take a coarser grid")
    return axes


def _axis(loaded: LoadedMachine, part: str, valid: tuple[str, ...]) -> Axis:
    """One axis `NAME=start:stop:count`."""
    name, equals, rest = (t.strip() for t in part.partition("="))
    limits = rest.split(":")
    if not equals or len(limits) != 3:
        raise UsageError(f"--grid: `{part}` is no axis", hint='NAME=start:stop:count, for example "x=0:950:3"')
    if name not in valid:
        raise UsageError(f"--grid: `{name}` is no TCP coordinate", hint=did_you_mean(name, valid))
    number = limits[2].strip()
    if not (number.isascii() and number.isdigit() and len(number) < 16 and int(number) > 0):
        raise UsageError(f"--grid: `{number}` is no number of positions", hint="a whole number, at least 1")
    units = loaded.machine.file_units
    own = units.angle if name.startswith("r") else units.length
    start, stop = (_limit(part, text, own) for text in limits[:2])
    return Axis(name, start, stop, int(number))


def _limit(part: str, text: str, own: Unit) -> float:
    """A limit of an axis, SI: a number in the file's unit, or a value with a unit."""
    try:
        number, unit = parse_value(text)
    except UnitError as error:
        raise UsageError(f"--grid: `{part}`: {error.what}", hint=error.hint) from None
    unit = own if unit.text == "1" else unit
    value = unit.to_si(number)
    if unit.dimension != own.dimension or not math.isfinite(value):
        raise UsageError(f"--grid: `{part}`: `{text.strip()}` is no limit", hint=f"a number, in {own.text}")
    return value
