"""What a machine is, and every fault of machine and tables."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pkmcal_cli.base.errors import MAX_FAULTS, BadInput, Fault, UsageError
from pkmcal_cli.base.files import sha256
from pkmcal_cli.base.plural import count, listed
from pkmcal_cli.compiler.assemble import coordinate_name
from pkmcal_cli.compiler.paths import path_of
from pkmcal_cli.loading.load_machine import LoadedMachine, load_machine, load_parameters
from pkmcal_cli.model.singular_drives import hardly_held, singular_drives
from pkmcal_cli.prediction.drawn_stability import unstable_motion
from pkmcal_cli.prediction.influence import idle_parameters
from pkmcal_cli.report.console import Reporter, emit_json, enveloped
from pkmcal_cli.report.machine_report import machine_json, show_machine
from pkmcal_cli.report.number_format import readable
from pkmcal_cli.report.provenance import provenance
from pkmcal_cli.units.dimensions import ANGLE, LENGTH
from pkmcal_cli.units.unit_text import Unit
from pkmcal_cli.workflow.arguments import one_stdin

if TYPE_CHECKING:
    from pkmcal_cli.tables.measurement_set import Measurements

_SHARE = 0.3  # of the largest amount of a motion, from which on a coordinate is told
_LISTED = 3
_STIFFEN = (
    "stiffen this motion (a stiffness, a member, a joint or a drive that holds it), reduce the load or the force that "
    "drives it, or draw the pose that the machine falls to"
)
_TENSION = "set values that tension the ropes hold it, as `pkmcal correct` gives them"
_UNSTATED = "; state `t_min` of the ropes"


@dataclass(frozen=True, kw_only=True)
class CheckRequest:
    """The arguments of `check`."""

    machine: str
    measurements: tuple[str, ...] | None
    parameters: str | None
    tolerance: str | None
    as_json: bool
    quiet: bool
    style: str

    @property
    def tables(self) -> tuple[str, ...]:
        """Tables to check."""
        return self.measurements or ()

    @property
    def others(self) -> tuple[str, ...]:
        """Further machines, which stand where tables do."""
        return tuple(name for name in self.tables if name.lower().endswith((".yaml", ".yml")))

    def require_both(self) -> None:
        """Raises UsageError for half of what it needs to compare a table with parameters."""
        if self.parameters is None and self.tolerance is not None:
            raise UsageError("--tolerance needs parameters", hint="add `-p PARAMS.yaml`, written by `calibrate -o`")
        if self.parameters is not None and not self.tables:
            raise UsageError("-p: there is no table to compare with the parameters", hint="add the table: AFTER.csv")


def run_check(request: CheckRequest) -> int:
    """Show and emit; 0 without faults, 1 with faults in machine or tables, or where a table does not agree with
    parameters. Raises BadInput for unreadable files, and UsageError.
    """
    as_json = request.as_json
    if request.others:
        return _run_several(request)
    one_stdin(request.machine, *request.tables, request.parameters)
    request.require_both()
    tolerance = _tolerance(request.tolerance)
    to = Reporter(request.quiet, request.style)
    try:
        loaded = load_machine(request.machine, tables=request.tables)
    except BadInput as error:
        _reraise_unreadable(error)
        return _finish(_End(to, as_json, {}, _named_files(request)), list(error.faults), error.total)
    result, faults = _show_machine(loaded, request, to)
    total, agrees, inputs = len(faults), True, loaded.inputs
    if request.tables:
        from pkmcal_cli.workflow.check_tables import check_tables

        measured = _read(loaded, request.tables)
        if isinstance(measured, BadInput):
            result["measurements"] = {"n_rows": None}
            end = _End(to, as_json, result, inputs | _named_files(request))
            return _finish(end, faults + list(measured.faults), total + measured.total)
        start = load_parameters(loaded.model.for_sessions(measured.named_sessions), request.parameters)
        table = check_tables(loaded, measured, start, to)
        result["measurements"], inputs = table.counts, inputs | measured.inputs | start.inputs
        faults, total = faults + table.faults, total + table.total
        if request.parameters is not None and table.comparable:
            from pkmcal_cli.workflow.verify import verify

            verification = verify(loaded, measured, start, request.parameters, tolerance, to, faulty=table.lost)
            result["verification"], agrees = verification.json(), verification.ok
    return _finish(_End(to, as_json, result, inputs), faults, total, agrees)


def _show_machine(loaded: LoadedMachine, request: CheckRequest, to: Reporter) -> tuple[dict[str, Any], list[Fault]]:
    """What the machine is, with its warnings, shown and as JSON; its faults."""
    result = machine_json(loaded.machine, loaded.compiled)
    show_machine(to, loaded.machine, loaded.compiled, result, tables=request.parameters is None)
    unstable = unstable_faults(loaded)
    warnings = [*loaded.remarks, *loaded.warnings, *_singular_fault(loaded), *_substructure_fault(loaded)]
    warnings += [f for f in unstable if f.severity == "warning"]
    for fault in warnings:
        to.warn(fault)
    result["warnings"] = [_json(f) for f in warnings]
    return result, [*idle_faults(loaded), *(f for f in unstable if f.severity == "error")]


def _named_files(request: CheckRequest) -> dict[str, str]:
    """Files on the command line with their sha256, where there is no more to go by."""
    names = (request.machine, *request.tables, request.parameters)
    return {name: sha256(Path(name)) for name in names if name is not None and os.path.isfile(name)}


def _run_several(request: CheckRequest) -> int:
    """Check machines one after the other; 1 with a fault in any. Raises UsageError and BadInput."""
    more = [name for name in request.tables if name not in request.others]
    if more or request.parameters is not None or request.as_json:
        option = f"`{more[0]}`" if more else "--json" if request.as_json else "-p"
        hint = "check one machine with tables, -p or --json; several machines by themselves"
        raise UsageError(f"{option} takes one machine, but `{request.others[0]}` is another", hint=hint)
    files = (request.machine, *request.others)
    return max(run_check(replace(request, machine=file, measurements=None)) for file in files)


def _tolerance(text: str | None) -> tuple[float, Unit] | None:
    """The tolerance, m or rad, and its unit. Raises UsageError."""
    if text is None:
        return None
    from pkmcal_cli.workflow.verify import tolerance_of

    return tolerance_of(text, angles=True)


@dataclass(frozen=True)
class _End:
    """What is told at the end, to whom, and of which files."""

    to: Reporter
    as_json: bool
    result: dict[str, Any]
    inputs: Mapping[str, str]

    def verdict(self, total: int) -> str:
        """In a word: faults first, then the tolerance, then whether all readings agree with the parameters."""
        if total or "verification" not in self.result:
            return "faults" if total else "no_faults"
        verification = self.result["verification"]
        if verification["tolerance"] is not None:
            return str(verification["tolerance"]["verdict"])
        return "compatible" if verification["compatible"] else "not_compatible"


def _finish(end: _End, faults: list[Fault], total: int, agrees: bool = True) -> int:
    """Tell the faults, emit the result; the exit code: 1 also where a table does not agree with parameters."""
    to = end.to
    for fault in faults[:MAX_FAULTS]:
        to.fail(fault)
        to.fail("")
    if total > MAX_FAULTS:
        to.fail(f"... and {total - min(len(faults), MAX_FAULTS)} more faults")
    if end.as_json:
        outcome = {"ok": not total, "n_faults": total, "faults": [_json(f) for f in faults[:MAX_FAULTS]]}
        emit_json(enveloped("check", end.verdict(total), outcome | end.result, provenance(end.inputs)))
    if total or agrees:
        to.say(count(total, "fault") if total else "no faults")
    return 0 if agrees and not total else 1


def _reraise_unreadable(error: BadInput) -> None:
    """A file that cannot be read has not been checked: that is bad input, not a finding."""
    if error.is_unreadable:
        raise error


def _json(fault: Fault) -> dict[str, Any]:
    where = fault.where
    return {
        "code": fault.code,
        "message": fault.what,
        "file": where.file if where else None,
        "line": (where.line or None) if where else None,
        "column": (where.column or None) if where else None,
        "help": fault.hint,
    }


def _singular_fault(loaded: LoadedMachine) -> list[Fault]:
    """A warning where the drawing is in or next to a singular pose of all drives together."""
    name = hardly_held(loaded.model)
    if name is None:
        return []
    message = f"as drawn, the drives hardly hold the platform in {name}: a singular pose is next to it"
    hint = (
        "two assemblies meet there, and rows may be solved in the wrong one: draw a pose in the middle of the "
        "workspace, in the assembly that the machine has (`pkmcal draw` shows it)"
    )
    return [loaded.machine.source.fault("singular", message, ("actuators",), hint, at_key=True, warning=True)]


def _substructure_fault(loaded: LoadedMachine) -> list[Fault]:
    """A warning where the drives that are not redundant do not hold the platform in the whole workspace."""
    substructure = singular_drives(loaded.model)
    if substructure is None:
        return []
    units = loaded.machine.file_units
    names = loaded.model.freedoms.coordinates
    at = ", ".join(
        f"{name} = {readable(float(value), units.unit(LENGTH if name in ('x', 'y', 'z') else ANGLE))}"
        for name, value in zip(names, substructure.pose, strict=True)
    )
    message = f"without the redundant actuators, the platform is not held in part of the workspace, e.g. at {at}"
    hint = "only `--method linear` and `rigid` refer to the actuators that are not redundant; they may fail there"
    if substructure.better:
        hint += f". No such pose was found with {' and '.join(substructure.better[0])} redundant instead"
    source = loaded.machine.source
    return [source.fault("substructure", message, ("actuators",), hint, at_key=True, warning=True)]


def idle_faults(loaded: LoadedMachine) -> list[Fault]:
    """Parameters that act nowhere by structure."""
    source, names = loaded.machine.source, idle_parameters(loaded.model)
    finding = "has no effect on any pose, strained or not"
    hint = (
        "positions of nodes and bodies only define the reference configuration: use the parameter in a `length`, a "
        "body's point or the ground, or remove it"
    )
    return [
        source.fault("idle-parameter", f"parameter `{name}` {finding}", ("parameters", name), hint, at_key=True)
        for name in names
    ]


def unstable_faults(loaded: LoadedMachine) -> list[Fault]:
    """The equilibrium in the reference configuration is a saddle of the energy: no machine stays there.

    A warning where it does once its ropes are tensioned.
    """
    motion = unstable_motion(loaded.model)
    if motion is None:
        return []
    topology, large = loaded.model.topology, abs(motion.amounts) >= _SHARE * abs(motion.amounts[0])
    names = [coordinate_name(topology, int(k)) for k in motion.coordinates[large]]
    message = f"the machine does not stay as it is drawn: this equilibrium is unstable in the {listed(names, _LISTED)}"
    path = path_of(loaded.machine, names[0].rpartition(" ")[2])
    if motion.slack:
        message += ", with ropes that are slack"
    tension = _TENSION if loaded.model.least_tensions else _TENSION + _UNSTATED
    hint = tension if motion.slack else _STIFFEN
    return [loaded.machine.source.fault("unstable", message, path, hint, at_key=True, warning=motion.slack)]


def _read(loaded: LoadedMachine, paths: tuple[str, ...]) -> Measurements | BadInput:
    """The tables, or their faults. Raises BadInput for unreadable files."""
    from pkmcal_cli.loading.load_machine import load_measurements

    try:
        return load_measurements(loaded, paths)
    except BadInput as error:
        _reraise_unreadable(error)
        return error
