"""Diagnosis from files to tables and JSON."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from pkmcal_cli.base.errors import UsageError
from pkmcal_cli.base.files import is_stream
from pkmcal_cli.base.listener import Listener
from pkmcal_cli.base.outputs import check_folder
from pkmcal_cli.calibration.error_budget import error_budget, held_parameters
from pkmcal_cli.calibration.identify import RowsFailed
from pkmcal_cli.calibration.plausible import implausible_residuals, implausible_rows, implausible_values
from pkmcal_cli.calibration.range_check import range_check
from pkmcal_cli.diagnosis.run_diagnosis import Diagnosis, diagnose
from pkmcal_cli.diagnosis.verdict import Verdict
from pkmcal_cli.loading.poses import origin_of
from pkmcal_cli.pictures.picture import Picture
from pkmcal_cli.pictures.titles import Titles, titles
from pkmcal_cli.report.console import Reporter, emit_json, enveloped
from pkmcal_cli.report.diagnosis import DiagnosisReport
from pkmcal_cli.report.loads import Loads
from pkmcal_cli.report.provenance import provenance
from pkmcal_cli.workflow.alpha import check_alpha
from pkmcal_cli.workflow.arguments import present
from pkmcal_cli.workflow.fail_on import failing
from pkmcal_cli.workflow.overstated_sigma import noise_doubts
from pkmcal_cli.workflow.plots import check_plot, write_plot
from pkmcal_cli.workflow.run_folder import Run, check_run, keep_run
from pkmcal_cli.workflow.search_case import Case, CaseRequest, prepare
from pkmcal_cli.workflow.unsolved_rows import unsolved

FAILING: tuple[Verdict, ...] = ("found", "ambiguous", "unknown", "measurement_fault", "sigma_too_small", "implausible")


@dataclass(frozen=True, kw_only=True)
class DiagnosisRequest:
    """The arguments of `diagnose`."""

    case: CaseRequest
    alpha: float
    seed: int
    plots: str | None
    plot: str | None
    fail_on: str | None
    run: str | None
    as_json: bool
    quiet: bool
    style: str
    force: bool


def run_diagnosis(request: DiagnosisRequest) -> int:
    """Diagnose and show; returns the exit code. Raises PkmcalError."""
    check_alpha(request.alpha)
    fails_on = failing(request.fail_on, FAILING)
    if request.plots is not None and is_stream(request.plots) and request.quiet:
        raise UsageError("--plots - draws on the terminal, but -q suppresses it", hint="write files with `--plots DIR`")
    if request.plots is not None and not is_stream(request.plots):
        check_folder(request.plots)
    named = present(request.case.machine, *request.case.measurements, request.case.parameters)
    check_plot(request.plot, named, force=request.force)
    check_run(request.run, named, (request.plot,))
    to = Reporter(request.quiet, request.style)
    case = prepare(request.case, to)
    diagnosis = diagnosed(case, request.alpha, request.seed, to)
    report = DiagnosisReport(case.loaded.machine, case.measured, diagnosis)
    report.show(to)
    Loads.of_fit(diagnosis.search.problem, diagnosis.search.fit, partial(origin_of, case.measured)).show(to)
    _draw(request, case, diagnosis, to)
    failed = diagnosis.verdict in fails_on
    if failed:
        to.refuse(report.verdict_line(), case.measured.location)
    if request.as_json or request.run is not None:  # what only programs read takes some of the time
        result = enveloped("diagnose", diagnosis.verdict, diagnosis_json(case, report), provenance(case.inputs))
        if request.as_json:
            emit_json(result)
        kept = Run(
            command="diagnose",
            machine=request.case.machine,
            result=result,
            code=int(failed),
            verdict=report.verdict_line().partition("\n")[0],
            asked=request.case.asked | {"alpha": request.alpha, "seed": request.seed},
        )
        keep_run(request.run, case.inputs, kept, to)
    return int(failed)


def _draw(request: DiagnosisRequest, case: Case, diagnosis: Diagnosis, to: Reporter) -> None:
    """Pictures as files, or as text where they are asked for on the terminal. Raises UsageError, OutputError."""
    if request.plot is not None:
        write_plot(diagnosis_drawn(case, diagnosis), request.plot, case.inputs, to, force=request.force)
    if request.plots is None:
        return
    if is_stream(request.plots):
        from pkmcal_cli.report.text_pictures import text_pictures

        to.say(text_pictures(diagnosis))
        return
    from pkmcal_cli.pictures.diagnosis_pictures import diagnosis_pictures, write_pictures

    every = diagnosis_pictures(diagnosis, _titles(case), case.loaded.machine.file_units)
    for file in write_pictures(request.plots, list(every), case.inputs):
        to.say(f"written: {file}")


def diagnosis_drawn(case: Case, diagnosis: Diagnosis) -> Picture:
    """The picture of a diagnosis."""
    from pkmcal_cli.pictures.diagnosis_pictures import diagnosis_picture

    return diagnosis_picture(diagnosis, _titles(case), case.loaded.machine.file_units)


def _titles(case: Case) -> Titles:
    return titles(case.loaded.model.name, "diagnosis", case.measured.files)


def diagnosis_json(case: Case, report: DiagnosisReport) -> dict[str, Any]:
    """The result for programs, without its provenance."""
    return report.json() | case.record


def diagnosed(case: Case, alpha: float, seed: int, to: Listener) -> Diagnosis:
    """The diagnosis of a case. Raises UsageError, and BadInput for rows that cannot be predicted."""
    check_alpha(alpha)
    candidates, problem, selected = case.candidates, case.problem, case.selected
    try:
        with to.stages() as observe:
            made = diagnose(candidates, problem, selected, alpha, seed, loss=case.loss, observe=observe)
    except RowsFailed as failure:
        raise unsolved(case.measured, failure.evaluation.prediction) from None
    doubts = noise_doubts(made.problem, made.cleared, case.measured, to)
    for text in doubts.commanded:
        to.warn(f"warning: {text}", case.measured.location)
    if not case.mistakes:
        return _believed(made, (*case.hints, *doubts.commanded))
    return case.with_mistakes(made)


def _believed(made: Diagnosis, hints: tuple[str, ...]) -> Diagnosis:
    """The diagnosis; where no cause was found, whether the calibration is to be believed, as `calibrate` has it."""
    problem, fit = made.search.problem, made.search.fit
    if made.verdict == "sigma_too_small" and fit.status == "not_converged":
        return replace(made, verdict="implausible", implausible=(*hints, "the calibration does not converge"))
    if made.verdict not in ("clean", "sigma_too_small") or fit.status != "converged":
        return made
    checked = range_check(problem, fit, error_budget(problem, fit, held_parameters(problem, fit.selected, ())))
    fits = (*implausible_values(problem, checked), *implausible_residuals(problem, fit), *implausible_rows(made.before))
    reasons = (*hints, *fits)
    return replace(made, verdict="implausible", implausible=reasons) if reasons else made
