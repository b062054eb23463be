"""`compare`: what changed between calibrations; which of two machine files predicts better; the history of runs."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pkmcal_cli.base.errors import BadInput, Location, UsageError
from pkmcal_cli.base.files import is_stream, sha256
from pkmcal_cli.calibration.change_course import Course, likely_course, line_of
from pkmcal_cli.calibration.comparison import changes, chosen_by_all, omnibus
from pkmcal_cli.calibration.data_sets import Common, common
from pkmcal_cli.effects import catalogue
from pkmcal_cli.loading.known_parameters import KnownParameters, known_parameters
from pkmcal_cli.loading.plain_files import yaml_kind
from pkmcal_cli.pictures.comparison_picture import comparison_picture, machines_picture
from pkmcal_cli.pictures.titles import titles
from pkmcal_cli.report.comparison import Compared, ComparisonReport, ToolChange
from pkmcal_cli.report.console import Reporter, emit_json, enveloped
from pkmcal_cli.report.provenance import provenance
from pkmcal_cli.units.dimensions import ANGLE, LENGTH
from pkmcal_cli.workflow.alpha import check_alpha
from pkmcal_cli.workflow.arguments import present
from pkmcal_cli.workflow.compare_machines import compare_machines
from pkmcal_cli.workflow.gates import Figure, Figures, Gate, gates
from pkmcal_cli.workflow.kept_figures import check_kept, kept_figures
from pkmcal_cli.workflow.plots import check_plot, write_plot
from pkmcal_cli.workflow.run_folder import PARAMETERS, RECORD, history, kept_run, show_history
from pkmcal_cli.workflow.tool_change import tool_change


@dataclass(frozen=True, kw_only=True)
class ComparisonRequest:
    """The arguments of `compare`."""

    files: tuple[str, ...]
    machine: str | None
    alpha: float
    fail_above: tuple[str, ...] | None
    plot: str | None
    as_json: bool
    quiet: bool
    style: str
    force: bool


def run_comparison(request: ComparisonRequest) -> int:
    """Compare and show; returns the exit code: 1 where something has changed. Raises PkmcalError."""
    check_alpha(request.alpha)
    to = Reporter(request.quiet, request.style)
    limits = gates(request.fail_above or ())
    if sum(is_stream(t) for t in request.files):
        raise UsageError("compare reads no stdin", hint="give files or folders of runs")
    check_plot(request.plot, present(*request.files, request.machine), force=request.force)
    kinds = [_kind(t) for t in request.files]
    _check_limits(limits, kinds)
    if kinds == ["runs"] and request.plot is not None:
        raise UsageError("--plot: a list of runs has no picture", hint="compare runs: name folders in it")
    if kinds == ["runs"]:
        runs = history(request.files[0])
        show_history(to, runs)
        if request.as_json:
            verdict = "intact" if all(r.intact for r in runs) else "changed since"
            result = {"kind": "history", "runs": [r.json() for r in runs]}
            emit_json(enveloped("compare", verdict, result, provenance({})))
        return 0
    if "runs" in kinds:
        one = request.files[kinds.index("runs")]
        raise UsageError(f"`{one}` is not the folder of one run", hint="name a folder in it, or list all: compare DIR")
    if "machine" in kinds:
        return _machines(request, kinds, limits, to)
    if "table" in kinds:
        raise UsageError("a table is compared by machine files", hint="compare M1.yaml M2.yaml TABLE.csv")
    return _parameters(request, kinds, limits, to)


def _check_limits(limits: Sequence[Gate], kinds: Sequence[str]) -> None:
    """Whether what is compared has what limits name. Raises UsageError."""
    for gate in limits:
        if "machine" in kinds and gate.figure != "heldout":
            message = f"{gate.option}: `{gate.text}` is no limit of two machine files"
            raise UsageError(message, hint='write e.g. "heldout 20 um"')
        if gate.figure == "change" and gate.unit.dimension not in (LENGTH, ANGLE):
            message = f"{gate.option}: `{gate.text}` is no change of the tool point"
            raise UsageError(message, hint='write e.g. "change 20 um"')


def _judge(limits: Sequence[Gate], figures: Figures, location: str, to: Reporter) -> tuple[list[dict[str, Any]], bool]:
    """Limits as JSON has them, and whether one is missed; these are told."""
    judged = [gate.judged(figures) for gate in limits]
    for each in judged:
        if not each.kept:
            to.fail(each.fault(Location(location)))
    return [each.json() for each in judged], any(not each.kept for each in judged)


def _kind(name: str) -> str:
    """What an argument is: "run", "runs", "table", "machine" or "parameters". Raises BadInput."""
    if os.path.isdir(name):
        return "run" if os.path.exists(os.path.join(name, RECORD)) else "runs"
    if os.path.splitext(name)[1].lower() in (".csv", ".txt", ".tsv"):
        return "table"
    return yaml_kind(name)


def _machines(request: ComparisonRequest, kinds: list[str], limits: Sequence[Gate], to: Reporter) -> int:
    """Two machine files on the same held-out rows; limits are for the second one."""
    machines = [t for t, k in zip(request.files, kinds, strict=True) if k == "machine"]
    tables = [t for t, k in zip(request.files, kinds, strict=True) if k == "table"]
    if len(machines) != 2 or not tables or len(machines) + len(tables) < len(kinds):
        hint = "compare M1.yaml M2.yaml TABLE.csv"
        raise UsageError("machine files are compared in pairs, on the rows of a table", hint=hint)
    report = compare_machines(machines[0], machines[1], tuple(tables), to)
    report.show(to)
    if request.plot is not None:
        named = titles(", ".join(os.path.basename(m) for m in machines), "comparison", tables)
        both = (report.errors.first, report.errors.second)
        picture = machines_picture(_short(machines), both, report.unit, report.kind, named)
        write_plot(picture, request.plot, request.files, to, force=request.force)
    rms = Figure(f"held-out {report.kind} rms of {machines[1]}", report.errors.second, report.unit, report.kind)
    figures: Figures = {"heldout": [rms] if report.enough else "too few rows are predicted by both"}
    gates, missed = _judge(limits, figures, tables[0], to)
    if request.as_json:
        emit_json(enveloped("compare", report.verdict, report.json() | {"gates": gates}, _origin(request.files)))
    return int(missed or not report.enough)


def _short(machines: Sequence[str]) -> tuple[str, str]:
    """Names of two machine files for a picture: without folders where they differ without."""
    first, second = (os.path.basename(m) for m in machines)
    return (first, second) if first != second else (machines[0], machines[1])


def _origin(files: Sequence[str]) -> dict[str, Any]:
    """Provenance of a comparison of files."""
    return provenance({name: sha256(Path(name)) for name in files})


def _parameters(request: ComparisonRequest, kinds: list[str], limits: Sequence[Gate], to: Reporter) -> int:
    """What changed between calibrations."""
    files = _parameter_files(request.files, kinds, to)
    known = [known_parameters(f) for f in files]
    for k in known:
        if k.data is None:
            message = (
                "this parameter file has no complete section `data` that matches its values, so it is unknown what its "
                "rows determine"
            )
            hint = "write it again with `pkmcal calibrate -o`; values that are edited no longer match"
            raise BadInput.single(message, Location(k.file), hint, "parameters")
    check_kept(limits, known[-1])
    compared = _compared(known)
    change = None
    if compared.test.dof or any(gate.figure == "change" for gate in limits):
        change = tool_change(request.machine, files, known, compared.likely(request.alpha), to)
    report = ComparisonReport(known, compared, change, request.alpha)
    for text in _warnings(known):
        to.warn(text)
    report.show(to)
    if request.plot is not None:
        machine = next((k.fingerprint.of for k in known if k.fingerprint is not None), "") or "calibrations"
        named = titles(machine, "comparison", files)
        write_plot(comparison_picture(report, named), request.plot, files, to, force=request.force)
    figures = {**kept_figures(known[-1]), "change": _largest(change, report)}
    gates, missed = _judge(limits, figures, files[-1], to)
    if request.as_json:
        result = report.json()
        emit_json(enveloped("compare", result["verdict"], result | {"gates": gates}, _origin(files)))
    return int(missed or not report.unchanged)


def _parameter_files(names: Sequence[str], kinds: Sequence[str], to: Reporter) -> list[str]:
    """Parameter files, also those of runs; runs that have none are left out. Raises UsageError where one is left."""
    out = []
    for name, kind in zip(names, kinds, strict=True):
        if kind != "run":
            out.append(name)
            continue
        run = kept_run(name)
        if not run.intact:
            to.warn(f"warning: {name}: a result is missing or has been changed since")
        if PARAMETERS in run.results:
            out.append(os.path.join(name, PARAMETERS))
        else:
            to.notes([f"{name}: a run of `{run.command}` has no parameters, and is left out"])
    if len(out) < 2:
        raise UsageError("there is nothing to compare it with", hint="give two parameter files or more")
    return out


def _largest(change: ToolChange | str | None, report: ComparisonReport) -> list[Figure] | str:
    """The largest change of the tool point, 0 where the test sees none, or why it is not known."""
    if change is None or isinstance(change, str):
        return change or "not known"
    kind = "orientation" if change.turns else "position"
    label, size = f"largest change of the tool point's {kind}", change.largest
    if report.unchanged:
        label, size = f"{label} (no change is seen)", 0.0
    return [Figure(label, size, change.units[0], kind)]


def _compared(known: Sequence[KnownParameters]) -> Compared:
    """The tests."""
    data = [k.data for k in known if k.data is not None]
    odd = _of_other_kinds(known)
    c = common(data, [k.values for k in known], [_per_campaign(k) | odd for k in known])
    test, contrasts = omnibus(c)
    course, single = likely_course(c, contrasts, test, _line(known)) if test.dof else (_line(known), None)
    chosen = [[n for n, p in k.parameters.items() if np.isfinite(p.std)] for k in known]
    moved = changes(c, chosen_by_all(c, chosen), course.times, test.freedom)
    free = chosen_by_all(c, [[n for n, p in k.parameters.items() if p.asked] for k in known])
    return Compared(
        common=c, test=test, changes=moved, alone=single, apart=_apart(known, c), course=course, free=free
    )


def _per_campaign(known: KnownParameters) -> set[str]:
    """Parameters that a campaign has for itself: those of its sessions, and errors of the measurement."""
    effects = catalogue()
    out = set()
    for name in known.parameters:
        effect = effects.get(name.partition("@")[0]) if "@" in name else None
        if "[" in name or (effect is not None and effect.measurement):
            out.add(name)
    return out


def _of_other_kinds(known: Sequence[KnownParameters]) -> set[str]:
    """Names that mean a length here and an angle there."""
    kinds: dict[str, set[object]] = {}
    for k in known:
        for name, p in k.parameters.items():
            kinds.setdefault(name, set()).add(p.unit.dimension)
    return {name for name, of_name in kinds.items() if len(of_name) > 1}


def _apart(known: Sequence[KnownParameters], c: Common) -> dict[str, tuple[int, ...]]:
    """Parameters that are not compared, each with the files that have it (by number): for lack of a partner, or own."""
    names = dict.fromkeys(n for k in known for n in k.parameters)
    lists = {n: tuple(i for i, k in enumerate(known) if n in k.parameters) for n in names}
    return {n: where for n, where in lists.items() if n not in c.names}


def _line(known: Sequence[KnownParameters]) -> Course:
    """From the first file to the last: by dates where there are more than two. Raises BadInput where one is lacking."""
    if len(known) == 2:
        return Course((0.0, 1.0))
    for k in known:
        if k.date is None:
            message = "a trend needs the date of each file; this one has none"
            raise BadInput.single(message, Location(k.file), "write `created:` in its `provenance:`", "date")
    return line_of([k.date for k in known if k.date is not None])


def _warnings(known: Sequence[KnownParameters]) -> list[str]:
    """Files that share rows, fits that did not end well, machines that differ."""
    out: list[str] = []
    for i, one in enumerate(known):
        out += one.ending.remarks(one.file)
        for other in known[i + 1 :]:
            tables = {d: n for n, d in one.inputs.items() if not n.endswith((".yaml", ".yml"))}
            if same := [tables[d] for d in other.inputs.values() if d in tables]:
                rows = ", ".join(same)
                out.append(f"warning: {one.file} and {other.file} share rows ({rows}): the tests do not hold")
    first = known[0].fingerprint
    for other in known[1:]:
        if first is not None and other.fingerprint is not None:
            difference = first.difference(other.fingerprint)
            out += [f"note: the machine of {known[0].file} differs from that of {other.file}: {difference}"] * bool(
                difference
            )
    return out
