"""Judging the diagnosis of one look-alike of a real campaign by fixed rules; the page shows them."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterable
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import evaluate
from pkmcal_cli.diagnosis.findings import Finding
from pkmcal_cli.diagnosis.run_diagnosis import diagnose
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import frozen
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.workflow.search_case import Case, CaseRequest, prepare
from tests.truth.look_alikes.look_alike import LookAlike

ALPHA = 0.005


@dataclass(frozen=True, kw_only=True)
class Judged:
    """What became of one: plain values. `named`: every cause is; `in_set`: named, or in the set of a finding; `lone`:
    wrong names that stand alone; `after`, `declared`: error on fresh rows (in standard deviations of the readings)
    with what was found, and with the causes declared; `true_after`, `true_declared`: the same against true readings;
    `rows`: all bad rows are told; `lost`: how many good ones are told to be wrong."""

    scenario: str
    seed: int
    verdict: str
    found: list[str]
    named: bool
    in_set: bool
    lone: list[str]
    rows: bool
    lost: int
    after: float
    declared: float
    true_after: float
    true_declared: float
    seconds: float

    @property
    def held(self) -> bool:
        """Whether every cause is named or in a set, and the bad rows are told."""
        return self.in_set and self.rows

    @property
    def ratio(self) -> float:
        """Error on fresh rows over that of the true model."""
        return self.after / self.declared


def judged(scenario: str, seed: int, campaign: LookAlike) -> Judged:
    """Diagnoses a campaign as `pkmcal diagnose` does, and judges it."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        machine, true = written(folder, campaign)
        start = time.process_time()
        case = _prepared(machine, "table")
        d = diagnose(case.candidates, case.problem, case.selected, ALPHA, 0)
        seconds = time.process_time() - start
        told = _prepared(true, "table")
        good = told.problem.without(tuple(sorted(campaign.bad)))
        known = identify(good, told.selected, _start(campaign, good.model))
        found, best = (d.search.problem, d.search.fit.values), (good, known.values)
        errors = [
            _error(file, name, *fit) for name in ("fresh", "exact") for file, fit in ((machine, found), (true, best))
        ]
    told_rows = set(d.bad_rows) | set(d.failed)
    lone = [f.hypothesis.name for f in d.findings if is_lone(f) and not right(f, campaign)]
    return Judged(
        scenario=scenario,
        seed=seed,
        verdict=d.verdict,
        found=[described(f) for f in d.findings] + [f"unknown: {u.depends_on}" for u in d.unknown],
        named=all(_is(c, [f.hypothesis.name for f in d.findings]) for c in campaign.causes),
        in_set=all(_is(c, [r.hypothesis.name for f in d.findings for r in f.rivals]) for c in campaign.causes),
        lone=lone,
        rows=campaign.bad <= told_rows,
        lost=len(told_rows - campaign.bad),
        after=errors[0],
        declared=errors[1],
        true_after=errors[2],
        true_declared=errors[3],
        seconds=seconds,
    )


def written(folder: Path, campaign: LookAlike) -> tuple[Path, Path]:
    """Writes machine.yaml, true.yaml (the causes declared), the tables; returns both machine files."""
    machine, true = folder / "machine.yaml", folder / "true.yaml"
    machine.write_text(campaign.machine, encoding="utf-8")
    true.write_text(f"extends: machine.yaml\n{campaign.declared}", encoding="utf-8")
    for name, text in (("table", campaign.table), ("fresh", campaign.fresh), ("exact", campaign.exact)):
        (folder / f"{name}.csv").write_text(text, encoding="utf-8")
    return machine, true


def exact_residuals(campaign: LookAlike) -> Array:
    """Readings of the fresh rows minus what the engine predicts with all true values, in standard deviations."""
    with tempfile.TemporaryDirectory() as name:
        _, true = written(Path(name), campaign)
        problem = _prepared(true, "exact").problem
    return evaluate(problem, _start(campaign, problem.model)).residual / problem.sigma


def right(finding: Finding, campaign: LookAlike) -> bool:
    """Whether what was found is one of the causes."""
    return any(_is(c, [finding.hypothesis.name]) for c in campaign.causes)


def is_lone(finding: Finding) -> bool:
    """Whether a finding stands alone: no other effect in its set, and not called provisional."""
    return not finding.ambiguous and not finding.provisional


def described(finding: Finding) -> str:
    """A finding and its set in a line."""
    others = [r.hypothesis.name for r in finding.rivals if r.hypothesis != finding.hypothesis]
    more = f" ({', '.join(others)})" if others else ""
    return f"{finding.hypothesis.name}{more}{' provisional' if finding.provisional else ''}"


def _is(cause: Iterable[str], names: list[str]) -> bool:
    return any(fnmatchcase(n, pattern) for pattern in cause for n in names)


def _start(campaign: LookAlike, model: Model) -> Array:
    """The true values."""
    values = model.nominal.copy()
    for name, value in campaign.values.items():
        values[model.names.index(name)] = value
    return values


def _prepared(machine: Path, table: str) -> Case:
    """The machine and one of the tables beside it."""
    request = CaseRequest(machine=str(machine), measurements=(str(machine.with_name(f"{table}.csv")),))
    return prepare(request, Reporter(quiet=True))


def _error(machine: Path, table: str, fitted: Problem, values: Array) -> float:
    """rms over standard deviations of a table's readings by a fitted machine, whose travels, spans of time and
    references are those of the table that it was fitted to."""
    problem = _prepared(machine, table).problem
    there = replace(problem, model=frozen(fitted.model, fitted.rows))
    off = evaluate(there, values).residual / problem.sigma
    return float(np.sqrt((off[problem.measured] ** 2).mean()))
