"""From files to what the commands work on: compiled machine, parameter values, poses or measurements."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np

from .compiler import Compiled, compile_machine
from .compiler.faults import mechanism_faults
from .errors import BadInput, Fault, FaultList, Location, UsageError, did_you_mean
from .inverse import DIRECTIONS, drive_positions
from .machine import Machine
from .machine_yaml import read_machine
from .measurement_set import Measurements
from .measurements import MeasurementStream, read_measurements
from .model import Model
from .parameter_file import read_parameters
from .prediction import Rows
from .rotation import Array

_BLOCK = 1 << 15  # rows of a block of poses


@dataclass(frozen=True)
class LoadedMachine:
    """A machine without faults, compiled; warnings to be told."""

    machine: Machine
    compiled: Compiled
    warnings: tuple[Fault, ...]

    @property
    def model(self) -> Model:
        """The compiled model."""
        return self.compiled.model


def load_machine(path: str) -> LoadedMachine:
    """Read, compile and check a machine. Raises BadInput with all faults of the stage that fails."""
    machine = read_machine(path)
    try:
        compiled = compile_machine(machine)
    except (ValueError, KeyError, np.linalg.LinAlgError) as error:
        raise BadInput.single(f"this machine cannot be built: {error}", Location(path, 1, 1), code="machine") from error
    faults = FaultList()
    for fault in mechanism_faults(machine, compiled):
        faults.add(fault)
    faults.raise_if_any()
    return LoadedMachine(machine, compiled, (*machine.warnings, *faults.warnings))


def parameter_values(model: Model, path: str | None) -> Array:
    """Parameter values (P,), SI: nominal, or a parameter file's."""
    values = model.nominal
    if path is not None:
        for name, value in read_parameters(path, model.parameters).items():
            values[model.names.index(name)] = value
    return values


@dataclass(frozen=True)
class Poses:
    """A block of configurations: drive readings and forces, and where each came from.

    `reachable` (N,): False where no drive readings were found for a TCP pose; `by_pose`: whether they were computed.
    """

    rows: Rows
    places: tuple[str, ...]
    ids: tuple[str, ...]
    reachable: Array
    by_pose: bool
    both: bool  # the table has TCP coordinates too; the actuators win


def read_poses(loaded: LoadedMachine, path: str | None, grid: str | None) -> Iterator[Poses]:
    """Blocks of poses from a table or a grid; TCP poses become drive readings of the nominal machine."""
    if (path is None) == (grid is None):
        raise UsageError("give either a table of poses or --grid", hint='--grid "x=0:950:3,y=160:390:77"')
    if grid is not None:
        yield from _grid_blocks(loaded, grid)
        return
    assert path is not None
    for block in MeasurementStream([path], loaded.machine, "poses"):
        yield from _table_poses(loaded, block)


def all_poses(loaded: LoadedMachine, path: str | None, grid: str | None) -> Poses:
    """All poses of a table or grid together."""
    blocks = list(read_poses(loaded, path, grid))
    if not blocks:
        raise BadInput.single("there are no poses", Location(path or "--grid", 1, 1), code="poses")
    return Poses(
        Rows(np.concatenate([b.rows.readings for b in blocks]), np.concatenate([b.rows.forces for b in blocks])),
        tuple(p for b in blocks for p in b.places),
        tuple(i for b in blocks for i in b.ids),
        np.concatenate([b.reachable for b in blocks]),
        blocks[0].by_pose,
        any(b.both for b in blocks),
    )


def _table_poses(loaded: LoadedMachine, block: Measurements) -> Iterator[Poses]:
    places = tuple(block.place(k) for k in range(len(block)))
    readings = np.array(block.actuators, dtype=float)
    forces = np.array(block.forces, dtype=float)
    held = [a for a, d in enumerate(loaded.model.layout.drives) if not d.force_controlled]
    given = ~np.isnan(readings[:, held]).any(axis=1) if held else np.ones(len(block), dtype=bool)
    reachable = np.ones(len(block), dtype=bool)
    missing = np.nonzero(~given)[0]
    if len(missing):
        poses = np.full((len(missing), 6), np.nan)
        columns = [DIRECTIONS.index(c) for c in block.coordinates]
        poses[:, columns] = block.targets[missing]
        found = drive_positions(loaded.model, poses)
        readings[missing] = found.readings
        reachable[missing] = found.status == 0
    both = bool(given.any() and not np.isnan(block.targets).all())
    yield Poses(Rows(readings, forces), places, block.ids, reachable, bool(len(missing)), both)


def _grid_blocks(loaded: LoadedMachine, text: str) -> Iterator[Poses]:
    axes = parse_grid(loaded, text)
    counts = [len(values) for _, values in axes]
    total = int(np.prod(counts))
    for first in range(0, total, _BLOCK):
        index = np.unravel_index(np.arange(first, min(first + _BLOCK, total)), counts)
        poses = np.full((len(index[0]), 6), np.nan)
        for (name, values), where in zip(axes, index, strict=True):
            poses[:, DIRECTIONS.index(name)] = values[where]
        found = drive_positions(loaded.model, poses)
        places = tuple(f"--grid point {k + 1}" for k in range(first, first + len(poses)))
        forces = np.full(found.readings.shape, np.nan)
        yield Poses(
            Rows(found.readings, forces), places, ("",) * len(poses), found.status == 0, True, False
        )


def parse_grid(loaded: LoadedMachine, text: str) -> list[tuple[str, Array]]:
    """Axes of a grid "x=0:950:3,...": name and SI values; last axis fastest. Raises UsageError."""
    units = loaded.machine.file_units
    valid = ("x", "y", "rz") if loaded.model.layout.planar else DIRECTIONS
    axes: list[tuple[str, Array]] = []
    for part in text.split(","):
        match = re.fullmatch(r"\s*(\w+)\s*=\s*([^:]+):([^:]+):\s*(\d+)\s*", part)
        if match is None:
            raise UsageError(f"--grid: `{part}` is no axis", hint='NAME=start:stop:count, for example "x=0:950:3"')
        name, start, stop, count = match.groups()
        if name not in valid:
            raise UsageError(f"--grid: `{name}` is no TCP coordinate", hint=did_you_mean(name, valid))
        if name in (n for n, _ in axes):
            raise UsageError(f"--grid: `{name}` is given twice")
        try:
            low, high = float(start), float(stop)
        except ValueError:
            raise UsageError(f"--grid: `{part}` has a limit that is no number") from None
        if not (np.isfinite(low) and np.isfinite(high)) or int(count) < 1:
            raise UsageError(f"--grid: `{part}` needs finite limits and a count of at least 1")
        unit = units.angle if name.startswith("r") else units.length
        axes.append((name, np.array([unit.to_si(v) for v in np.linspace(low, high, int(count))])))
    return axes


def load_measurements(loaded: LoadedMachine, paths: Sequence[str]) -> Measurements:
    """Measured rows of one or several files. Raises BadInput."""
    return read_measurements(list(paths), loaded.machine, "measured")


def failed_rows(places: Sequence[str], reasons: dict[int, str], limit: int = 50) -> BadInput:
    """Rows that cannot be predicted, as one error with all of them."""
    faults = []
    for row, reason in islice(reasons.items(), limit):
        place = places[row]
        file, _, line = place.partition(":")
        number = re.match(r"\d+", line)
        where = Location(file, int(number.group()), 1) if number else Location(place, 1, 1)
        hint = "check the actuator columns and their units, or take the row out"
        faults.append(Fault("row", reason, where, hint))
    return BadInput(faults, len(reasons))
