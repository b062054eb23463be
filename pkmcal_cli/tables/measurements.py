"""Reads measurement files for a machine: all faults at once, everything in SI, nothing dropped in silence."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from pkmcal_cli.base.errors import MAX_FAULTS, BadInput, Fault, FaultList, Location
from pkmcal_cli.base.files import identity, input_name, is_stream
from pkmcal_cli.base.plural import listed
from pkmcal_cli.base.stored_texts import StoredTexts
from pkmcal_cli.csv_files.cell_values import Chunk, FaultLog, FloatArray, IntArray
from pkmcal_cli.csv_files.cells import has_zone, time_of
from pkmcal_cli.csv_files.dialect import Flaw
from pkmcal_cli.csv_files.reader import TableReader, no_rows, open_table
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.tables.column_binding import Binding, bind
from pkmcal_cli.tables.column_doubts import ColumnDoubts
from pkmcal_cli.tables.column_needs import Bound, Require
from pkmcal_cli.tables.columns import Column, Role, channel_of_target, columns_of, coordinates_of
from pkmcal_cli.tables.label_notes import label_notes
from pkmcal_cli.tables.measurement_set import Measurements, absent, concatenate
from pkmcal_cli.tables.partners import check_partners, partner_notes
from pkmcal_cli.tables.serial_days import Span
from pkmcal_cli.tables.silent_sensors import TableUse, silent_sensors
from pkmcal_cli.tables.time_order import time_order_notes
from pkmcal_cli.tables.touches import Touches, implied_touches, unclear_touches

__all__ = [
    "Column", "MeasurementStream", "Measurements", "Require", "columns_of", "concatenate",
    "read_measurements",
]  # fmt: skip


def read_measurements(paths: Sequence[Path | str], machine: Machine, require: Require = "measured") -> Measurements:
    """All rows of measurement files (`-`: stdin), each file a session unless it has a column `session`.

    `require` says what the rows must have: "actuators" their readings; "poses" these or TCP coordinates; "targets" TCP
    coordinates; "measured" readings and at least one column of a channel. Raises BadInput with all faults of all files.
    """
    stream = MeasurementStream(paths, machine, require)
    measurements = concatenate(stream)
    check_partners(measurements, machine)
    of_labels = (*label_notes(measurements), *partner_notes(measurements, machine))
    notes = (*stream.notes, *of_labels, *time_order_notes(measurements))
    return replace(measurements, notes=notes, warnings=stream.warnings, dates=stream.dates)


class MeasurementStream:
    """Measurements read block by block, for tables larger than memory.

    Iterating gives the rows, and at the end raises BadInput with all faults of all files. `notes`, `warnings` and
    `dates` are complete then.
    """

    def __init__(self, paths: Sequence[Path | str], machine: Machine, require: Require = "measured") -> None:
        self.paths, self.machine, self.require = tuple(paths), machine, require
        self.notes: tuple[str, ...] = ()
        self.warnings: tuple[Fault, ...] = ()
        self.dates: Span | None = None

    def __iter__(self) -> Iterator[Measurements]:
        faults, total, notes = list(_twice(self.paths)), 0, []
        clock, files = _Clock(), []
        for path, session in zip(self.paths, _session_names(self.paths), strict=True):
            file = _File(machine=self.machine, require=self.require, session=session, clock=clock)
            try:
                for part in file.read(path):
                    if not faults:
                        yield part
            except BadInput as error:
                faults += error.faults
                total += error.total - len(error.faults)
            notes += [f"{input_name(path)}: {note}" for note in file.notes]
            files.append(file)
        if not faults and self.require == "measured":
            faults = self._silent(files)
        self.notes = (*notes, *clock.notes)
        self.warnings += tuple(doubt for file in files for doubt in file.doubts)
        if spans := [file.dates for file in files if file.dates is not None]:
            self.dates = min(first for first, _ in spans), max(last for _, last in spans)
        if faults:
            raise BadInput(faults[:MAX_FAULTS], total + len(faults))

    def _silent(self, files: Sequence[_File]) -> list[Fault]:
        """Errors of sensors without a reading; their warnings are kept."""
        faults = FaultList()
        for fault in silent_sensors(self.machine, [file.use for file in files if file.use]):
            faults.add(fault)
        self.warnings = tuple(faults.warnings)
        return faults.errors


@dataclass
class _Clock:
    """The origin of ISO 8601 times: the first one of all files, in seconds since 1970."""

    origin: float | None = None
    notes: tuple[str, ...] = ()
    plain: str = ""  # a file whose times are seconds

    def start(self, reader: TableReader, binding: Binding, log: FaultLog) -> None:
        """Take the origin from the first file that has dates; files with and without do not go together."""
        bound = binding.named("time")
        if bound is None:
            return
        first = reader.first_cell(bound.index)
        if binding.column_rules.kinds[bound.index] != "time":
            self.plain = self.plain or reader.name
        elif self.origin is None:
            zone = has_zone(first)
            self.origin = time_of(zone)(first)
            text = datetime.fromtimestamp(self.origin, UTC).isoformat() if zone else first
            self.notes = (f"`time` is counted from {text}, the first row of {reader.name}",)
        if self.plain and self.origin is not None:
            message = f"column `time` has dates in one file and numbers in another ({self.plain})"
            line, hint = reader.format.header_line, "use dates in all files, or numbers in all"
            log.add(Flaw("csv-time", message, hint, line, bound.index), reader.header_source())


@dataclass(kw_only=True)
class _File:
    """One file on its way to measurements."""

    machine: Machine
    require: Require
    session: str
    clock: _Clock
    notes: list[str] = field(default_factory=list)
    rows: int = 0
    gaps: Counter[str] = field(default_factory=Counter)  # empty cells of channels and forces
    idle: int = 0  # rows in which nothing was measured
    use: TableUse | None = None
    columns: ColumnDoubts = field(default_factory=ColumnDoubts)
    doubts: tuple[Fault, ...] = ()
    dates: Span | None = None
    touches: Touches = field(default_factory=lambda: Touches({}))

    def read(self, path: Path | str) -> Iterator[Measurements]:
        """The rows block by block; raises BadInput with the faults at the end."""
        with open_table(path) as reader:
            log = FaultLog(reader.name)
            binding = bind(reader, self.machine, self.require, log)
            self.clock.start(reader, binding, log)
            self.touches = implied_touches(
                self.machine, {b.column.name for b in binding.of("channel")}, self.require == "measured"
            )
            if self.touches.unclear:
                message, hint = unclear_touches(self.touches.unclear)
                log.add(Flaw("csv-missing", message, hint, reader.format.header_line), reader.header_source())
            for chunk in reader.chunks(binding.column_rules, log):
                self.rows += len(chunk.lines)
                if not log.total:
                    part = self._convert(chunk, binding, reader)
                    self._count(part, binding)
                    yield part
            if not self.rows and not log.total:
                log.add(no_rows(reader))
            self.use = TableUse.of(reader, {c for c, n in self.gaps.items() if n < self.rows}, binding.spare)
            touches = self.touches.note(self.machine, self.rows)
            self.notes += [*reader.notes, *binding.notes, *([touches] if touches else []), *self._counts(binding)]
            log.raise_if_any()
            self.doubts = self.columns.warnings(binding, reader)
            self.dates = self.columns.dates(binding, self.clock.origin)

    def _convert(self, chunk: Chunk, binding: Binding, reader: TableReader) -> Measurements:
        machine, rows = self.machine, len(chunk.lines)
        drives = tuple(machine.actuators)
        channels = tuple(c.name for c in binding.known if c.role == "channel")
        coordinates, channel_names = coordinates_of(machine), channel_of_target(machine)
        places = tuple(channels.index(channel_names[c]) if c in channel_names else -1 for c in coordinates)
        get = _Getter(chunk, binding, rows, self.clock.origin)
        labels = {b.column.name: StoredTexts(chunk.texts[b.index]) for b in binding.of("label")}
        sessions, session = self._sessions(labels, rows)
        forces = get.stack([f"{name}.force" for name in drives], "force")
        return Measurements(
            actuator_names=drives,
            actuators=get.stack(drives, "actuator"),
            forces=forces,
            channels=channels,
            readings=self._touched(get.stack(channels, "channel"), channels),
            sigma=get.stack([f"sigma.{c}" for c in channels], "sigma"),
            actuator_sigma=get.stack([f"sigma.{name}" for name in drives], "sigma"),
            coordinates=coordinates,
            given_targets=get.stack(coordinates, "target"),
            target_channels=places,
            covariates={b.column.name: get.values(b) for b in binding.of("covariate")},
            labels=labels,
            session=session,
            sessions=sessions,
            file_index=np.broadcast_to(np.int64(0), (rows,)),
            files=(reader.name,),
            sha256=(reader.sha256,),
            line=chunk.lines,
        )

    def _touched(self, readings: FloatArray, channels: tuple[str, ...]) -> FloatArray:
        """Readings (n, C) with those of a probe that touches in every row."""
        if not self.touches.readings:
            return readings
        out = np.array(readings)
        for name, reading in self.touches.readings.items():
            out[:, channels.index(name)] = reading
        return out

    def _sessions(self, labels: Mapping[str, StoredTexts], rows: int) -> tuple[tuple[str, ...], IntArray]:
        """Names and index (n,): of the column `session`, else the file's."""
        texts = labels.get("session")
        if texts is None:
            return (self.session,), np.broadcast_to(np.int64(0), (rows,))
        names: dict[str, int] = {}
        index = np.array([names.setdefault(text, len(names)) for text in texts], dtype=np.int64)
        return tuple(names), index

    def _count(self, part: Measurements, binding: Binding) -> None:
        for name, values in zip(part.channels, part.readings.T, strict=True):
            self.gaps[name] += int(np.isnan(values).sum())
        for name, values in zip(part.actuator_names, part.forces.T, strict=True):
            self.gaps[f"{name}.force"] += int(np.isnan(values).sum())
        self.columns.add(part.covariates, binding)
        self.idle += int((~part.measured.any(axis=1)).sum())

    def _counts(self, binding: Binding) -> list[str]:
        """What was not measured, counted."""
        notes = []
        for name, actuator in self.machine.actuators.items():
            declared = actuator.force is not None and actuator.force.column is not None
            expected = actuator.control == "force" and (declared or binding.named(f"{name}.force"))
            if expected and (n := self.gaps[f"{name}.force"]):
                unit = next(c for c in binding.known if (c.name, c.role) == (f"{name}.force", "force")).si_unit
                assert actuator.force is not None and actuator.force.otherwise is not None
                used = unit.format(actuator.force.otherwise.number(self.machine.nominal_values()), 6)
                text = f"no force of {name} in {n} of {self.rows} rows: the force of the machine file is used, {used}"
                notes.append(text)
        if self.require != "measured":
            return notes
        channels = [c for c in binding.known if c.role == "channel"]
        channel_names = {b.column.name for b in binding.of("channel")}
        some: dict[int, list[str]] = {}
        for column in channels:
            if column.name in channel_names and (n := self.gaps[column.name]):
                some.setdefault(n, []).append(f"`{column.name}`")
        notes += [f"{listed(names)} not measured in {n} of {self.rows} rows" for n, names in some.items()]
        known = {*channel_names, *self.touches.readings}
        if lost := [f"`{c.header}`" for c in channels if c.name not in known]:
            notes.append(f"no columns for channels: {listed(lost)}")
        return notes + ([f"no measurements in {self.idle} of {self.rows} rows"] if self.idle else [])


@dataclass(frozen=True)
class _Getter:
    """Columns of a chunk in SI."""

    chunk: Chunk
    binding: Binding
    rows: int
    origin: float | None

    def values(self, bound: Bound) -> FloatArray:
        """Values (n,) of a column."""
        values = self.chunk.numbers[bound.index]
        if self.binding.column_rules.kinds[bound.index] == "time":
            return np.asarray(values - (self.origin or 0.0))
        return bound.to_si(values)

    def stack(self, names: Sequence[str], role: Role) -> FloatArray:
        """Values (n, len(names)), NaN where the file has no column."""
        columns = [b for b in self.binding.of(role) if b.column.name in names]
        if not columns:
            return absent(self.rows, len(names))
        out = np.full((self.rows, len(names)), np.nan)
        for bound in columns:
            out[:, names.index(bound.column.name)] = self.values(bound)
        return out


def _twice(paths: Sequence[Path | str]) -> Iterator[Fault]:
    """Files that are given twice."""
    seen: set[object] = set()
    for path in paths:
        key = identity(path) or str(path)
        if key in seen:
            yield Fault("file", "this file is given twice", Location(input_name(path), 1), "give it only once")
        seen.add(key)


def _session_names(paths: Sequence[Path | str]) -> list[str]:
    """The stems of the files; where two are alike, with their folders."""
    stems = ["stdin" if is_stream(path) else Path(path).stem for path in paths]
    full = ["stdin" if is_stream(path) else os.path.splitext(path)[0] for path in paths]
    return [name if stems.count(name) == 1 else whole for name, whole in zip(stems, full, strict=True)]
