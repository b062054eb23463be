"""How `calibrate` ends on a campaign."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from pkmcal_cli.base.errors import BadInput
from pkmcal_cli.calibration.measured_problem import problem_of
from pkmcal_cli.gross_errors.hints import absurd_rows, measurement_hints, rows_far_off, sample_at
from pkmcal_cli.loading.load_machine import LoadedMachine, load_machine, load_measurements
from pkmcal_cli.loading.poses import origin_of
from tests.command import MACHINES, clean, run
from tests.hostile.campaigns.listed import Lie
from tests.hostile.campaigns.sheet import Sheet

BAD = ("hint", "implausible", "failed", "error")
"""Ends with exit 1 or 3."""


@dataclass(frozen=True)
class End:
    """Status (`hint`: of a gross mistake, `failed`: not converged, `error`: refused), exit code, reasons in words."""

    status: str
    code: int
    reasons: tuple[str, ...] = ()


@cache
def _loaded(machine: str) -> LoadedMachine:
    return load_machine(str(MACHINES / f"{machine}.yaml"))


def _written(folder: str, tables: Sequence[Sheet]) -> list[str]:
    files = [Path(folder) / f"m{k + 1}.csv" for k in range(len(tables))]
    for file, table in zip(files, tables, strict=True):
        file.write_text(table.text(), encoding="utf-8")
    return [str(f) for f in files]


def before_the_fit(machine: str, files: Sequence[str]) -> End | None:
    """Where what `calibrate` looks at before the fit settles that it ends with 1 or 3."""
    try:
        data = load_measurements(_loaded(machine), files)
    except BadInput as error:
        return End("error", 3, tuple(f.text() for f in error.faults))
    problem = problem_of(_loaded(machine).model, data)
    if absurd := absurd_rows(problem, lambda row: origin_of(data, row)):
        return End("error", 3, tuple(f.text() for f in absurd))
    hints = measurement_hints(_loaded(machine), problem, problem.model.nominal, data)
    hints = hints or rows_far_off(sample_at(_loaded(machine), problem, problem.model.nominal), data)
    return End("hint", 1, hints) if hints else None


def ended(machine: str, tables: Sequence[Sheet], whole: bool = False) -> End:
    """`calibrate` from one start, without rows held out; `whole`: also where a hint settles how it ends."""
    with tempfile.TemporaryDirectory() as folder:
        files = _written(folder, tables)
        if not whole and (end := before_the_fit(machine, files)) is not None:
            return end
        path = MACHINES / f"{machine}.yaml"
        done = clean(run("calibrate", path, *files, "--holdout", "none", "--starts", "1", "--json"))
    if done.code == 3:
        return End("error", 3, tuple(done.err.splitlines()[-3:]))
    found = done.json
    status = "failed" if found["status"] in ("not_converged", "nothing_identifiable") else found["status"]
    return End(
        status, done.code, (*found["implausible"], *found["incomplete"], f"chi2/dof {found['chi2_per_dof']:.4g}")
    )


def told(lie: Lie, whole: bool = False) -> End:
    """How a campaign that lies ends."""
    return ended(lie.machine, lie.tables(), whole)
