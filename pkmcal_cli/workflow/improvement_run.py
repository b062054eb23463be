"""What is kept of a closed loop by `--run`: the improved machine, which extends the kept copy, and its parameters."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from pkmcal_cli.base.errors import BadInput, Location, OutputError
from pkmcal_cli.language.fingerprint import Fingerprint, fingerprint_of
from pkmcal_cli.language.machine_yaml import read_machine
from pkmcal_cli.report.figures import figure_unit
from pkmcal_cli.report.improvement import ImprovementReport
from pkmcal_cli.report.number_format import readable
from pkmcal_cli.workflow.run_folder import PARAMETERS, Run, copy_of

_IMPROVED = "improved.yaml"


def improvement_run(
    machine: str,
    asked: Mapping[str, Any],
    inputs: Mapping[str, str],
    report: ImprovementReport,
    head: dict[str, Any],
    result: Mapping[str, Any],
    code: int,
) -> Run:
    """The run; inputs: sha256 by name; head: provenance of the parameters; code: exit code."""
    with tempfile.TemporaryDirectory() as folder:
        overlay = Path(folder) / _IMPROVED
        overlay.write_text(report.overlay(os.path.abspath(machine)), encoding="utf-8")
        fingerprint = replace(fingerprint_of_improved(str(overlay), inputs), of=_IMPROVED)
    figures = report.improvement.after.report.get(report.improvement.shown.name)
    rms = "" if figures is None else f"{readable(figures.rms, figure_unit(report.machine, figures))} (held out)"
    return Run(
        command="improve",
        machine=machine,
        asked=asked,
        result=result,
        code=code,
        verdict=report.verdict,
        rms=rms,
        files={
            _IMPROVED: report.overlay(copy_of(machine, inputs)),
            PARAMETERS: report.parameter_file(head, fingerprint),
        },
    )


def fingerprint_of_improved(overlay: str, inputs: Mapping[str, str]) -> Fingerprint:
    """Of the improved machine, as every command will read it. Raises BadInput where its base is not the same."""
    try:
        improved = read_machine(overlay)
    except BadInput as error:
        overlay_faults = [
            f.what for f in error.faults if f.code == "file" and f.where is not None and f.where.file == overlay
        ]
        if overlay_faults:  # what was just written, which is no input
            raise OutputError(f"cannot be written: {overlay_faults[0]}", overlay) from error
        raise
    for name, digest in improved.files[1:]:
        if digest not in inputs.values():
            message = "this file has changed since it was read, so the improved machine would differ"
            raise BadInput.single(message, Location(name), "run the command again", "file")
    return fingerprint_of(improved)
