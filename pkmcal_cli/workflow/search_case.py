"""A table that is searched for causes: from files to a machine that takes effects, and all that may be missing."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pkmcal_cli.base.errors import BadInput, Location
from pkmcal_cli.base.listener import Listener
from pkmcal_cli.base.plural import count
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.complete_fit import FitOptions, with_prior
from pkmcal_cli.calibration.frame_start import at_frames
from pkmcal_cli.calibration.measured_problem import problem_of
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.robust import Loss
from pkmcal_cli.calibration.selection import select
from pkmcal_cli.calibration.unknown_sides import with_unknown_sides
from pkmcal_cli.diagnosis.hypotheses import Candidates, candidates
from pkmcal_cli.diagnosis.run_diagnosis import Diagnosis
from pkmcal_cli.gross_errors.hints import absurd_rows, copied_rows, nothing_measured, suspicions, unsided
from pkmcal_cli.gross_errors.plausibility import Hint
from pkmcal_cli.gross_errors.put_right import put_right
from pkmcal_cli.loading.covariates import derived_directions
from pkmcal_cli.loading.load_machine import LoadedMachine, Start, load_machine, load_measurements, load_parameters
from pkmcal_cli.loading.poses import origin_of
from pkmcal_cli.tables.measurement_set import Measurements
from pkmcal_cli.workflow.arguments import one_stdin, selection
from pkmcal_cli.workflow.determined import determined
from pkmcal_cli.workflow.moved_frames import moved_warnings

FEWEST_ROWS = 8  # with fewer, no effect is told from noise
RIGHT = "searched with the table put right; correct it, or the machine file"


@dataclass(frozen=True, kw_only=True)
class CaseRequest:
    """What `diagnose` and `improve` are asked to search, and how fits treat it."""

    machine: str
    measurements: tuple[str, ...]
    select: str = "auto"
    parameters: str | None = None
    loss: str = "squares"
    prior: str = "none"

    @property
    def asked(self) -> dict[str, Any]:
        """What a sheet of this search needs to know."""
        asked = {"measurements": list(self.measurements), "parameters": self.parameters, "select": self.select}
        return asked | {"loss": self.loss, "prior": self.prior}

    def checked_loss(self) -> Loss:
        """The loss. Raises UsageError for words that are none, for the prior too."""
        FitOptions(loss=self.loss, prior=self.prior).check()
        return self.loss  # type: ignore[return-value]


@dataclass(frozen=True, kw_only=True)
class Case:
    """A machine that takes effects, what was measured on it, and all that may be missing."""

    loaded: LoadedMachine
    measured: Measurements
    candidates: Candidates
    problem: Problem  # of the candidates' model
    selected: tuple[str, ...]  # without what is held as datum
    start: Start  # values that fits begin with, and where they come from
    loss: Loss
    hints: tuple[str, ...] = ()  # at gross mistakes
    mistakes: tuple[Hint, ...] = ()  # those of which the table has been put right

    def with_mistakes(self, made: Diagnosis) -> Diagnosis:
        """A diagnosis that says what was wrong with the table, where it has been put right."""
        if not self.mistakes:
            return made
        verdict = made.verdict if made.findings or made.unknown else "measurement_fault"
        return replace(made, verdict=verdict, mistakes=tuple(h.message for h in self.mistakes if h.mends))

    @property
    def inputs(self) -> dict[str, str]:
        """sha256 by name of all that was read."""
        return self.loaded.inputs | self.start.inputs | self.measured.inputs

    @property
    def begin(self) -> Array:
        """Values (P,) of all parameters of the problem's model that fits begin with, SI."""
        return replace(self.candidates, model=self.problem.model).begin()

    @property
    def record(self) -> dict[str, str]:
        """How values were weighed, and what was known besides."""
        return {"loss": self.loss, "prior": "none" if self.problem.prior is None else "ranges"}


def prepare(
    request: CaseRequest, to: Listener, fewest: int = FEWEST_ROWS, machine: LoadedMachine | None = None
) -> Case:
    """Read the files and gather the hypotheses; the table needs some rows. Raises PkmcalError."""
    loss = request.checked_loss()
    one_stdin(request.machine, *request.measurements, request.parameters)
    tables = request.measurements
    loaded = load_machine(request.machine, receptive=True, tables=tables) if machine is None else machine
    selection(loaded.model, request.select)
    case = _case(request, loaded, load_measurements(loaded, request.measurements), loss, fewest)
    mistakes = _hints(case, to)
    right = put_right(case.measured, mistakes)
    if right is not None:
        to.notes([RIGHT])
        case = replace(_case(request, loaded, right, loss, fewest), mistakes=mistakes)
    case = replace(case, hints=tuple(h.message for h in mistakes))
    asked = determined(loaded.model.name, case.problem, case.begin, case.selected)
    for line in asked.notes:
        to.say(line)
    return replace(case, problem=asked.of(case.problem, case.begin), selected=asked.selected)


def _case(request: CaseRequest, loaded: LoadedMachine, measured: Measurements, loss: Loss, fewest: int) -> Case:
    """A table and all that may be missing. Raises PkmcalError."""
    model = loaded.model.for_sessions(measured.named_sessions)
    selected = selection(model, request.select)
    candidates_ = candidates(model, select(model, request.select), measured)
    problem = with_unknown_sides(problem_of(candidates_.model, measured), selected)
    problem = with_prior(problem, selected, request.prior)
    start = load_parameters(model, request.parameters)
    if request.parameters is not None:
        values = np.append(start.values, candidates_.model.nominal[len(model.parameters) :])
        begin = at_frames(values, candidates_.model, problem.model)
        moved = moved_warnings(begin, candidates_.model, problem.model, selected, request.parameters)
        candidates_, start = replace(candidates_, start=begin), replace(start, warnings=(*start.warnings, *moved))
    if not problem.count:
        raise BadInput([nothing_measured(loaded, problem)])
    _enough(problem, measured, selected, fewest)
    if absurd := absurd_rows(problem, lambda row: origin_of(measured, row)):
        raise BadInput(absurd)
    return Case(
        loaded=loaded, measured=measured, candidates=candidates_, problem=problem, selected=selected, start=start,
        loss=loss,
    )  # fmt: skip


def also_right(case: Case, measured: Measurements) -> Measurements:
    """Another table of a case whose table has been put right: the same may be wrong in it, or not."""
    if not case.mistakes:
        return measured
    problem = problem_of(case.candidates.model, measured)
    return put_right(measured, suspicions(case.loaded, problem, case.begin, measured)) or measured


def _hints(case: Case, to: Listener) -> tuple[Hint, ...]:
    """What is to be said of the files before all else; the hints at gross mistakes among it."""
    measured, problem = case.measured, case.problem
    to.notes([*measured.notes, *unsided(problem, measured)])
    for gap in _gaps(measured):
        to.warn(f"warning: {gap}")
    for finding in (*case.loaded.warnings, *measured.warnings):
        to.warn(finding)
    for text in case.start.remarks(bool(measured.named_sessions), case.selected):
        to.warn(text)
    hints = suspicions(case.loaded, problem, case.begin, measured)
    for text in (*(h.message for h in hints), *copied_rows(problem, measured)):
        to.warn(f"warning: {text}", measured.location)
    if derived := derived_directions(measured, case.loaded.model.drive_names):
        to.notes([f"direction of {', '.join(derived)}: taken from the order of the rows"])
    return hints


def _enough(problem: Problem, measured: Measurements, selected: tuple[str, ...], fewest: int) -> None:
    """Raises BadInput where the table has too few rows, or no more values than parameters."""
    rows = int(problem.measured.any(axis=1).sum())
    if rows >= fewest and problem.count > len(selected):
        return
    message = f"too few measurements to find an effect: {count(rows, 'row')}, {count(problem.count, 'measured value')}"
    hint = f"measure {fewest} rows or more, and more values than the {len(selected)} parameters"
    hint += ", or name what to look for (`--only`)" if rows >= FEWEST_ROWS < fewest else ""
    raise BadInput.single(message, Location(measured.files[0]), hint, "measurements")


def _gaps(measured: Measurements) -> list[str]:
    """Columns with holes, which effects cannot use."""
    out = []
    for name, values in measured.covariates.items():
        empty = int(np.isnan(values).sum())
        if 0 < empty < len(values) and not name.startswith("dir."):
            out.append(
                f"column `{name}` is empty in {empty} of {len(values)} rows: effects that need it are not tested"
            )
    return out
