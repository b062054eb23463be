"""The closed loop."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import pandas as pd

from pkmcal_cli.base.errors import UsageError
from pkmcal_cli.base.files import AtHand
from pkmcal_cli.base.listener import Record
from pkmcal_cli.base.outputs import write_together
from pkmcal_cli.base.stages import Stage, unobserved
from pkmcal_cli.loading.poses import origin_of
from pkmcal_cli.pictures.picture import Picture
from pkmcal_cli.report.loads import Loads
from pkmcal_cli.report.parameters import parameter_unit
from pkmcal_cli.report.provenance import provenance
from pkmcal_cli.workflow.diagnose import diagnosis_drawn
from pkmcal_cli.workflow.improve import Improved, ImproveRequest, improvement_of, setting
from pkmcal_cli.workflow.improvement_run import fingerprint_of_improved
from pkmcal_cli.workflow.search_case import CaseRequest

from .calibration import error_frame
from .computing import computing
from .machine import Machine, load, number
from .options import Names, names_of, whole
from .result import Result, messages_of, residual_frame
from .tables import Parameters, Table, measured_frame, parameters_of, source_of, sources_of

_IMPROVED = "improved.yaml"


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Improvement(Result):
    """Effects that the machine file lacks, and what they bring on rows that neither fitted nor chose."""

    outcome: Improved  # not stable
    inputs: dict[str, str]  # sha256 by name

    @property
    def status(self) -> str:
        """`improved`, `not_confirmed`, `clean` or `sigma_too_small`."""
        return self.outcome.report.verdict

    @property
    def ok(self) -> bool:
        """Whether nothing significant is missing, and all that was accepted is confirmed."""
        return not self.outcome.failures()

    @property
    def verdict(self) -> str:
        """How it ended, and what it did not achieve."""
        failures = self.outcome.failures()
        return self.status + (f" ({', '.join(failures)})" if failures else "")

    @property
    def steps(self) -> pd.DataFrame:
        """Effects that were tried: place, whether accepted, why not, in how many rotations chosen, confirmed."""
        rows = [
            (s.hypothesis.effect, s.hypothesis.at, s.accepted, s.refused or "", s.chosen, s.confirmed)
            for s in self.outcome.report.improvement.steps
        ]
        return pd.DataFrame(rows, columns=["effect", "at", "accepted", "reason", "chosen", "confirmed"])

    @property
    def parameters(self) -> pd.DataFrame:
        """Parameters of the improved machine that were identified, effects' too: value and std in `unit`."""
        report, rows = self.outcome.report, []
        for name in report.improvement.fit.selected:
            value, std = report.estimate(name)
            unit = parameter_unit(report.model, name)
            rows.append((name, unit.from_si(value), number(None if std is None else std / unit.scale), unit.text))
        return pd.DataFrame(rows, columns=["name", "value", "std", "unit"]).set_index("name")

    @property
    def errors(self) -> pd.DataFrame:
        """Errors by kind, before and after, of rows that neither fitted nor chose, in `unit`."""
        made = self.outcome.report.improvement
        frame = error_frame(self.machine.loaded.machine, made.before.report, made.after.report, {})
        return frame.drop(columns=["rms_held_out", "max_held_out"], errors="ignore")

    @property
    def table(self) -> pd.DataFrame:
        """The rows that were measured, in the units of the machine file."""
        return measured_frame(self.machine.loaded.machine, self.outcome.case.measured)

    @property
    def residuals(self) -> pd.DataFrame:
        """Measured minus predicted by the improved machine, with the rows of `table`."""
        made = self.outcome.report.improvement
        return residual_frame(made.problem, made.fit.after)

    @property
    def improved(self) -> Machine:
        """The machine with the effects that were accepted; its parameters are this result's."""
        return load(AtHand.of(_IMPROVED, self._overlay(os.path.abspath(self._base))))

    def json(self) -> dict[str, Any]:
        """What `pkmcal improve --json` says, without provenance and limits."""
        return self.outcome.json(None, None)

    def parameter_text(self) -> str:
        """Text of the parameter file of the improved machine."""
        overlay = AtHand.of(_IMPROVED, self._overlay(os.path.abspath(self._base)))
        return self._parameter_text(overlay, _IMPROVED)

    def write(self, file: str | os.PathLike[str], *, force: bool = False) -> tuple[str, str]:
        """Write the improved machine, and its parameters beside it; returns both files. Raises OutputError."""
        machine = os.fspath(file)
        values = f"{os.path.splitext(machine)[0]}.params.yaml"
        base = os.path.relpath(self._base, os.path.dirname(machine) or ".")
        with write_together((values, machine), self.inputs, force=force) as (parameters, overlay):
            overlay.write(self._overlay(base))
            overlay.flush()
            parameters.write(self._parameter_text(overlay.name, machine))
        return machine, values

    @property
    def _base(self) -> str:
        file = self.machine.file
        if not os.path.exists(file):
            message = "the improved machine extends a file, but this machine is in none"
            raise UsageError(message, hint="write it first: `improvement.write(FILE)`, then `load(FILE)`")
        return file

    def _overlay(self, base: str) -> str:
        return self.outcome.report.overlay(base)

    def _parameter_text(self, overlay: str, machine: str) -> str:
        """overlay: what the fingerprint is of; machine: what the file calls it."""
        dated = self.outcome.case.measured.dated
        head = provenance(self.inputs, status=self.outcome.status, arguments=["pkmcal.improve"], **dated)
        return self.outcome.report.parameter_file(
            head, replace(fingerprint_of_improved(overlay, self.inputs), of=machine)
        )

    def _picture(self) -> Picture:
        return diagnosis_drawn(self.outcome.case, self.outcome.report.improvement.whole)


def improve(
    machine: str | os.PathLike[str] | Machine,
    measurements: Table | Sequence[Table],
    *,
    validation: Table | None = None,
    select: Names = "auto",
    parameters: Parameters | None = None,
    loss: str = "squares",
    prior: str = "none",
    only: str | None = None,
    alpha: float = 0.005,
    seed: int = 0,
    jobs: int = 1,
    observer: Callable[[Stage], None] = unobserved,
) -> Improvement:
    """Which effects does the machine file lack, and how much do they improve held-out points? As `pkmcal improve`.

    validation: rows that only report; only: effects to look for; jobs: processes, 0 for all cores; observer: is told
    where the work has come to. Raises PkmcalError.
    """
    known = load(machine)
    case = CaseRequest(machine=known.file, measurements=sources_of(measurements), select=names_of(select),
                       parameters=parameters_of(parameters), loss=loss, prior=prior)  # fmt: skip
    apart = None if validation is None else source_of(validation, "validation")
    request = ImproveRequest(case=case, validation=apart, only=only, alpha=alpha, seed=whole("seed", seed),
                             jobs=whole("jobs", jobs))  # fmt: skip
    record = Record(observer)
    with computing():
        prepared, rows = setting(request, record, known.receptive)
        improved = improvement_of(prepared, rows, request, record)
        made = improved.report.improvement
        if made.broken is not None:
            raise made.broken
        improved.report.diagnosis.failed.show(record)
        Loads.of_fit(made.problem, made.fit, partial(origin_of, prepared.measured)).show(record)
    for reason in improved.odd[len(prepared.hints) :]:
        record.warn(f"implausible: {reason}")
    inputs = prepared.inputs | ({} if rows is None else rows.inputs)
    return Improvement(machine=known, outcome=improved, inputs=inputs, **messages_of(record))
