"""Grids of tool point poses, `--grid "x=0:950:3,rx=-5:5:3"`, in any set of independent coordinates."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.errors import UsageError, did_you_mean
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.loading.load_machine import LoadedMachine
from pkmcal_cli.loading.tool_coordinates import kept_note, tool_motion, unusable_set
from pkmcal_cli.loading.workspace_poses import usable_workspace, workspace_remedy
from pkmcal_cli.model.tool_motion import DIRECTIONS
from pkmcal_cli.model.workspace import Workspace
from pkmcal_cli.units.unit_text import Unit, UnitError, parse_value

_MOST = 10**9  # positions of a grid
_MOST_SPREAD = 10**5  # positions that are spread over the workspace


@dataclass(frozen=True)
class Axis:
    """`count` values of a coordinate of the tool point from `start` to `stop`, both included, SI."""

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


@dataclass(frozen=True)
class Grid:
    """Poses at all combinations of the axes' values, the last axis fastest; `held`: which coordinates they hold.

    Those of no axis are kept as in the reference configuration.
    """

    axes: tuple[Axis, ...]
    held: tuple[str, ...]

    def __len__(self) -> int:
        return math.prod(a.count for a in self.axes)

    def poses(self, first: int, last: int) -> Array:
        """Poses (n, 6) number `first` to `last` - 1, m and rad; nan: as in the reference configuration."""
        index = np.unravel_index(np.arange(first, last), [a.count for a in self.axes])
        poses = np.full((last - first, len(DIRECTIONS)), np.nan)
        for axis, where in zip(self.axes, index, strict=True):
            poses[:, DIRECTIONS.index(axis.name)] = axis.values(where)
        return poses

    @property
    def notes(self) -> tuple[str, ...]:
        """Which coordinates are kept."""
        kept = [c for c in self.held if c not in (a.name for a in self.axes)]
        return (kept_note(kept),) if kept else ()


def spread_count(text: str) -> int | None:
    """How many poses a plain number asks for, spread over the workspace; None for axes. Raises UsageError."""
    if not re.fullmatch(r"\s*[+-]?\d+\s*", text, re.ASCII):
        return None
    number = int(text) if len(text) < 16 else _MOST_SPREAD + 1
    if not 0 < number <= _MOST_SPREAD:
        raise UsageError(f"--grid: `{text.strip()}` is not a number of poses", hint=f"give 1 to {_MOST_SPREAD}")
    return number


def spread_over(loaded: LoadedMachine, number: int) -> Workspace:
    """The workspace over which so many poses are spread. Raises UsageError where a machine has none."""
    workspace = usable_workspace(loaded)
    if workspace is None:
        message = f"--grid {number}: so many poses are spread over the workspace, and the machine declares none"
        raise UsageError(message, hint=f'{workspace_remedy(loaded)}, or give axes: "x=0:950:3,y=160:390:77"')
    return workspace


def parse_grid(loaded: LoadedMachine, text: str, option: str = "--grid") -> Grid:
    """A grid "x=0:950:3,...", given by an option.

    Raises UsageError, and BadInput where the machine's tool point has no pose to ask for.
    """
    axes: list[Axis] = []
    for part in text.split(","):
        axis = _axis(loaded, part.strip(), option)
        if axis.name in (a.name for a in axes):
            raise UsageError(f"{option}: `{axis.name}` is given twice", hint="give every axis only once")
        axes.append(axis)
    motion = tool_motion(loaded)
    held = motion.with_all([a.name for a in axes])
    if held is None:
        message, hint = unusable_set(loaded, [a.name for a in axes])
        raise UsageError(f"{option}: {message}", hint=hint)
    grid = Grid(tuple(axes), held)
    if len(grid) > _MOST:
        raise UsageError(f"{option}: more than {_MOST} poses", hint="use a coarser grid")
    return grid


def _axis(loaded: LoadedMachine, part: str, option: str) -> Axis:
    """One axis `NAME=start:stop:count`."""
    name, equals, limits_text = (t.strip() for t in part.partition("="))
    limits = limits_text.split(":")
    if not equals or len(limits) != 3:
        raise UsageError(
            f"{option}: `{part}` is not an axis", hint='write NAME=start:stop:count, for example "x=0:950:3"'
        )
    valid = ("x", "y", "rz") if loaded.model.topology.planar else DIRECTIONS
    if name not in valid:
        raise UsageError(f"{option}: `{name}` is not a coordinate of the tool point", hint=did_you_mean(name, valid))
    number = limits[2].strip()
    if not (number.isascii() and number.isdigit() and len(number) < 16 and int(number) > 0):
        raise UsageError(f"{option}: `{number}` is not a number of poses", hint="give an integer of at least 1")
    units = loaded.machine.file_units
    expected = units.angle if name.startswith("r") else units.length
    start, stop = (_limit(part, text, expected, option) for text in limits[:2])
    return Axis(name, start, stop, int(number))


def _limit(part: str, text: str, expected: Unit, option: str) -> float:
    """A limit of an axis, SI: a number in the file's unit, or a value with a unit."""
    try:
        number, unit = parse_value(text, (expected.dimension,))
    except UnitError as error:
        hint = error.hint or f"give a number in {expected.text}"
        raise UsageError(f"{option}: `{part}`: {error.message}", hint=hint) from None
    unit = expected if unit.text == "1" else unit
    value = unit.to_si(number)
    if unit.dimension != expected.dimension or not math.isfinite(value):
        raise UsageError(
            f"{option}: `{part}`: `{text.strip()}` is not a limit", hint=f"give a number in {expected.text}"
        )
    return value
