"""Whether tables fit a machine, before any fit: rows without a pose, gross mistakes, the nominal machine."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from pkmcal_cli.base.errors import Fault
from pkmcal_cli.base.plural import count
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.measured_problem import problem_of
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import evaluate
from pkmcal_cli.calibration.verification import own_of
from pkmcal_cli.gross_errors.hints import absurd_rows, copied_rows, measurement_hints, nothing_measured, sample_at
from pkmcal_cli.gross_errors.nominal_misfit import nominal_misfit
from pkmcal_cli.loading.load_machine import LoadedMachine, Start
from pkmcal_cli.loading.poses import origin_of, row_faults
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.report.loads import Loads
from pkmcal_cli.tables.measurement_set import Measurements
from pkmcal_cli.workflow.nominal_misfit import NominalMisfitReport


@dataclass(frozen=True, kw_only=True)
class TableCheck:
    """Counts of tables; the first faults, of rows without a solution and of gross mistakes, and the number of all;
    rows (k,) that the faults are about, as far as they are rows without a solution.
    """

    counts: dict[str, Any]
    faults: list[Fault]
    total: int
    lost: frozenset[int]

    @property
    def comparable(self) -> bool:
        """Whether there is enough to be compared with parameters: values, and a pose of most rows."""
        return bool(self.counts["n_values"]) and 2 * len(self.lost) < self.counts["n_rows"]


def check_tables(loaded: LoadedMachine, measured: Measurements, start: Start, to: Reporter) -> TableCheck:
    """What tables are worth at the values of `start`."""
    to.notes(measured.notes)
    for fault in measured.warnings:
        to.warn(fault)
    problem = problem_of(loaded.model, measured)
    values, row_origin = _values(problem, start), partial(origin_of, measured)
    with to.step("rows as predicted"):
        prediction = evaluate(problem, values).prediction
    lost = np.nonzero(~prediction.solved)[0]
    faults = row_faults(row_origin, {int(k): prediction.reason(int(k)) for k in lost}, len(problem))
    with to.step("whether the table fits the machine"):
        sample = sample_at(loaded, problem, values, prediction.start)
        messages = measurement_hints(loaded, problem, values, measured, sample=sample)
        nominal = NominalMisfitReport(nominal_misfit(sample), row_origin)
    hints = [Fault("plausibility", text, measured.location) for text in messages]
    hints += absurd_rows(problem, row_origin)
    if not problem.count:
        hints.append(nothing_measured(loaded, problem))
    copied = copied_rows(problem, measured)
    for text in copied:
        to.warn(f"warning: {text}", measured.location)
    sessions = count(len(measured.sessions), "session")
    to.say(f"{count(len(problem), 'row')}, {count(problem.count, 'measured value')}, {sessions}")
    with to.step("what drives and ropes bear"):
        loads = Loads.of(problem.model, problem.model.nominal, problem.rows, row_origin, prediction.start)
    loads.show(to)
    far = [] if start.inputs or hints or lost.size else nominal.warnings  # these reasons come first
    for text in far:
        to.warn(f"warning: {text}", measured.location)
    if not start.inputs:  # else `verify` compares more
        nominal.show(to)
    counts = {"n_rows": len(problem), "n_values": problem.count, "sessions": list(measured.sessions)}
    counts["nominal"] = nominal.json()
    counts["warnings"] = [*(f.what for f in measured.warnings), *copied, *loads.warnings, *far]
    return TableCheck(
        counts=counts, faults=hints + faults, total=len(hints) + len(lost), lost=frozenset(map(int, lost))
    )


def _values(problem: Problem, start: Start) -> Array:
    """Nominal, or those of a parameter file, but for what stands elsewhere each time."""
    if not start.inputs:
        return problem.model.nominal
    of_campaign = own_of(problem.model)
    return np.where([n in of_campaign for n in problem.model.names], problem.model.nominal, start.values)
