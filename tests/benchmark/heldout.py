"""The error of a diagnosed machine on a second campaign of the same day, against what the truth's family would give."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import evaluate
from pkmcal_cli.diagnosis.run_diagnosis import Diagnosis
from pkmcal_cli.prediction import frozen
from tests.benchmark.cases import Case
from tests.benchmark.setting import ready

if TYPE_CHECKING:
    from pkmcal_cli.diagnosis.hypotheses import Hypothesis


def held_out(case: Case, d: Diagnosis) -> dict[str, float]:
    """rms (m) on rows of another stream, against their true readings: before, after, with the planted family declared
    from the start (`floor`), and what noise alone does to the parameters of that fit (`noise`)."""
    fitted = d.search.problem
    model = frozen(d.search.candidates.model, fitted.rows)
    other = case.measured(stream=1)
    there = replace(ready(other).problem, model=model, readings=other.true_readings)
    hypotheses = {h.name: h for h in d.first.hypotheses}
    planted = [hypotheses[d.same.get(x.name, x.name)] for x in case.drawn]
    declared = _selected(d, planted)
    start = d.search.fit.values.copy()
    start[[model.names.index(n) for s in d.shapes for n in s.hypothesis.parameters]] = 0.0
    before = np.concatenate([d.before.values, np.zeros(len(start) - len(d.before.values))])
    floor = identify(fitted, declared, start)
    return {
        "before": _rms(there, before),
        "after": _rms(there, d.search.fit.values),
        "floor": _rms(there, floor.values),
        "noise": _noise(there, floor.values, declared, floor.covariance),
    }


def _selected(d: Diagnosis, planted: list[Hypothesis]) -> tuple[str, ...]:
    """The declared parameters and those of the planted effects, in the model's order."""
    names = {*d.before.selected, *(n for h in planted for n in h.parameters)}
    return tuple(n for n in d.search.candidates.model.names if n in names)


def _rms(problem: Problem, values: Array) -> float:
    return float(np.sqrt((evaluate(problem, values).residual ** 2).mean()))


def _noise(problem: Problem, values: Array, names: tuple[str, ...], covariance: Array) -> float:
    """rms of the prediction's standard uncertainty by the parameters; undetermined ones move nothing here."""
    jacobian = evaluate(problem, values, names).prediction.jacobian
    assert jacobian is not None
    flat = jacobian.reshape(-1, len(names))
    known = np.isfinite(np.diag(covariance))
    flat, covariance = flat[:, known], covariance[np.ix_(known, known)]
    return float(np.sqrt(np.einsum("np,pq,nq->n", flat, covariance, flat).mean()))
