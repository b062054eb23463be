"""The hangprinter's real sessions, calibrated with any three of its drives as inputs."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.errors_before_after import error_figures
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.holdout import cross_validate, fold_labels
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.measured_problem import problem_of
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.selection import select
from pkmcal_cli.compiler import compile_machine
from pkmcal_cli.language.machine_yaml import read_machine
from pkmcal_cli.tables.measurement_set import Measurements
from pkmcal_cli.tables.measurements import read_measurements
from tests.support import MACHINES, overlay

SESSIONS = ("2021-12-16", "2022-04-12")
LINES = ("D", "A", "B", "C")
ANCHORS, RADII = "auto", "auto,R_low,R_high"
RMS = {
    ("2021-12-16", ANCHORS): 4.96,
    ("2021-12-16", RADII): 1.14,
    ("2022-04-12", ANCHORS): 6.49,
    ("2022-04-12", RADII): 2.82,
}
"""Line-length rms in mm by an independent least-squares program, of which the data's README tells."""


def forced(line: str, extra: str = "") -> str:
    """The machine whose `line` is force-controlled and redundant, the other three placing the point."""
    if line == "D":
        return overlay("hangprinter", extra)
    return overlay(
        "hangprinter",
        "actuators:\n  D: {redundant: false, control: position, force: null}\n"
        f"  {line}: {{redundant: true, control: force, force: 0.1}}\n{extra}",
    )


@cache
def measured(session: str, line: str = "D", extra: str = "") -> tuple[Problem, Measurements]:
    """A session as a problem of that machine."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "machine.yaml"
        file.write_text(forced(line, extra), encoding="utf-8")
        machine = read_machine(file)
    table = read_measurements([MACHINES / f"hangprinter_{session}.csv"], machine)
    return problem_of(compile_machine(machine).model, table), table


@dataclass(frozen=True)
class Calibrated:
    """A fit, and its line-length rms in mm before and after."""

    fit: Fit
    values: Array  # (p,) of the selected parameters, SI
    before: float
    after: float


@cache
def calibrated(session: str, line: str, selection: str) -> Calibrated:
    """Calibration of a session with `line` force-controlled."""
    problem, _ = measured(session, line)
    model = problem.model
    fit = identify(problem, select(model, selection))
    before, after = (error_figures(problem, e)["length"].rms for e in (fit.before, fit.after))
    values = fit.values[[model.names.index(n) for n in fit.selected]]
    return Calibrated(fit, values, before * 1e3, after * 1e3)


@cache
def held_out(session: str, line: str, selection: str) -> tuple[float, int]:
    """Line-length rms in mm, held out in six folds, and the number of folds that failed."""
    problem, table = measured(session, line)
    labels, scheme = fold_labels("6", problem, table)
    found = cross_validate(problem, calibrated(session, line, selection).fit, labels, scheme)
    return found.after["length"].rms * 1e3, found.failed


def disagreement(session: str, selection: str) -> float:
    """Largest difference of a parameter between choices of inputs, in its standard uncertainty."""
    reference = calibrated(session, "D", selection)
    others = np.array([calibrated(session, line, selection).values for line in LINES[1:]])
    return float((np.abs(others - reference.values) / reference.fit.std).max())
