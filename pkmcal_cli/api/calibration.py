"""Calibration."""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd

from pkmcal_cli.base.errors import PkmcalWarning
from pkmcal_cli.base.listener import Record
from pkmcal_cli.base.outputs import write_text
from pkmcal_cli.calibration.complete_fit import FitOptions
from pkmcal_cli.calibration.errors_before_after import ErrorFigures
from pkmcal_cli.language.machine import Machine as MachineFile
from pkmcal_cli.pictures.picture import Picture
from pkmcal_cli.report.figures import figure_unit
from pkmcal_cli.workflow.calibration import Calibrated, CalibrationRequest, calibration, parameter_text, setting

from .computing import computing
from .machine import Machine, load, number
from .options import Names, names_of, whole
from .result import Result, messages_of, residual_frame
from .tables import Parameters, Table, measured_frame, parameters_of, source_of, sources_of

_STARTS = 200


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Calibration(Result):
    """Identified parameters of a machine, with their uncertainties."""

    outcome: Calibrated  # not stable

    @property
    def status(self) -> str:
        """`converged`, `incomplete`, `implausible`, `not_converged` or `nothing_identifiable`."""
        return self.outcome.report.status

    @property
    def ok(self) -> bool:
        """Whether the parameters can be used."""
        return self.outcome.report.usable

    @property
    def verdict(self) -> str:
        """How it ended, and why not well."""
        return self.outcome.report.verdict()

    @property
    def chi2_per_dof(self) -> float:
        """Chi-square per degree of freedom: 1 where nothing but the stated noise is left."""
        return float(self.outcome.report.fit.chi2_per_dof)

    @property
    def parameters(self) -> pd.DataFrame:
        """Selected parameters by name; nominal, value, std, low, high (of 95 %) and range are in `unit`.

        std, low and high are nan where the data do not determine the parameter.
        """
        rows = [r for r in self.outcome.report.rows if r.selected]
        cells = [
            {
                "name": r.name,
                "nominal": r.nominal,
                "value": r.value,
                "std": number(r.std),
                "low": number(None if r.interval is None else r.interval[0]),
                "high": number(None if r.interval is None else r.interval[1]),
                "range": r.range,
                "unit": r.unit,
                "identified": r.identified,
                "remark": r.reason or "",
            }
            for r in rows
        ]
        return pd.DataFrame(cells).set_index("name") if cells else pd.DataFrame(cells)

    @property
    def errors(self) -> pd.DataFrame:
        """Root mean square and largest error by kind, in `unit`: before, after, and of rows that were held out."""
        report, held = self.outcome.report, self.outcome.report.held_out
        apart = {} if isinstance(held, str) else held.after
        return error_frame(self.machine.loaded.machine, report.before, report.after, apart)

    @property
    def held_out(self) -> str:
        """Which rows were held out in turn, or why none."""
        held = self.outcome.report.held_out
        return f"not available: {held}" if isinstance(held, str) else held.scheme

    @property
    def table(self) -> pd.DataFrame:
        """The rows that were measured, in the units of the machine file."""
        return measured_frame(self.machine.loaded.machine, self.outcome.setting.measured)

    @property
    def residuals(self) -> pd.DataFrame:
        """Measured minus predicted, with the rows of `table`."""
        return residual_frame(self.outcome.report.problem, self.outcome.report.fit.after)

    @property
    def residuals_before(self) -> pd.DataFrame:
        """The same with the parameters that the fit began with."""
        return residual_frame(self.outcome.report.problem, self.outcome.report.fit.before)

    def json(self) -> dict[str, Any]:
        """What `pkmcal calibrate --json` says, without provenance and limits."""
        return self.outcome.json

    def parameter_text(self) -> str:
        """Text of the parameter file."""
        return parameter_text(self.outcome, arguments=["pkmcal.calibrate"])

    def write(self, file: str | os.PathLike[str], *, force: bool = False) -> None:
        """Write the parameter file; `force`: over another one. Raises OutputError."""
        with write_text(os.fspath(file), self.outcome.setting.inputs, force=force) as text:
            text.write(self.parameter_text())

    def _picture(self) -> Picture:
        return self.outcome.picture


def error_frame(
    machine: MachineFile,
    before: dict[str, ErrorFigures],
    after: dict[str, ErrorFigures],
    held_out: dict[str, ErrorFigures],
) -> pd.DataFrame:
    """Figures by kind, in the machine's units."""
    rows = []
    for kind, figures in after.items():
        scale = (unit := figure_unit(machine, figures)).scale
        apart = held_out.get(kind)
        row = {"kind": kind, "rms_before": before[kind].rms / scale, "rms_after": figures.rms / scale}
        row |= {"max_before": before[kind].largest / scale, "max_after": figures.largest / scale}
        row["rms_held_out"] = number(None if apart is None else apart.rms / scale)
        row["max_held_out"] = number(None if apart is None else apart.largest / scale)
        rows.append(row | {"unit": unit.text})
    return pd.DataFrame(rows).set_index("kind") if rows else pd.DataFrame(rows)


def calibrate(
    machine: str | os.PathLike[str] | Machine,
    measurements: Table | Sequence[Table],
    *,
    select: Names = "auto",
    holdout: int | str | Table | None = None,
    parameters: Parameters | None = None,
    method: str = "exact",
    loss: str = "squares",
    prior: Parameters = "none",
    loosen: str | None = None,
    uncertainty: str = "linear",
    starts: int = 0,
    seed: int = 0,
    jobs: int = 1,
) -> Calibration:
    """Which dimensions explain the measurements, and how uncertain are they? As `pkmcal calibrate`.

    measurements: one table or several, each of which is a session; holdout: a number of folds, `session`, `cells`,
    `none`, or a table of its own; jobs: processes, 0 for all cores. Warns with PkmcalWarning where the parameters
    cannot be used. Raises PkmcalError.
    """
    known = load(machine)
    options = FitOptions(
        loss=loss, prior=_prior(prior), uncertainty=uncertainty, seed=whole("seed", seed),
        starts=whole("starts", starts, _STARTS), jobs=whole("jobs", jobs),
    )  # fmt: skip
    request = CalibrationRequest(
        machine=known.file, measurements=sources_of(measurements), select=names_of(select), holdout=_apart(holdout),
        parameters=parameters_of(parameters), method=method, fit_options=options, loosen=loosen,
    )  # fmt: skip
    record = Record()
    with computing():
        calibrated = calibration(setting(request, known.loaded), record)
        calibrated.report.failed.show(record)
    result = Calibration(machine=known, outcome=calibrated, **messages_of(record))
    if not result.ok:
        warnings.warn(result.verdict, PkmcalWarning, stacklevel=2)
    return result


def _prior(prior: Parameters) -> str:
    """What is known besides: a word, or parameters."""
    return prior if isinstance(prior, str) else parameters_of(prior) or "none"


def _apart(holdout: int | str | Table | None) -> str | None:
    """What is held out: a number or word, or a table."""
    if holdout is None or isinstance(holdout, str):
        return holdout
    if isinstance(holdout, os.PathLike | pd.DataFrame | Mapping):
        return source_of(holdout, "holdout")
    return str(whole("holdout", holdout))
