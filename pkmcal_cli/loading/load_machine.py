"""From files to what the commands work on: compiled machine, parameter values, measurements."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pkmcal_cli.base.errors import BadInput, Fault, Location, warnings_among
from pkmcal_cli.base.plural import count, listed
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.compiler import Compiled, compile_machine
from pkmcal_cli.compiler.assemble import BadConfiguration
from pkmcal_cli.compiler.faults import configuration_fault, mechanism_faults, structure_faults
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.language.machine_yaml import read_machine
from pkmcal_cli.loading.evidence import Evidence
from pkmcal_cli.loading.unit_slips import unit_slips
from pkmcal_cli.loading.unknown_sessions import NOTHING_UNKNOWN, UnknownSessions, unknown_sessions, with_ranges
from pkmcal_cli.model.model import Model

if TYPE_CHECKING:
    from pkmcal_cli.tables.measurement_set import Measurements


_CHANGES_NOTHING = "unused-name"
"""Code of warnings that concern no result."""
NO_SENSORS = "the machine has no sensors: nothing can be measured with it"
SENSOR = "declare one, for example `sensors: {tracker: {at: NAME, reads: [x, y], sigma: 10 um, frame: machine}}`"


@dataclass(frozen=True)
class LoadedMachine:
    """A machine without faults, compiled; `warnings` for every command to tell, `remarks` for `check` alone."""

    machine: Machine
    compiled: Compiled
    warnings: tuple[Fault, ...]
    remarks: tuple[Fault, ...] = ()

    @property
    def model(self) -> Model:
        """The compiled model."""
        return self.compiled.model

    def for_sessions(self, names: tuple[str, ...]) -> LoadedMachine:
        """The same with what each session of a table has for itself."""
        return replace(self, compiled=replace(self.compiled, model=self.model.for_sessions(names)))

    @property
    def inputs(self) -> dict[str, str]:
        """sha256 by name of the machine's file and of those that it extends."""
        return dict(self.machine.files)


def load_machine(path: str, receptive: bool = False, tables: Sequence[str] = ()) -> LoadedMachine:
    """Read, compile and check a machine. Raises BadInput with all faults of the stage that fails, and of its tables.

    `receptive`: effects that it does not declare can enter too; tables: measurements that are read next.
    """
    try:
        return loaded_machine(read_machine(path), receptive)
    except BadInput as error:
        if not tables or error.is_unreadable:
            raise
        from pkmcal_cli.tables.table_faults import with_tables

        raise with_tables(error, path, tables) from error


def loaded_machine(machine: Machine, receptive: bool = False) -> LoadedMachine:
    """Compile and check a machine that was read. Raises BadInput with all faults of the stage that fails."""
    warnings_among(structure_faults(machine))
    try:
        compiled = compile_machine(machine, receptive)
    except BadConfiguration as error:
        raise BadInput([configuration_fault(machine, error)]) from None
    except np.linalg.LinAlgError as error:
        message, hint = "the equations of this machine are singular", "check the lengths and stiffnesses"
        raise BadInput.single(message, Location(machine.files[0][0]), hint, "machine") from error
    except (ValueError, KeyError) as error:
        message = f"this machine cannot be built: {error.args[0] if error.args else error}"
        raise BadInput.single(message, Location(machine.files[0][0]), code="machine") from error
    warnings = warnings_among(mechanism_faults(machine, compiled))
    remarks = tuple(w for w in machine.warnings if w.code == _CHANGES_NOTHING)
    doubts = (w for w in machine.warnings if w.code != _CHANGES_NOTHING)
    return LoadedMachine(machine, compiled, (*doubts, *warnings, *_slips(machine, compiled)), remarks)


def _slips(machine: Machine, compiled: Compiled) -> list[Fault]:
    """Doubts about units, but for places that have one already."""
    reported = {fault.where for fault in machine.warnings if fault.code == "magnitude"}
    model = compiled.model
    slips = unit_slips(machine, model.length, model.base.targets(model.topology.coefficients))
    return [fault for fault in slips if fault.where not in reported]


@dataclass(frozen=True, kw_only=True)
class Start:
    """Parameter values (P,), SI, of a file or nominal; its sha256 by name; what is to be said of it.

    covariance: names and matrix (p, p), SI, and evidence, where the file tells them. unknown: of which sessions it says
    nothing. doubted: names of its parameters, where its fit is not to be believed.
    """

    values: Array
    inputs: dict[str, str]
    warnings: tuple[str, ...] = ()
    covariance: tuple[tuple[str, ...], Array] | None = None
    evidence: Evidence | None = None
    unknown: UnknownSessions = NOTHING_UNKNOWN
    doubted: tuple[str, ...] = ()

    def doubts(self, fitted: Collection[str]) -> tuple[str, ...]:
        """Why a calibration is not to be believed that keeps values of the file; fitted: those that it determines."""
        kept = [n for n in self.doubted if n not in fitted]
        words = f"values that are kept of {next(iter(self.inputs), '')} are of a fit that is not to be believed"
        return (f"{words}: {listed(kept, 3)}",) if kept else ()

    def remarks(self, named: bool, fitted: Collection[str] = ()) -> tuple[str, ...]:
        """What every command says of the file that it takes: also of sessions that the file does not know.

        named: whether the rows name their sessions; fitted: parameters that the command determines itself.
        """
        return (*self.warnings, *self.unknown.warning(next(iter(self.inputs), ""), named, fitted))


def load_parameters(model: Model, path: str | None) -> Start:
    """Nominal parameter values, or those of a parameter file. Raises BadInput."""
    from pkmcal_cli.loading.parameter_file import read_parameters

    values = model.nominal
    if path is None:
        return Start(values=values, inputs={})
    read = read_parameters(path, model.parameters, model.fingerprint)
    for name, value in read.values.items():
        values[model.names.index(name)] = value
    warnings = list(read.ending.remarks(path))
    far = [p.name for p, v in zip(model.parameters, values, strict=True) if not p.bounds[0] <= v <= p.bounds[1]]
    warnings += [f"warning: {path}: parameters outside the bounds of the machine file: {', '.join(far)}"] if far else []
    warnings += [f"note: {path}: values of {_of_others(read.others)}"] if read.others else []
    if read.spoilt:
        lacking = "names, std and matrix are not all there, of one size"
        warnings.append(f"warning: {path}: `correlations`: {lacking}: the uncertainties in this file are not used")
    if not read.of_machine:
        warnings.append(f"note: {path}: no fingerprint: cannot check which machine these values belong to")
    unknown, covariance = NOTHING_UNKNOWN, read.covariance
    off = (n for n, v in read.values.items() if v != model.nominal[model.names.index(n)])
    doubted = () if read.ending.believed else tuple(off)
    of_sessions = {p.name for p in model.parameters if p.session or p.per_session}
    if covariance is not None or read.others or not of_sessions.isdisjoint(read.values):
        unknown = unknown_sessions(model, read.values, read.others)
    if covariance is not None:
        covariance = with_ranges(model, covariance, unknown.zeros)
    return Start(
        values=values, inputs={read.file: read.sha256}, warnings=tuple(warnings), covariance=covariance,
        evidence=read.evidence, unknown=unknown, doubted=doubted,
    )  # fmt: skip


def _of_others(names: Sequence[str]) -> str:
    """What is said of values that are not used; a name without a session: of a table without the column `session`."""
    sessions = [n for n in names if n.endswith("]")]
    nameless = [n for n in names if n not in sessions]
    words = [f"other sessions are not used: {', '.join(sessions)}"] if sessions else []
    return "; of ".join(words + ([f"a session without a name are not used: {', '.join(nameless)}"] if nameless else []))


def load_measurements(loaded: LoadedMachine, paths: Sequence[str]) -> Measurements:
    """Measured rows of one or several files. Raises BadInput, also where the machine has nothing to measure with."""
    if not loaded.model.channels:
        raise BadInput.single(NO_SENSORS, Location(loaded.model.name), SENSOR, "sensors")
    from pkmcal_cli.tables.measurements import read_measurements

    measurements = read_measurements(list(paths), loaded.machine, "measured")
    return replace(measurements, notes=(*measurements.notes, *_without_sigma(measurements, loaded.model)))


def _without_sigma(measurements: Measurements, model: Model) -> list[str]:
    """Channels that were read, but nobody says how surely."""
    stated = dict(zip((c.name for c in model.channels), (c.sigma for c in model.channels), strict=True))
    lost = (
        np.isfinite(measurements.readings)
        & ~np.isfinite(measurements.sigma)
        & ~np.isfinite([stated[n] for n in measurements.channels])
    )
    return [
        f"`{name}` not used in {count(int(n), 'row')}: neither the machine file nor the table gives a sigma"
        for name, n in zip(measurements.channels, lost.sum(axis=0), strict=True)
        if n
    ]
