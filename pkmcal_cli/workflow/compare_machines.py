"""`compare M1.yaml M2.yaml TABLE.csv`: which of two machine files predicts rows better that it has not seen?"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.errors import BadInput, Location
from pkmcal_cli.base.plural import count
from pkmcal_cli.calibration.errors_before_after import kinds_of
from pkmcal_cli.calibration.holdout import fold_labels, replicate_groups
from pkmcal_cli.calibration.measured_problem import problem_of
from pkmcal_cli.calibration.paired_errors import PairedErrors, held_out_squares, paired
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.gross_errors.hints import nothing_measured
from pkmcal_cli.loading.load_machine import load_machine, load_measurements
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.report.figures import unit_of
from pkmcal_cli.report.number_format import finite, readable
from pkmcal_cli.tables.measurement_set import Measurements
from pkmcal_cli.units.unit_text import Unit
from pkmcal_cli.workflow.arguments import selection
from pkmcal_cli.workflow.determined import determined

_FOLDS = 5


@dataclass(frozen=True)
class MachineComparison:
    """Held-out errors of two machine files, of a kind of readings in a unit; how rows were held out."""

    machines: tuple[str, str]
    kind: str
    unit: Unit
    errors: PairedErrors
    scheme: str

    def show(self, to: Reporter) -> None:
        """For people."""
        f, unit = self.errors, self.unit
        better = f"{self.machines[f.better - 1]} predicts better" if f.better else "no difference"
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
            "better": self.machines[f.better - 1] if f.better else None,
            "of": self.kind,
            "rms": [finite(f.first / scale), finite(f.second / scale)],
            "change": {"value": finite((f.second - f.first) / scale), "low": finite(f.low / scale)}
            | {"high": finite(f.high / scale)},
            "unit": self.unit.text,
            "count": f.count,
            "scheme": self.scheme,
        }


def compare_machines(first: str, second: str, tables: tuple[str, ...], to: Reporter) -> MachineComparison:
    """Calibrate both on parts of the table, and predict the rest. Raises BadInput."""
    loaded = [load_machine(m) for m in (first, second)]
    measured = [load_measurements(m, tables) for m in loaded]
    problems = [problem_of(m.model, t) for m, t in zip(loaded, measured, strict=True)]
    for m, p in zip(loaded, problems, strict=True):
        if not p.count:
            raise BadInput([nothing_measured(m, p)])
    labels, scheme = _folds(problems[0], measured[0])
    kinds = [kinds_of(p.model) for p in problems]
    kind = next((k for k in kinds[0] if k in kinds[1] and problems[0].measured[:, kinds[0][k]].any()), None)
    if kind is None:
        raise BadInput.single("the machines measure nothing of one kind", Location(tables[0]), code="measurements")
    squares = []
    for name, p, columns in zip((first, second), problems, (k[kind] for k in kinds), strict=True):
        selected = selection(p.model, "auto")
        asked = determined(p.model.name, p, p.model.nominal, selected)
        with to.step(f"{name} on held-out rows"):
            squares.append(held_out_squares(p, asked.selected, p.model.nominal, labels, columns))
    errors = paired(squares[0], squares[1], replicate_groups(problems[0]))
    if not errors.count:
        raise BadInput.single("no row can be predicted by both machines", Location(tables[0]), code="measurements")
    if errors.count < len(problems[0]):
        to.warn(f"warning: {len(problems[0]) - errors.count} of {len(problems[0])} rows are not predicted by both")
    dimension = problems[0].model.channels[kinds[0][kind][0]].dimension
    return MachineComparison((first, second), kind, unit_of(loaded[0].machine, dimension), errors, scheme)


def _folds(problem: Problem, measured: Measurements) -> tuple[NDArray[np.intp], str]:
    """Folds of the rows. Raises BadInput for too few."""
    try:
        return fold_labels(str(_FOLDS), problem, measured)
    except ValueError as error:
        raise BadInput.single(str(error), Location(measured.files[0]), "measure more poses", "measurements") from None
