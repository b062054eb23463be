"""Before a fit: are there equations enough, and has the base a place? What is held as datum, and what is refused."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.condensed import condensed, evaluate_condensed
from pkmcal_cli.calibration.datum import Datum, datum_of
from pkmcal_cli.calibration.identifiability import Directions, combinations, directions
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.prediction import WarmStart

_FEW = (
    "measure more, identify fewer parameters (`--select`), or let an earlier calibration take part: "
    "`pkmcal calibrate --prior OLD.params.yaml`"
)
_LISTED = 8  # null directions that are told one by one


@dataclass(frozen=True)
class Determinacy:
    """What is to be identified: `selected` without the datum's parameters; or why not, and the remedy."""

    selected: tuple[str, ...]
    datum: Datum | None
    refusal: str = ""
    remedy: str = ""

    @property
    def notes(self) -> tuple[str, ...]:
        """What is to be told."""
        if self.datum is None:
            return ()
        if not self.datum.missing:
            return (self.datum.text,)
        proposed = ", ".join(self.datum.proposed)
        return (f"{self.datum.text}; only ranges hold the rest: declare `datum: [{proposed}]`",)

    def of(self, problem: Problem, values: Array) -> Problem:
        """The problem with the datum held at parameter values (P,), and what is known of the others relative to it."""
        held = None if self.datum is None else self.datum.of_held
        if held is None:
            return problem
        prior = None if problem.prior is None else problem.prior.relative_to(held, problem.model, values)
        return replace(problem, prior=prior, datum=held)


def determinacy(
    problem: Problem, values: Array, selected: tuple[str, ...], states: WarmStart | None = None
) -> Determinacy:
    """What the data can be asked for at parameter values (P,), if most rows can be predicted there.

    `states`: of the rows, at these values. Ranges place no base: half way between two ranges is no datum.
    """
    seen = problem if problem.prior is None else replace(problem, prior=problem.prior.without_ranges)
    directions_, whole = _directions(seen, values, selected, states)
    if directions_ is None:
        return Determinacy(selected, None)
    datum = datum_of(seen, values, directions_)
    held = datum.held if datum is not None else ()
    kept = tuple(n for n in selected if n not in held)
    if datum is not None and datum.missing and problem.prior is None:
        left = ", ".join(datum.gauge.motions)
        message = f"the data do not fix the base ({left}); {_counts(problem, directions_, datum)}"
        proposed = f"`datum: [{', '.join(datum.proposed)}]`"
        remedy = f"declare what defines the base: {proposed}; any such choice describes the same machine"
        return Determinacy(kept, datum, message, remedy)
    known = 0 if problem.prior is None else len(problem.prior.rows)
    if problem.count + known < problem.unknowns(kept) and whole:  # else the fit tells which rows cannot be predicted
        message = f"too few equations: {_counts(problem, directions_, datum)}; undetermined: {_listed(directions_)}"
        return Determinacy(kept, datum, message, _FEW)
    return Determinacy(kept, datum)


def _directions(
    problem: Problem, values: Array, selected: tuple[str, ...], states: WarmStart | None
) -> tuple[Directions | None, bool]:
    """Null and weak directions, None where most rows cannot be predicted; whether all can."""
    if not selected or not problem.count:
        return None, False
    evaluation = evaluate_condensed(problem, values, selected, states)
    rows = np.nonzero(evaluation.prediction.solved)[0]
    part = problem if len(rows) == len(problem) else problem.take(rows)
    if len(rows) < len(problem) / 2 or (problem.measured.any(axis=0) & ~part.measured.any(axis=0)).any():
        return None, False  # the others may be those that say where the base is
    solved = evaluation if part is problem else evaluate_condensed(part, values, selected, evaluation.start.take(rows))
    ranges = np.array([problem.model.parameters[problem.model.names.index(n)].range for n in selected])
    return directions(condensed(part, solved).jacobian, selected, ranges), part is problem


def _counts(problem: Problem, directions_: Directions, datum: Datum | None) -> str:
    free = 0 if datum is None else len(datum.held)
    unknowns = problem.unknowns(directions_.names) - free
    return f"{problem.count} equations, {unknowns} unknowns, {int(directions_.null.sum()) - free} null directions"


def _listed(directions_: Directions) -> str:
    """The null directions in words."""
    texts = [text for c in combinations(directions_) if c.kind == "null" for text in c.texts]
    more = f" and {len(texts) - _LISTED} more" if len(texts) > _LISTED else ""
    return "; ".join(texts[:_LISTED]) + more
