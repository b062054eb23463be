"""What is kept of a calibration by `--run`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pkmcal_cli.report.calibration import CalibrationReport
from pkmcal_cli.report.figures import figure_unit
from pkmcal_cli.report.number_format import readable
from pkmcal_cli.workflow.run_folder import PARAMETERS, Run


def calibration_run(
    machine: str,
    asked: Mapping[str, Any],
    report: CalibrationReport,
    result: dict[str, Any],
    parameters: str,
    code: int,
) -> Run:
    """The run; result: as JSON has it; parameters: text of the parameter file; code: exit code."""
    return Run(
        command="calibrate",
        machine=machine,
        asked=asked,
        result=result,
        code=code,
        verdict=report.verdict().partition("\n")[0],
        rms=_rms(report),
        files={PARAMETERS: parameters},
    )


def _rms(report: CalibrationReport) -> str:
    """The first error in words, of held-out rows where there are some."""
    apart = not isinstance(report.held_out, str)
    kinds = report.after if isinstance(report.held_out, str) else report.held_out.after
    figures = next(iter(kinds.values()), None)
    if figures is None:
        return ""
    return readable(figures.rms, figure_unit(report.machine, figures)) + (" (held out)" if apart else "")
