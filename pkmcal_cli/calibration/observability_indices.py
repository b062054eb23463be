"""What a plan or a table can determine before anything is fitted: rank, condition, O1 to O5, expected uncertainty."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.datum import Datum, datum_of
from pkmcal_cli.calibration.identifiability import Combination, Directions, combinations, directions
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import Evaluation, evaluate, linearise
from pkmcal_cli.units.measurands import Measurand


@dataclass(frozen=True, kw_only=True)
class Observability:
    """Of the range-scaled, whitened Jacobian.

    condition_number: of the paper's Js (unwhitened, positions only), nan where other kinds are measured too;
    indices: O1 (Borm and Menq), O2 (Driels and Pathre), O3, O4 (Nahvi and Hollerbach), O5 (Sun and Hollerbach);
    selected: names without those that are held as datum; std (p,): expected standard uncertainty, SI, nan where
    undetermined; alone (p,): the same without what ranges tell of weak directions.
    """

    directions: Directions
    condition_number: float
    indices: dict[str, float]
    std: Array
    undetermined: tuple[Combination, ...]
    evaluation: Evaluation
    count: int
    selected: tuple[str, ...]
    datum: Datum | None
    alone: Array


def observability(problem: Problem, values: Array, selected: tuple[str, ...]) -> Observability:
    """At parameter values (P,), for the rows and channels of a problem; only solved rows count."""
    evaluation = evaluate(problem, values, selected)
    rows = np.nonzero(evaluation.prediction.solved)[0]
    part = problem.take(rows)
    solved = evaluation if len(rows) == len(problem) else evaluate(part, values, selected)
    model = problem.model
    ranges = np.array([model.parameters[model.names.index(n)].range for n in selected])
    near = linearise(part, solved)
    spectrum = directions(near.jacobian, selected, ranges)
    datum = datum_of(part, values, spectrum)
    keep = [k for k, n in enumerate(selected) if datum is None or n not in datum.held]
    names = tuple(selected[k] for k in keep)
    if datum is not None:
        beside = None if datum.of_held is None else datum.of_held.in_ranges(model, names, model.ranges)
        spectrum = directions(near.jacobian[:, keep], names, ranges[keep], beside=beside)
    covariance = spectrum.covariance()
    return Observability(
        directions=spectrum,
        condition_number=_paper_condition(part, solved, names, ranges[keep], keep),
        indices=observability_indices(spectrum.singular_values, part.count),
        std=np.sqrt(np.diag(covariance)) if names else np.zeros(0),
        undetermined=combinations(spectrum),
        evaluation=evaluation,
        count=part.count,
        selected=names,
        datum=datum,
        alone=spectrum.std_of_data(),
    )


def _paper_condition(
    problem: Problem, evaluation: Evaluation, selected: tuple[str, ...], ranges: Array, keep: list[int]
) -> float:
    """Condition number of Js = J Hs (eq. 21), where only positions are measured."""
    jacobian = evaluation.prediction.jacobian
    assert jacobian is not None
    kinds = {c.measurand for k, c in enumerate(problem.model.channels) if problem.measured[:, k].any()}
    if kinds != {Measurand.POSITION}:
        return float("nan")
    rows = jacobian[problem.measured][:, keep]
    return directions(rows, selected, ranges).condition_number


def observability_indices(s: Array, count: int) -> dict[str, float]:
    """O1 ... O5 of singular values (p,) of `count` measured values; zero (O5 too) when one is zero."""
    if not len(s) or count == 0:
        return dict.fromkeys(("O1", "O2", "O3", "O4", "O5"), 0.0)
    largest, smallest = float(s[0]), float(s[-1])
    if smallest <= 1e-10 * largest:
        return dict.fromkeys(("O1", "O2", "O3", "O4", "O5"), 0.0)
    return {
        "O1": float(np.exp(np.log(s).mean()) / np.sqrt(count)),
        "O2": smallest / largest,
        "O3": smallest,
        "O4": smallest**2 / largest,
        "O5": float(1.0 / (1.0 / s).sum()),
    }
