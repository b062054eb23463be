"""The sheet to hand over, from files: calibration, search for causes, second table, one page."""

from __future__ import annotations

import os
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

from pkmcal_cli.base.errors import BadInput, Location, UsageError
from pkmcal_cli.base.files import is_stream
from pkmcal_cli.base.listener import Record
from pkmcal_cli.base.outputs import check_target, write_text
from pkmcal_cli.calibration.complete_fit import FitOptions
from pkmcal_cli.csv_files.origin import SIMULATED
from pkmcal_cli.loading.load_machine import load_machine, load_measurements, load_parameters
from pkmcal_cli.loading.plain_files import plain_map
from pkmcal_cli.report.console import Reporter, emit_json, enveloped
from pkmcal_cli.report.improvement import ImprovementReport
from pkmcal_cli.report.provenance import provenance
from pkmcal_cli.report.verification import VerificationReport
from pkmcal_cli.sheet.acceptance import acceptance
from pkmcal_cli.sheet.page import html
from pkmcal_cli.sheet.recorder import Recorder
from pkmcal_cli.sheet.results import Results
from pkmcal_cli.sheet.sections import sheet
from pkmcal_cli.sheet.sheet_json import sheet_json
from pkmcal_cli.tables.measurement_set import Measurements
from pkmcal_cli.units.unit_text import Unit
from pkmcal_cli.workflow.alpha import check_alpha
from pkmcal_cli.workflow.arguments import one_stdin, present
from pkmcal_cli.workflow.calibration import Calibrated, CalibrationRequest, calibration, parameter_text, setting
from pkmcal_cli.workflow.improve import ImproveRequest, improvement_of
from pkmcal_cli.workflow.improve import setting as improve_setting
from pkmcal_cli.workflow.improvement_run import fingerprint_of_improved
from pkmcal_cli.workflow.run_folder import RECORD
from pkmcal_cli.workflow.search_case import CaseRequest
from pkmcal_cli.workflow.verify import tolerance_of, verify

_MM_PER_MIN = 60e3  # of 1 m/s
_NO_PAGES = (".pdf", ".png", ".svg", ".csv", ".json", ".yaml", ".docx")  # what a page would be taken for by its name


@dataclass(frozen=True, kw_only=True)
class ReportRequest:
    """The arguments of `report`."""

    machine: str
    measurements: tuple[str, ...]
    after: str | None = None
    output: str = "report.html"
    tolerance: str | None = None
    select: str = "auto"
    parameters: str | None = None
    loss: str = "squares"
    prior: str = "none"
    alpha: float = 0.005
    seed: int = 0
    circle_feed: float | None = None
    as_json: bool = False
    quiet: bool = False
    force: bool = False

    @property
    def case(self) -> CaseRequest:
        """What is searched for causes."""
        names = ("machine", "measurements", "select", "parameters", "loss", "prior")
        return CaseRequest(**{name: getattr(self, name) for name in names})

    @property
    def fit_words(self) -> tuple[str, ...]:
        """Options of the fit, as words of a command line."""
        defaults = {"select": "auto", "loss": "squares", "prior": "none"}
        stated = [name for name, default in defaults.items() if getattr(self, name) != default]
        return tuple(word for name in stated for word in (f"--{name}", getattr(self, name)))


def run_report(request: ReportRequest) -> int:
    """Calibrate, search, verify, write the page; returns the exit code. Raises PkmcalError."""
    if os.path.isdir(request.machine):
        request = _of_run(request)
    elif not request.measurements:
        raise UsageError("report needs measurements", hint="name tables after the machine file, or a folder of `--run`")
    tolerance, to = _checked(request), Reporter(request.quiet)
    calibrated = CalibrationRequest(
        machine=request.machine,
        measurements=request.measurements,
        select=request.select,
        parameters=request.parameters,
        fit_options=FitOptions(loss=request.loss, prior=request.prior, seed=request.seed),
    )
    identified = calibration(setting(calibrated), to)
    report, inputs = identified.report, dict(identified.setting.inputs)
    head = provenance(inputs, seed=request.seed, status=report.status)
    improved, why = _improved(request, to)
    verified, notes = None, [*identified.setting.measured.notes]
    if request.after is not None:
        improved_here = improved if improved is not None and improved.improvement.confirmed else None
        verified, after = _verified(request, identified, improved_here, tolerance)
        inputs |= after.inputs
        notes += after.notes
    results = Results(
        loaded=identified.setting.loaded,
        measured=identified.setting.measured,
        calibrated=report,
        improved=improved,
        not_searched=why,
        verified=verified,
        tolerance=tolerance,
        fit_words=request.fit_words,
        feed=None if request.circle_feed is None else request.circle_feed / _MM_PER_MIN,
        head=head | {"inputs": inputs},
        notes=tuple(dict.fromkeys(notes)),
        simulated=tuple(note for note in dict.fromkeys(notes) if SIMULATED in note),
    )
    return _written(request, results, inputs, to)


def _copy(folder: str, name: str) -> str:
    """A kept copy of an input. Raises BadInput for a file elsewhere: a folder may come from anybody."""
    path = os.path.join(folder, name)
    if os.path.commonpath([os.path.realpath(folder), os.path.realpath(path)]) != os.path.realpath(folder):
        message = f"the record of this run names a file outside its folder, `{name}`"
        hint = "give the folder as `--run` made it"
        raise BadInput.single(message, Location(os.path.join(folder, RECORD)), hint, "file")
    return path


def _of_run(request: ReportRequest) -> ReportRequest:
    """The same for a run that was kept: its copies of the files, its options; a further table is that after correction.

    Raises BadInput for a folder that holds none, UsageError for more tables.
    """
    folder = request.machine
    tables = [*request.measurements, *([request.after] if request.after is not None else [])]
    if len(tables) > 1:
        hint = "give at most one, measured after correction"
        raise UsageError("report: a kept run has its own measurements, so there are too many tables", hint=hint)
    record = plain_map(os.path.join(folder, RECORD), "the record of a run", "command:")
    asked, files = record.get("asked"), record.get("inputs")
    try:
        copies = {name: _copy(folder, kept["file"]) for name, kept in files.items()}  # type: ignore[union-attr]
        options = {k: asked[k] for k in ("select", "loss", "prior", "alpha", "seed") if k in asked}  # type: ignore[operator, index]
        return replace(
            request,
            machine=copies[str(record["machine"])],
            measurements=tuple(copies[name] for name in asked["measurements"]),  # type: ignore[index]
            parameters=None if asked["parameters"] is None else copies[asked["parameters"]],  # type: ignore[index]
            after=tables[0] if tables else None,
            **options,
        )
    except (KeyError, TypeError, AttributeError):
        hint = "give a run of `calibrate`, `diagnose` or `improve`"
        raise BadInput.single("this run has no measurements to report", Location(folder), hint, "file") from None


def _checked(request: ReportRequest) -> tuple[float, Unit] | None:
    """The tolerance, m, and its unit, if the arguments go together. Raises UsageError, OutputError."""
    files = (request.machine, *request.measurements, request.parameters, request.after)
    check_alpha(request.alpha)
    one_stdin(*files)
    if request.as_json and is_stream(request.output):
        raise UsageError("--json and `-o -` both write to stdout", hint="give `-o` a file")
    streams = [f for f in files if f is not None and is_stream(f)]
    if streams:
        message = "a sheet reads its files several times, but one of them is stdin"
        raise UsageError(message, hint="give the machine and the tables as files")
    if request.circle_feed is not None and not request.circle_feed > 0:
        raise UsageError("--circle-feed: not a positive feed", hint="give mm/min, e.g. `--circle-feed 1000`")
    if os.path.splitext(request.output)[1].lower() in _NO_PAGES:
        hint = "write FILE.html; a browser prints it, or saves it as PDF"
        raise UsageError(f"-o: `{request.output}`: a sheet is an HTML page", hint=hint)
    check_target(request.output, present(*files), force=request.force)
    return tolerance_of(request.tolerance)


def _improved(request: ReportRequest, to: Reporter) -> tuple[ImprovementReport | None, str]:
    """What the search for causes finds, or why there is none. Raises PkmcalError."""
    asked = ImproveRequest(case=request.case, alpha=request.alpha, seed=request.seed)
    try:
        case, _ = improve_setting(asked, Record())  # what there is to say of the files, the calibration has said
    except BadInput as error:
        if all(fault.code == "measurements" for fault in error.faults):
            return None, error.faults[0].what
        raise
    return improvement_of(case, None, asked, to).report, ""


def _verified(
    request: ReportRequest,
    calibrated: Calibrated,
    improved: ImprovementReport | None,
    tolerance: tuple[float, Unit] | None,
) -> tuple[VerificationReport, Measurements]:
    """The second table against what was identified, with the causes that were found; the table."""
    assert request.after is not None
    with tempfile.TemporaryDirectory() as folder:
        machine, file = request.machine, Path(folder) / "identified.params.yaml"
        parameters, inputs = parameter_text(calibrated), calibrated.setting.inputs
        if improved is not None:
            machine = os.path.join(folder, "improved.yaml")
            Path(machine).write_text(improved.overlay(os.path.abspath(request.machine)), encoding="utf-8")
            absolute = {os.path.abspath(name): digest for name, digest in inputs.items()}
            fingerprint = replace(fingerprint_of_improved(machine, absolute), of=request.machine)
            parameters = improved.parameter_file(provenance(inputs, status="converged"), fingerprint)
        file.write_text(parameters, encoding="utf-8")
        loaded = load_machine(machine)
        measured = load_measurements(loaded, [request.after])
        if set(measured.sha256) & set(calibrated.setting.measured.sha256):
            hint = "give rows that were measured after correction"
            raise UsageError(f"--after: the rows of `{request.after}` are those that were calibrated", hint=hint)
        start = load_parameters(loaded.model.for_sessions(measured.named_sessions), str(file))
        verification = verify(loaded, measured, start, str(file), tolerance, Recorder())
    return verification, measured


def _written(request: ReportRequest, results: Results, inputs: dict[str, str], to: Reporter) -> int:
    """Write the page, say the verdict; the exit code. Raises OutputError."""
    figures = acceptance(results)
    made = sheet(results, figures)
    with write_text(request.output, inputs, force=request.force) as file:
        file.write(html(made))
    (to.fail if made.verdict.negative else to.say)(f"{made.verdict.word}  {made.verdict.headline}")
    for line in made.verdict.lines:
        to.say(line)
    if not is_stream(request.output):
        to.say(f"written: {request.output}")
    if request.as_json:
        result = {"file": request.output} | sheet_json(results, figures)
        emit_json(enveloped("report", made.verdict.word.lower(), result, results.head))
    return int(made.verdict.negative)
