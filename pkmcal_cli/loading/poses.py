"""Configurations to work on: poses as drive readings, and where each came from."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import accumulate

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.errors import MAX_FAULTS, BadInput, Fault, Location
from pkmcal_cli.loading.covariates import at_rest, with_sides
from pkmcal_cli.loading.pose_channels import together
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import Rows, joined_rows
from pkmcal_cli.tables.measurement_set import Measurements

OUT_OF_REACH = "out of reach: no actuator positions for this pose of the tool point"
_SHOWN = 20  # failed rows told one by one
_ONE_ROW = "check the columns that give the poses and their units, or remove the row"
_SEVERAL = 3  # rows that fail, from which on they may have one cause
_MOST_ROWS = (
    "most rows fail, so look for one cause: sign, zero or unit of the columns that give the poses, exchanged columns, "
    "or the table of another machine"
)


@dataclass(frozen=True)
class RowOrigin:
    """Where a row came from: file, line and `id`, or the number of a grid point; a pose that was drawn has a name."""

    file: str | None
    line: int
    id: str

    def __str__(self) -> str:
        if self.file is None:
            return self.id or (f"--grid point {self.line}" if self.line else "the reference configuration")
        return f"{self.file}:{self.line}" + (f" ({self.id})" if self.id else "")

    @property
    def location(self) -> Location | None:
        """Where it is in a file; None for one that is in none."""
        return None if self.file is None else Location(self.file, self.line)

    def fault(self, reason: str, hint: str | None = _ONE_ROW) -> Fault:
        """Why this row cannot be used, as a fault; hint: of a row of a file."""
        if self.file is None:
            return Fault("row", reason, Location(str(self)), "choose poses within the workspace")
        return Fault("row", f"row `{self.id}`: {reason}" if self.id else reason, Location(self.file, self.line), hint)


def origin_of(measurements: Measurements, row: int) -> RowOrigin:
    """Where a row of a table stands."""
    name = measurements.ids[row] if "id" in measurements.labels else ""
    return RowOrigin(measurements.files[measurements.file_index[row]], int(measurements.line[row]), name)


def failed_rows(row_origin: Callable[[int], RowOrigin], reasons: dict[int, str], total: int) -> BadInput:
    """Rows of `total` that cannot be predicted, as one error with all of them."""
    return BadInput(row_faults(row_origin, reasons, total)[:_SHOWN], len(reasons))


def row_faults(row_origin: Callable[[int], RowOrigin], reasons: Mapping[int, str], total: int) -> list[Fault]:
    """The same as faults: of each its remedy, or where most of `total` rows fail, one for all."""
    rows = sorted(reasons)[:MAX_FAULTS]
    if len(reasons) < _SEVERAL or 2 * len(reasons) < total:
        return [row_origin(row).fault(reasons[row]) for row in rows]
    return [row_origin(row).fault(reasons[row], None if k else _MOST_ROWS) for k, row in enumerate(rows)]


@dataclass(frozen=True, kw_only=True)
class Poses:
    """A block of configurations: drive readings and forces, and where each came from.

    reachable (N,): False where no drive readings were found for a pose of the tool point. measured (N, C): which
    channels a table has readings of; None where it has none at all, or poses only. touched (N, C): channels of probes
    with a known reading that touch there by the table; None for poses of a grid. sides (N, A): of approach, as the
    table states them, nan where it does not; None where it has no such column. targets (N, 6): poses of the tool point
    for which the drives were set, nan in rows that state readings of drives; None where all do.
    """

    rows: Rows
    reachable: NDArray[np.bool_]
    row_origin: Callable[[int], RowOrigin]
    measured: NDArray[np.bool_] | None = None
    touched: NDArray[np.bool_] | None = None
    sides: NDArray[np.float64] | None = None
    targets: NDArray[np.float64] | None = None

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def lost(self) -> dict[int, str]:
        """Rows out of reach."""
        return {int(k): OUT_OF_REACH for k in np.nonzero(~self.reachable)[0]}

    def take(self, rows: NDArray[np.intp]) -> Poses:
        """Some rows, which keep their places."""
        names = ("measured", "touched", "sides", "targets")
        known = {n: column[rows] for n in names if (column := getattr(self, n)) is not None}
        row_origin = lambda k: self.row_origin(int(rows[k]))  # noqa: E731
        return replace(self, rows=self.rows.take(rows), reachable=self.reachable[rows], row_origin=row_origin, **known)


def reference_poses(model: Model) -> Poses:
    """The reference configuration alone."""
    rows = at_rest(model, Rows.at(model.reference_readings[None]))
    there, point = np.ones(1, dtype=bool), lambda _: RowOrigin(None, 0, "")
    return Poses(rows=rows, reachable=there, row_origin=point, targets=model.tool.reference[None])


def joined_poses(model: Model, blocks: list[Poses]) -> Poses:
    """All blocks as one, with the directions of motion in the order of all rows."""
    starts = [0, *accumulate(len(b) for b in blocks)]

    def row_origin(row: int) -> RowOrigin:
        k = bisect_right(starts, row) - 1
        return blocks[k].row_origin(row - starts[k])

    rows, names = joined_rows([b.rows for b in blocks]), model.drive_names
    stated = [rows.columns.get(f"dir.{name}", np.full(len(rows), np.nan)) for name in names]
    sides = np.stack(stated, axis=1) if any(f"dir.{name}" in rows.columns for name in names) else None
    return Poses(
        rows=with_sides(rows, model), reachable=np.concatenate([b.reachable for b in blocks]),
        row_origin=row_origin, measured=together([b.measured for b in blocks]),
        touched=together([b.touched for b in blocks]), sides=sides, targets=together([b.targets for b in blocks]),
    )  # fmt: skip
