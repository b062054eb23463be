"""The closed loop from files to files: improved machine (an overlay), parameter file, figures before and after."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from pkmcal_cli.base.errors import BadInput, UsageError
from pkmcal_cli.base.files import is_stream
from pkmcal_cli.base.listener import Listener
from pkmcal_cli.base.outputs import check_target, takes_directly, write_together
from pkmcal_cli.base.workers import Workers
from pkmcal_cli.calibration.identify import RowsFailed
from pkmcal_cli.calibration.measured_problem import problem_of
from pkmcal_cli.calibration.plausible import implausible_fit
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.range_check import range_check
from pkmcal_cli.calibration.unexplained import unexplained
from pkmcal_cli.diagnosis.closed_loop import FAILURES, Improvement, improve
from pkmcal_cli.diagnosis.rotations import FEWEST_TO_SPLIT
from pkmcal_cli.gross_errors.hints import nothing_measured
from pkmcal_cli.loading.ending import provenance_of_doubts
from pkmcal_cli.loading.load_machine import LoadedMachine, load_measurements
from pkmcal_cli.loading.poses import origin_of
from pkmcal_cli.report.console import Reporter, emit_json, enveloped
from pkmcal_cli.report.improvement import ImprovementReport
from pkmcal_cli.report.loads import Loads
from pkmcal_cli.report.provenance import provenance
from pkmcal_cli.tables.measurement_set import Measurements
from pkmcal_cli.workflow.alpha import check_alpha
from pkmcal_cli.workflow.arguments import one_stdin, present
from pkmcal_cli.workflow.fail_on import failing
from pkmcal_cli.workflow.gates import Gate, check_gates, gates, measured_kinds, missed_limits
from pkmcal_cli.workflow.improvement_run import fingerprint_of_improved, improvement_run
from pkmcal_cli.workflow.named_effects import named_only
from pkmcal_cli.workflow.result_figures import Result
from pkmcal_cli.workflow.run_folder import check_run, keep_run
from pkmcal_cli.workflow.search_case import FEWEST_ROWS, Case, CaseRequest, also_right, prepare
from pkmcal_cli.workflow.unsolved_rows import unsolved

FAILING = (*FAILURES, "implausible")


@dataclass(frozen=True, kw_only=True)
class ImproveRequest:
    """The arguments of `improve`."""

    case: CaseRequest
    validation: str | None = None
    output: str | None = None
    only: str | None = None
    alpha: float = 0.005
    seed: int = 0
    jobs: int = 1
    accept: bool = False
    fail_above: tuple[str, ...] | None = None
    fail_on: str | None = None
    run: str | None = None
    as_json: bool = False
    quiet: bool = False
    style: str = "text"
    force: bool = False

    @property
    def inputs(self) -> tuple[str | None, ...]:
        """All that is read."""
        return (self.case.machine, *self.case.measurements, self.case.parameters, self.validation)


def run_improvement(request: ImproveRequest) -> int:
    """Run the loop, show it, write what was accepted; returns the exit code. Raises PkmcalError."""
    check_alpha(request.alpha)
    fails_on = failing(request.fail_on, FAILING)
    one_stdin(*request.inputs)
    targets, limits = _targets(request), gates(request.fail_above or ())
    check_run(request.run, present(*request.inputs), targets or ())
    to = Reporter(request.quiet, request.style)
    case, apart = setting(request, to)
    check_gates(limits, case.candidates.model, measured_kinds(case.problem))
    inputs = case.inputs | ({} if apart is None else apart.inputs)
    for target in targets or ():
        check_target(target, inputs, force=request.force)
    improved = improvement_of(case, apart, request, to)
    report, odd = improved.report, improved.odd
    improvement = report.improvement
    report.show(to)
    Loads.of_fit(improvement.problem, improvement.fit, partial(origin_of, case.measured)).show(to)
    _tell(odd[len(case.hints) :], to)
    if odd and request.accept:
        to.say("accepted (`--accept`)")
    head = _head(request, inputs, improved)
    machine, parameters = (None, None) if targets is None else _write(request, inputs, report, targets, head, to)
    failures = improved.failures(request.accept)
    if failed := not fails_on.isdisjoint(failures):
        to.refuse(improved.refusal(request.accept), case.measured.location)
    code, gates_json = _verdict(case, report, limits, failed, to)
    result: dict[str, Any] = {}
    if request.as_json or request.run is not None:  # what only programs read takes some of the time
        result = improved.json(machine, parameters, accept=request.accept)
        result = enveloped("improve", result["verdict"], result | gates_json, head)
    if request.as_json:
        emit_json(result)
    if improvement.broken is not None:
        raise improvement.broken
    if request.run is not None:
        asked = request.case.asked | {"alpha": request.alpha, "seed": request.seed}
        kept = improvement_run(request.case.machine, asked, inputs, report, head=head, result=result, code=code)
        keep_run(request.run, inputs, kept, to)
    return code


@dataclass(frozen=True)
class Improved:
    """A run of the loop; odd: why it is not to be believed."""

    case: Case
    report: ImprovementReport
    odd: tuple[str, ...]

    @property
    def status(self) -> str:
        """How the fit with all that was accepted ended."""
        made = self.report.improvement
        more = self.case.loss == "squares" and unexplained(made.fit, made.budget)
        if made.fit.status != "converged":
            return made.fit.status
        return "implausible" if self.odd else "incomplete" if more else "converged"

    def refusal(self, accept: bool) -> str:
        """A negative verdict in words, with its reasons but for those that are accepted."""
        reasons = [] if accept else [f"because: implausible: {reason}" for reason in self.odd]
        return "\n".join([self.report.summary, self.report.diagnosis.verdict_line(), *reasons])

    def failures(self, accept: bool = False) -> tuple[str, ...]:
        """What it did not achieve."""
        return (*self.report.improvement.failures, *(["implausible"] if self.odd and not accept else []))

    def json(self, machine: str | None, parameters: str | None, accept: bool = False) -> dict[str, Any]:
        """The result for programs; machine, parameters: files that were written."""
        outcome = {"implausible": list(self.odd), "failures": list(self.failures(accept))}
        return self.report.json(machine, parameters) | self.case.record | outcome


def setting(
    request: ImproveRequest, to: Listener, machine: LoadedMachine | None = None
) -> tuple[Case, Measurements | None]:
    """What is searched, and rows of a file that only report. Raises PkmcalError."""
    fewest = FEWEST_TO_SPLIT if request.validation is None and request.only is None else FEWEST_ROWS
    case = prepare(request.case, to, fewest, machine)
    if request.only is not None:
        case = replace(case, candidates=named_only(case.candidates, case.problem, request.only))
    return case, None if request.validation is None else _apart(case, request.validation)


def improvement_of(case: Case, apart: Measurements | None, request: ImproveRequest, to: Listener) -> Improved:
    """Run the loop. Raises PkmcalError."""
    check_alpha(request.alpha)
    improvement = _improved(case, None if apart is None else _validation(case, apart), request, to)
    improvement = replace(improvement, whole=case.with_mistakes(improvement.whole))
    report = ImprovementReport(case.loaded.machine, case.measured, improvement)
    return Improved(case, report, _implausible(improvement, case.hints))


def _verdict(
    case: Case, report: ImprovementReport, limits: tuple[Gate, ...], failed: bool, to: Reporter
) -> tuple[int, dict[str, Any]]:
    """The exit code, and limits as JSON has them; those that are missed are told."""
    judged = _result(case, report).judged(limits)
    missed = missed_limits(judged, case.loaded, case.measured.files[0])
    for fault in missed:
        to.fail(fault)
    return int(bool(missed) or failed), {"gates": [each.json() for each in judged]}


def _result(case: Case, report: ImprovementReport) -> Result:
    """What limits of the command line are held against."""
    improvement = report.improvement
    return Result(
        machine=case.loaded.machine,
        held_out=improvement.after.report,
        fitted=improvement.after.fit,
        chi2_per_dof=improvement.fit.chi2_per_dof,
        std={name: report.estimate(name)[1] for name in improvement.fit.selected},
        before=(case.candidates.model, case.candidates.begin()),
        after=(improvement.problem.model, improvement.fit.values),
        rows=improvement.problem.rows,
    )


def _improved(case: Case, validation: Problem | None, request: ImproveRequest, to: Listener) -> Improvement:
    """The loop's result. Raises BadInput for rows that cannot be predicted."""
    alpha, seed = request.alpha, request.seed
    try:
        with to.stages() as observe:
            return improve(
                case.candidates,
                case.problem,
                case.selected,
                validation,
                alpha,
                seed,
                loss=case.loss,
                observe=observe,
                workers=Workers.of(request.jobs),
            )
    except RowsFailed as failure:
        raise unsolved(case.measured, failure.evaluation.prediction) from None


def _implausible(improvement: Improvement, hints: tuple[str, ...]) -> tuple[str, ...]:
    """Hints at gross mistakes, and why the fit with all that was accepted is not to be believed."""
    problem, fit = improvement.problem, improvement.fit
    if fit.status == "not_converged":
        return ("the fit with all that was accepted does not converge: do not use its values",)
    if fit.status != "converged":
        return ()
    return (*hints, *implausible_fit(problem, fit, range_check(problem, fit, improvement.budget)))


def _tell(reasons: tuple[str, ...], to: Reporter) -> None:
    """Reasons that were not told as hints before."""
    for reason in reasons:
        to.warn(f"warning: implausible: {reason}")


def _targets(request: ImproveRequest) -> tuple[str, str] | None:
    """Files to write: the machine and, beside it, its parameters. Raises UsageError or OutputError."""
    if request.output is None:
        return None
    if is_stream(request.case.machine):
        raise UsageError(
            "-o: the output extends the machine file, but the machine comes from stdin", hint="name the machine file"
        )
    if takes_directly(request.output):
        raise UsageError("-o: the machine and its parameters need two files", hint="name a file: -o M-improved.yaml")
    if not _base(request.case.machine, request.output).isprintable():
        raise UsageError(
            "-o: the output extends the machine file, whose name is not printable", hint="rename the machine file"
        )
    stem = os.path.splitext(request.output)[0]
    targets = (request.output, f"{stem}.params.yaml")
    inputs = present(*request.inputs)
    for target in targets:
        check_target(target, inputs, force=request.force)
    return targets


def _apart(case: Case, file: str) -> Measurements:
    """The rows of a validation file. Raises BadInput, and UsageError for rows that are fitted."""
    measured = load_measurements(case.loaded, [file])
    if set(measured.sha256) & set(case.measured.sha256):
        raise UsageError("--validation: these rows are already used for fitting", hint="give held-out rows")
    return also_right(case, measured)


def _validation(case: Case, measured: Measurements) -> Problem:
    """The rows that only report, of the candidates' model. Raises BadInput."""
    problem = problem_of(case.candidates.model, measured)
    if not problem.count:
        raise BadInput([nothing_measured(case.loaded, problem)])
    return problem


def _write(
    request: ImproveRequest,
    inputs: dict[str, str],
    report: ImprovementReport,
    targets: tuple[str, str],
    head: dict[str, Any],
    to: Reporter,
) -> tuple[str, str]:
    """Write the overlay and the parameters of accepted effects; their names."""
    machine, parameters = targets
    base = _base(request.case.machine, machine)
    with write_together((parameters, machine), inputs, force=request.force) as (values, overlay):
        overlay.write(report.overlay(base))
        overlay.flush()
        values.write(report.parameter_file(head, replace(fingerprint_of_improved(overlay.name, inputs), of=machine)))
    to.say(report.files_text(machine, parameters, base))
    return targets


def _head(request: ImproveRequest, inputs: dict[str, str], improved: Improved) -> dict[str, Any]:
    """Where the parameters come from, and whether they are to be believed."""
    doubts = provenance_of_doubts(improved.odd, request.accept)
    return provenance(inputs, seed=request.seed, status=improved.status, **improved.case.measured.dated, **doubts)


def _base(machine: str, target: str) -> str:
    """The machine's file, seen from the folder of what extends it; from anywhere where that is called by a link."""
    if os.path.islink(target):
        return os.path.abspath(machine)
    return os.path.relpath(machine, os.path.dirname(target) or ".")
