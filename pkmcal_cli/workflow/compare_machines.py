"""`compare M1.yaml M2.yaml TABLE.csv`: which of two machine files predicts rows better that it has not seen?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.errors import BadInput, Fault, Location
from pkmcal_cli.base.plural import count
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.complete_fit import FitOptions, refit
from pkmcal_cli.calibration.error_budget import error_budget, held_parameters
from pkmcal_cli.calibration.errors_before_after import kinds_of
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.holdout import fold_labels, replicate_groups
from pkmcal_cli.calibration.identify import RowsFailed
from pkmcal_cli.calibration.measured_problem import problem_of
from pkmcal_cli.calibration.paired_errors import PairedErrors, held_out_squares, paired
from pkmcal_cli.calibration.plausible import implausible_fit
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.range_check import range_check
from pkmcal_cli.calibration.residual import evaluate
from pkmcal_cli.calibration.unknown_sides import with_unknown_sides
from pkmcal_cli.gross_errors.hints import measurement_hints, nothing_measured, rows_far_off, sample_at
from pkmcal_cli.loading.load_machine import LoadedMachine, load_machine, load_measurements
from pkmcal_cli.loading.poses import origin_of
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.report.figures import unit_of
from pkmcal_cli.report.number_format import finite, readable
from pkmcal_cli.tables.measurement_set import Measurements
from pkmcal_cli.units.unit_text import Unit
from pkmcal_cli.workflow.arguments import selection
from pkmcal_cli.workflow.determined import determined
from pkmcal_cli.workflow.gross_row_reasons import beyond_noise

_LISTED = 5  # rows
_GROSS = 1e4  # chi-square per degree of freedom; where less is left, it may be the ranges that are too narrow
_FOLDS = 5


@dataclass(frozen=True, kw_only=True)
class MachineComparison:
    """Held-out errors of two machine files, of a kind of readings in a unit; how rows were held out.

    rows: of the table; failures: why some of them are not predicted.
    """

    machines: tuple[str, str]
    kind: str
    unit: Unit
    errors: PairedErrors
    scheme: str
    rows: int
    failures: str

    @property
    def enough(self) -> bool:
        """Whether the rows that both predict stand for the table."""
        return 2 * self.errors.count >= self.rows

    @property
    def better(self) -> str | None:
        """The machine file that predicts better; None where the rows do not tell."""
        return self.machines[self.errors.better - 1] if self.errors.better and self.enough else None

    @property
    def verdict(self) -> str:
        """For programs."""
        return "too few rows" if not self.enough else "one is better" if self.better else "no difference"

    def show(self, to: Reporter) -> None:
        """For people."""
        f, unit = self.errors, self.unit
        lost = f"{self.rows - f.count} of {self.rows} rows are not predicted by both{self.failures}"
        if not self.enough:
            to.fail(f"NOTHING TO COMPARE: {lost}; `pkmcal calibrate` says more")
        elif f.count < self.rows:
            to.warn(f"warning: {lost}")
        better = f"{self.better} predicts better" if self.better else "no difference" if self.enough else "these rows"
        change, low, high = (readable(x, unit) for x in (f.second - f.first, f.low, f.high))
        to.say(f"{better}: the held-out {self.kind} rms changes by {change}, 95 % interval {low} to {high}")
        rows = [(m, readable(x, unit)) for m, x in zip(self.machines, (f.first, f.second), strict=True)]
        to.table("Held-out error, the same rows", ("machine", f"{self.kind} rms"), rows)
        to.say(f"held out: {self.scheme}; {count(f.count, 'row')} in pairs")

    def json(self) -> dict[str, Any]:
        """The JSON result."""
        f, scale = self.errors, self.unit.scale
        return {
            "kind": "machines",
            "machines": list(self.machines),
            "better": self.better,
            "of": self.kind,
            "rms": [finite(f.first / scale), finite(f.second / scale)],
            "change": {"value": finite((f.second - f.first) / scale), "low": finite(f.low / scale)}
            | {"high": finite(f.high / scale)},
            "unit": self.unit.text,
            "count": f.count,
            "rows": self.rows,
            "scheme": self.scheme,
        }


def compare_machines(first: str, second: str, tables: tuple[str, ...], to: Reporter) -> MachineComparison:
    """Calibrate both on parts of the table, and predict the rest. Raises BadInput."""
    loaded = [load_machine(m, tables=tables) for m in (first, second)]
    measured = [load_measurements(m, tables) for m in loaded]
    problems = [problem_of(m.model, t) for m, t in zip(loaded, measured, strict=True)]
    problems = [with_unknown_sides(p, [x.name for x in p.model.parameters if x.identify]) for p in problems]
    for m, p in zip(loaded, problems, strict=True):
        if not p.count:
            raise BadInput([nothing_measured(m, p)])
    problems = _without_gross_rows(problems, measured[0], to)
    _check_plausible(loaded, problems, measured)
    labels, scheme = _folds(problems[0], measured[0])
    kinds = [kinds_of(p.model) for p in problems]
    kind = next((k for k in kinds[0] if k in kinds[1] and problems[0].measured[:, kinds[0][k]].any()), None)
    if kind is None:
        raise BadInput.single("the machines measure nothing of one kind", Location(tables[0]), code="measurements")
    whole = [_whole(name, p, to) for name, p in zip((first, second), problems, strict=True)]
    _check_explained(problems, whole, tables[0])
    held = [
        _squares(name, p, fit.selected, k[kind], labels, to)
        for name, p, fit, k in zip((first, second), problems, whole, kinds, strict=True)
    ]
    errors = paired(held[0][0], held[1][0], replicate_groups(problems[0]))
    failures = _failures((first, second), [f for _, f in held], len(np.unique(labels)))
    if not errors.count:
        message = f"no row can be predicted by both machines{failures}"
        raise BadInput.single(message, Location(tables[0]), "`pkmcal calibrate` says more", "measurements")
    dimension = problems[0].model.channels[kinds[0][kind][0]].dimension
    return MachineComparison(
        machines=(first, second), kind=kind, unit=unit_of(loaded[0].machine, dimension), errors=errors, scheme=scheme,
        rows=int(problems[0].measured.any(axis=1).sum()), failures=failures,
    )  # fmt: skip


def _failures(machines: Sequence[str], failures: Sequence[tuple[str, ...]], folds: int) -> str:
    """Fits of the other folds that failed, in words; "" for none."""
    words = [
        f"{machine}: {len(each)} of {folds} fits without a fold failed ({', '.join(dict.fromkeys(each))})"
        for machine, each in zip(machines, failures, strict=True) if each
    ]  # fmt: skip
    return f" ({'; '.join(words)})" if words else ""


def _without_gross_rows(problems: list[Problem], measured: Measurements, to: Reporter) -> list[Problem]:
    """The problems without rows that contradict the others for both machines: these are of no model."""
    with to.step("rows beyond noise"):
        gross = [
            set(beyond_noise(p, selection(p.model, "auto"), p.model.nominal, evaluate(p, p.model.nominal).start).far)
            for p in problems
        ]
    both = sorted(gross[0] & gross[1])
    if both:
        listed = ", ".join(str(origin_of(measured, row)) for row in both[:_LISTED])
        more = f" and {len(both) - _LISTED} more" if len(both) > _LISTED else ""
        to.warn(f"warning: {count(len(both), 'row')} far from what the others predict left out: {listed}{more}")
    return [p.without(both) for p in problems]


def _check_plausible(
    loaded: Sequence[LoadedMachine], problems: Sequence[Problem], tables: Sequence[Measurements]
) -> None:
    """Whether the table fits at least one machine. Raises BadInput with its gross mistakes: nothing is told by them."""
    hints = []
    for machine, problem, measured in zip(loaded, problems, tables, strict=True):
        sample = sample_at(machine, problem, problem.model.nominal)
        messages = measurement_hints(machine, problem, problem.model.nominal, measured, sample=sample)
        hints.append(messages or rows_far_off(sample, measured))
    if all(hints):
        raise BadInput([Fault("plausibility", text, Location(tables[0].files[0])) for text in hints[0]])


def _whole(machine: str, problem: Problem, to: Reporter) -> Fit:
    """The fit of all rows. Raises BadInput where not even these can be fitted."""
    model = problem.model
    selected = determined(model.name, problem, model.nominal, selection(model, "auto")).selected
    with to.step(f"{machine} on all rows"):
        try:
            whole = refit(FitOptions(), problem, selected, model.nominal)
            why = "" if whole.usable else f" ({whole.status})"
        except RowsFailed:
            why = ": it reaches too few of them"
    if why:
        message = f"the calibration of this machine by all rows does not succeed{why}"
        raise BadInput.single(message, Location(machine), "`pkmcal calibrate` says more", "measurements")
    return whole


def _check_explained(problems: Sequence[Problem], fits: Sequence[Fit], table: str) -> None:
    """Whether the rows are explained by at least one machine that could have been built. Raises BadInput."""
    reasons = [_implausible(p, f) if f.chi2_per_dof > _GROSS else () for p, f in zip(problems, fits, strict=True)]
    if all(reasons):
        message = f"neither machine explains these rows ({'; '.join(reasons[0])})"
        raise BadInput.single(message, Location(table), "`pkmcal calibrate` says more", "plausibility")


def _implausible(problem: Problem, fit: Fit) -> tuple[str, ...]:
    """Why a fit is not to be believed."""
    part = problem.without(fit.failed)
    checked = range_check(part, fit, error_budget(part, fit, held_parameters(part, fit.selected, ())))
    return implausible_fit(part, fit, checked)


def _squares(
    machine: str,
    problem: Problem,
    selected: tuple[str, ...],
    columns: list[int],
    folds: NDArray[np.intp],
    to: Reporter,
) -> tuple[Array, tuple[str, ...]]:
    """Squared errors of held-out rows, and why some are not predicted."""
    with to.step(f"{machine} on held-out rows"):
        return held_out_squares(problem, selected, problem.model.nominal, folds, columns)


def _folds(problem: Problem, measured: Measurements) -> tuple[NDArray[np.intp], str]:
    """Folds of the rows. Raises BadInput for too few."""
    try:
        return fold_labels(str(_FOLDS), problem, measured)
    except ValueError as error:
        raise BadInput.single(str(error), Location(measured.files[0]), "measure more poses", "measurements") from None
