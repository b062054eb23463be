"""The table that `study -o` writes: a line for every machine and number of points."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pkmcal_cli.calibration.study_figures import CaseFigures, Mean
from pkmcal_cli.csv_files.origin import Origin
from pkmcal_cli.csv_files.writer import Values, open_writer
from pkmcal_cli.report.parameters import parameter_unit
from pkmcal_cli.report.study import StudyReport

_NONE = Mean(float("nan"), float("nan"))


def write_study(
    report: StudyReport, target: str, inputs: Mapping[str, str], head: Mapping[str, Any], *, force: bool
) -> None:
    """Columns of means and their standard uncertainties (`u_`); empty where a machine has no such parameter.

    Raises OutputError.
    """
    cases, tool = report.cases, report.tool_unit.text
    columns: list[tuple[str, str | None]] = [("machine", None), ("points", None), ("n", None), ("failed", None)]
    cells: list[Values] = [[c.machine for c in cases]]
    cells += [np.array([getattr(c, name) for c in cases]) for name in ("points", "count", "failed")]
    means = [("tool", tool, [c.tool for c in cases]), *_kinds(report), *_parameters(report)]
    for name, unit, mean_errors in means:
        columns += [(name, unit), (f"u_{name}", unit)]
        cells += [np.array([m.value for m in mean_errors]), np.array([m.std for m in mean_errors])]
    note = "errors after calibration of simulated machines: mean and standard uncertainty of the mean"
    with open_writer(target, columns, inputs, origin=Origin("study", note, head), digits=5, force=force) as writer:
        writer.write(cells)


def _kinds(report: StudyReport) -> list[tuple[str, str, list[Mean]]]:
    """Of all parameters, and of those that all machines have, by dimension."""
    out = []
    for kind, unit in report.units.items():
        out.append((kind, unit.text, [c.kinds.get(kind, _NONE) for c in report.cases]))
        if any(kind in c.common for c in report.cases):
            out.append((f"common_{kind}", unit.text, [c.common.get(kind, _NONE) for c in report.cases]))
    return out


def _parameters(report: StudyReport) -> list[tuple[str, str, list[Mean]]]:
    """Of every parameter of any machine."""

    def of(name: str, case: CaseFigures) -> Mean:
        return case.parameters.get(name, _NONE)

    units = {
        n: report.units[parameter_unit(m.model, n).dimension.name].text
        for m in report.study.machines
        for n in m.selected
    }
    return [(f"error.{name}", unit, [of(name, case) for case in report.cases]) for name, unit in units.items()]
