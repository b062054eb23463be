"""Diagnosis."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import pandas as pd

from pkmcal_cli.base.listener import Record
from pkmcal_cli.base.stages import Stage, unobserved
from pkmcal_cli.diagnosis.run_diagnosis import Diagnosis as SearchOutcome
from pkmcal_cli.loading.poses import origin_of
from pkmcal_cli.pictures.picture import Picture
from pkmcal_cli.report.diagnosis import DiagnosisReport
from pkmcal_cli.report.loads import Loads
from pkmcal_cli.workflow.diagnose import FAILING, diagnosed, diagnosis_drawn, diagnosis_json
from pkmcal_cli.workflow.search_case import Case, CaseRequest, prepare

from .computing import computing
from .machine import Machine, load, number
from .options import Names, names_of, whole
from .result import Result, messages_of, residual_frame
from .tables import Parameters, Table, measured_frame, parameters_of, sources_of

_EFFECT = ["name", "effect", "at", "value", "std", "unit", "evidence", "p_value", "share", "confirmed", "provisional"]


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Diagnosis(Result):
    """Which physical effects explain what a calibration leaves."""

    case: Case  # not stable
    report: DiagnosisReport  # not stable

    @property
    def status(self) -> str:
        """`clean`, `found`, `ambiguous`, `unknown`, `measurement_fault`, `sigma_too_small` or `implausible`."""
        return self._outcome.verdict

    @property
    def ok(self) -> bool:
        """Whether nothing is missing."""
        return self.status not in FAILING

    @property
    def verdict(self) -> str:
        """What the data say, and by which figures."""
        return self.report.verdict_line()

    @property
    def parameters(self) -> pd.DataFrame:
        """Parameters of the effects that were found, by name: effect, place, value and std in `unit`, evidence."""
        return effect_frame(self.json()["effects"])

    @property
    def table(self) -> pd.DataFrame:
        """The rows that were measured, in the units of the machine file."""
        return measured_frame(self.machine.loaded.machine, self.case.measured)

    @property
    def residuals(self) -> pd.DataFrame:
        """Measured minus predicted with the effects that were found, with the rows of `table`."""
        return residual_frame(self._outcome.problem, self._outcome.search.fit.after)

    @property
    def residuals_before(self) -> pd.DataFrame:
        """The same after calibration, without effects."""
        return residual_frame(self._outcome.problem, self._outcome.before.after)

    def json(self) -> dict[str, Any]:
        """What `pkmcal diagnose --json` says, without provenance."""
        return diagnosis_json(self.case, self.report)

    @property
    def _outcome(self) -> SearchOutcome:
        return self.report.diagnosis

    def _picture(self) -> Picture:
        return diagnosis_drawn(self.case, self._outcome)


def effect_frame(effects: Sequence[dict[str, Any]]) -> pd.DataFrame:
    """A row for every parameter of effects, from their JSON form."""
    rows = []
    for e in effects:
        for p in e["parameters"]:
            size = (p["name"], e["effect"], e["at"], number(p["value"]), number(p["std"]), p["unit"])
            proof = (number(e["evidence"]), number(e["p_value"]), number(e["share"]))
            rows.append((*size, *proof, e["confirmed"], e["provisional"]))
    return pd.DataFrame(rows, columns=_EFFECT).set_index("name")


def diagnose(
    machine: str | os.PathLike[str] | Machine,
    measurements: Table | Sequence[Table],
    *,
    select: Names = "auto",
    parameters: Parameters | None = None,
    loss: str = "squares",
    prior: str = "none",
    alpha: float = 0.005,
    seed: int = 0,
    observer: Callable[[Stage], None] = unobserved,
) -> Diagnosis:
    """Which physical effect explains the residuals that remain after calibration? As `pkmcal diagnose`.

    observer: is told where the work has come to. Raises PkmcalError.
    """
    known = load(machine)
    request = CaseRequest(
        machine=known.file, measurements=sources_of(measurements), select=names_of(select),
        parameters=parameters_of(parameters), loss=loss, prior=prior,
    )  # fmt: skip
    record = Record(observer)
    with computing():
        case = prepare(request, record, machine=known.receptive)
        diagnosis = diagnosed(case, alpha, whole("seed", seed), record)
        report = DiagnosisReport(case.loaded.machine, case.measured, diagnosis)
        report.failed.show(record)
        Loads.of_fit(diagnosis.search.problem, diagnosis.search.fit, partial(origin_of, case.measured)).show(record)
    return Diagnosis(machine=known, case=case, report=report, **messages_of(record))
