"""Measurements: what tables say of a machine's poses, as arrays in SI, one row a configuration."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from datetime import timedelta
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.errors import Fault, Location
from pkmcal_cli.base.stored_texts import StoredTexts
from pkmcal_cli.tables.serial_days import Span

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Rows = slice | NDArray[np.int64] | NDArray[np.bool_] | Sequence[int]


@dataclass(frozen=True, kw_only=True)
class Measurements:
    """N rows of measurements, in SI (m, rad, N, N m, kg, K, s).

    actuators (N, A): readings, the set values of position-controlled actuators and the measured ones of
        force-controlled; all NaN if the poses are given by TCP coordinates. forces (N, A): NaN where the
        machine's constant force holds, or nothing was measured
    readings (N, C) of `channels` (of the sensors, then of force-controlled actuators): NaN where not measured
    sigma (N, C), actuator_sigma (N, A, as travel): from columns, NaN where the machine's holds
    given_targets (N, K): of TCP `coordinates`, in columns of their own; see `targets`
    covariates (N,) by name: "time", "T", "T.PART", "dir.ACTUATOR", "payload", "replicate"; NaN where empty
    labels (N) by name: "id", "session", "tool", "part", "to"; "" where empty
    session (N,) index into `sessions`; file_index (N,) index into `files`; line (N,) in the file
    sha256: of the files; notes: what to announce of them; warnings: what is doubtful
    dates: of the first and the last row, UTC; None where no times are dates
    Arrays that have nothing but NaN take no memory and cannot be written to.
    """

    actuator_names: tuple[str, ...]
    actuators: FloatArray
    forces: FloatArray
    channels: tuple[str, ...]
    readings: FloatArray
    sigma: FloatArray
    actuator_sigma: FloatArray
    coordinates: tuple[str, ...]
    given_targets: FloatArray
    target_channels: tuple[int, ...]
    covariates: Mapping[str, FloatArray]
    labels: Mapping[str, StoredTexts]
    session: IntArray
    sessions: tuple[str, ...]
    file_index: IntArray
    files: tuple[str, ...]
    sha256: tuple[str, ...]
    line: IntArray
    notes: tuple[str, ...] = ()
    warnings: tuple[Fault, ...] = ()
    dates: Span | None = None

    def __len__(self) -> int:
        return len(self.line)

    @property
    def inputs(self) -> dict[str, str]:
        """sha256 by name of the files."""
        return dict(zip(self.files, self.sha256, strict=True))

    @property
    def location(self) -> Location | None:
        """The table, None for several: what is said of one of them names it."""
        return Location(self.files[0]) if len(self.files) == 1 else None

    @property
    def dated(self) -> dict[str, str]:
        """When it was measured, as a provenance has it; {} where no times are dates."""
        if self.dates is None:
            return {}
        first, last = ((d + timedelta(seconds=0.5)).isoformat(timespec="seconds") for d in self.dates)
        return {"measured_from": first, "measured_to": last}

    @property
    def has_actuators(self) -> bool:
        """Whether any actuator reading is there."""
        return not np.isnan(self.actuators).all()

    @property
    def measured(self) -> NDArray[np.bool_]:
        """Whether a channel was measured (N, C)."""
        return ~np.isnan(self.readings)

    @property
    def targets(self) -> FloatArray:
        """TCP coordinates (N, K): from a column of their own, else the only sensor's channel; NaN without."""
        out = np.array(self.given_targets)
        for k, channel in enumerate(self.target_channels):
            if channel >= 0:
                out[:, k] = np.where(np.isnan(out[:, k]), self.readings[:, channel], out[:, k])
        return out

    @property
    def partners(self) -> NDArray[np.intp] | None:
        """The row that a measurement joins to each (N,), -1 without; None where no row names another in `to`."""
        names = self.labels.get("to")
        if names is None or not any(names):
            return None
        places = {(int(f), i): row for row, (f, i) in enumerate(zip(self.file_index, self.ids, strict=True)) if i}
        rows = [places.get((int(f), n), -1) if n else -1 for f, n in zip(self.file_index, names, strict=True)]
        return np.array(rows, dtype=np.intp)

    @property
    def ids(self) -> Sequence[str]:
        """The `id` of every row, "" without."""
        return self.labels.get("id", ("",) * len(self))

    @property
    def named_sessions(self) -> tuple[str, ...]:
        """Sessions that the column or one of several files names; none where one file alone has no column."""
        return self.sessions if len(self.sessions) > 1 or "session" in self.labels else ()

    def row_origin(self, row: int) -> str:
        """Where a row stands: "session1.csv:17", with its id "session1.csv:17 (p15)"."""
        name = self.labels["id"][row] if "id" in self.labels else ""
        return f"{self.files[self.file_index[row]]}:{self.line[row]}" + (f" ({name})" if name else "")

    def take(self, rows: Rows) -> Measurements:
        """Some rows, in the order of `rows` (slice, indices or mask); `sessions` and `files` stay."""
        chosen = rows if isinstance(rows, slice) or len(rows) else slice(0, 0)
        index = np.arange(len(self))[chosen if isinstance(chosen, slice) else np.asarray(chosen)]
        arrays = {name: _take(getattr(self, name), index) for name in _ARRAYS}
        return replace(
            self,
            **arrays,
            covariates={name: values[index] for name, values in self.covariates.items()},
            labels={name: StoredTexts(texts[i] for i in index) for name, texts in self.labels.items()},
        )


_ARRAYS = tuple(f.name for f in fields(Measurements) if f.type in ("FloatArray", "IntArray"))


def absent(rows: int, columns: int) -> FloatArray:
    """NaN (rows, columns) that takes no memory."""
    return np.broadcast_to(np.nan, (rows, columns))


def concatenate(parts: Iterable[Measurements]) -> Measurements:
    """All rows of measurements of one machine, in order; sessions of one name are one, and so are files.

    Covariates and labels that a part lacks are NaN and "" in its rows. Raises ValueError without parts, or
    when they are of different machines.
    """
    joiner = _Joiner()
    for part in parts:
        joiner.add(part)
    return joiner.finish()


class _Joiner:
    """Collects arrays and lets go of the parts, so that memory holds the rows hardly more than once."""

    def __init__(self) -> None:
        self.first: Measurements | None = None
        self.arrays: dict[str, list[Any]] = {name: [] for name in _ARRAYS}
        self.covariates: dict[str, list[FloatArray]] = {}
        self.labels: dict[str, list[StoredTexts]] = {}
        self.sizes: list[int] = []
        self.sessions: dict[str, int] = {}
        self.files: dict[tuple[str, str], int] = {}
        self.notes: dict[str, None] = {}

    def add(self, part: Measurements) -> None:
        if self.first is None:
            self.first = part.take(slice(0, 0))
        if (part.actuator_names, part.channels) != (self.first.actuator_names, self.first.channels):
            raise ValueError("the parts are not of one machine")
        for name, pieces in self.arrays.items():
            pieces.append(getattr(part, name))
        self.arrays["session"][-1] = _renumber(part.session, part.sessions, self.sessions)
        files = list(zip(part.files, part.sha256, strict=True))
        self.arrays["file_index"][-1] = _renumber(part.file_index, files, self.files)
        for name, values in part.covariates.items():
            gaps = [np.full(size, np.nan) for size in self.sizes]
            self.covariates.setdefault(name, gaps).append(values)
        for label, texts in part.labels.items():
            self.labels.setdefault(label, [_blank(size) for size in self.sizes]).append(texts)
        self.sizes.append(len(part))
        for columns in self.covariates.values():
            columns += [np.full(len(part), np.nan)] * (len(self.sizes) - len(columns))
        for lists in self.labels.values():
            lists += [_blank(len(part))] * (len(self.sizes) - len(lists))
        self.notes |= dict.fromkeys(part.notes)

    def finish(self) -> Measurements:
        if self.first is None:
            raise ValueError("nothing to concatenate")
        total = sum(self.sizes)
        return replace(
            self.first,
            **{name: _join(self.arrays.pop(name), total) for name in _ARRAYS},
            covariates={name: _join(self.covariates.pop(name), total) for name in list(self.covariates)},
            labels={name: StoredTexts.of_parts(parts) for name, parts in self.labels.items()},
            sessions=tuple(self.sessions),
            files=tuple(name for name, _ in self.files),
            sha256=tuple(digest for _, digest in self.files),
            notes=tuple(self.notes),
        )


def _renumber(index: IntArray, names: Sequence[Any], known: dict[Any, int]) -> IntArray:
    """The index (n,) into the names as one into the known names, to which new ones are added."""
    places = np.array([known.setdefault(name, len(known)) for name in names], dtype=np.int64)
    if len(names) == 1:
        return np.broadcast_to(places[0], index.shape)
    return places[index]


def _blank(rows: int) -> StoredTexts:
    return StoredTexts([""] * rows)


def _is_absent(array: FloatArray) -> bool:
    return array.ndim == 2 and array.strides == (0, 0) and bool(np.isnan(array).all())


def _take(array: Any, index: IntArray) -> Any:
    return absent(len(index), array.shape[1]) if _is_absent(array) else array[index]


def _join(pieces: list[Any], total: int) -> Any:
    if all(_is_absent(piece) for piece in pieces):
        return absent(total, pieces[0].shape[1])
    return pieces[0] if len(pieces) == 1 else np.concatenate(pieces)
