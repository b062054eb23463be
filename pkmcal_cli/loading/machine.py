"""From files to what the commands work on: compiled machine, parameter values, measurements."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pkmcal_cli.base.errors import BadInput, Fault, FaultList, Location
from pkmcal_cli.base.plural import count
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.compiler import Compiled, compile_machine
from pkmcal_cli.compiler.assemble import BadDrawing
from pkmcal_cli.compiler.faults import drawing_fault, mechanism_faults, structure_faults
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.language.machine_yaml import read_machine
from pkmcal_cli.model.model import Model

if TYPE_CHECKING:
    from pkmcal_cli.tables.measurement_set import Measurements


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

    @property
    def inputs(self) -> dict[str, str]:
        """sha256 by name of the machine's file and of those that it extends."""
        return dict(self.machine.files)


def load_machine(path: str, receptive: bool = False) -> LoadedMachine:
    """Read, compile and check a machine. Raises BadInput with all faults of the stage that fails.

    `receptive`: effects that it does not declare can enter too.
    """
    machine = read_machine(path)
    _raise_errors(structure_faults(machine))
    try:
        compiled = compile_machine(machine, receptive)
    except BadDrawing as error:
        raise BadInput([drawing_fault(machine, error)]) from None
    except np.linalg.LinAlgError as error:
        what, hint = "the numbers of this machine leave nothing to compute with", "are lengths and stiffnesses right?"
        raise BadInput.single(what, Location(machine.files[0][0]), hint, "machine") from error
    except (ValueError, KeyError) as error:
        what = f"this machine cannot be built: {error.args[0] if error.args else error}"
        raise BadInput.single(what, Location(machine.files[0][0]), code="machine") from error
    warnings = _raise_errors(mechanism_faults(machine, compiled))
    return LoadedMachine(machine, compiled, (*machine.warnings, *warnings))


def _raise_errors(found: Sequence[Fault]) -> list[Fault]:
    """The warnings among faults; raises BadInput with the errors."""
    faults = FaultList()
    for fault in found:
        faults.add(fault)
    faults.raise_if_any()
    return faults.warnings


@dataclass(frozen=True)
class Start:
    """Parameter values (P,), SI, of a file or nominal; its sha256 by name; what is to be said of it.

    covariance: names and matrix (p, p), SI, where the file tells them.
    """

    values: Array
    inputs: dict[str, str]
    warnings: tuple[str, ...] = ()
    covariance: tuple[tuple[str, ...], Array] | None = None


def load_parameters(model: Model, path: str | None) -> Start:
    """Nominal parameter values, or those of a parameter file. Raises BadInput."""
    from pkmcal_cli.loading.parameter_file import read_parameters

    values = model.nominal
    if path is None:
        return Start(values, {})
    read = read_parameters(path, model.parameters, model.fingerprint)
    for name, value in read.values.items():
        values[model.names.index(name)] = value
    told = [] if read.status in (None, "converged") else [f"warning: {path}: the fit ended as `{read.status}`"]
    far = [p.name for p, v in zip(model.parameters, values, strict=True) if not p.bounds[0] <= v <= p.bounds[1]]
    told += [f"warning: {path}: outside the machine file's bounds: {', '.join(far)}"] if far else []
    told += [f"note: {path}: values of other sessions are not used: {', '.join(read.others)}"] if read.others else []
    if not read.of_machine:
        told.append(f"note: {path}: no fingerprint: nothing says which machine these values belong to")
    return Start(values, {read.file: read.sha256}, tuple(told), read.covariance)


def load_measurements(loaded: LoadedMachine, paths: Sequence[str]) -> Measurements:
    """Measured rows of one or several files. Raises BadInput."""
    from pkmcal_cli.tables.measurements import read_measurements

    found = read_measurements(list(paths), loaded.machine, "measured")
    return replace(found, notes=(*found.notes, *_without_sigma(found, loaded.model)))


def _without_sigma(found: Measurements, model: Model) -> list[str]:
    """Channels that were read, but nobody says how surely."""
    stated = dict(zip((c.name for c in model.channels), (c.sigma for c in model.channels), strict=True))
    lost = np.isfinite(found.readings) & ~np.isfinite(found.sigma) & ~np.isfinite([stated[n] for n in found.channels])
    return [
        f"`{name}` not used in {count(int(n), 'row')}: neither the machine nor the table states a sigma"
        for name, n in zip(found.channels, lost.sum(axis=0), strict=True)
        if n
    ]
