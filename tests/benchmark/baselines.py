"""Two simple ways to name an effect, shown beside the diagnosis: correlation with the residual, and stepwise BIC."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.linear import Linear, linear_problem
from pkmcal_cli.diagnosis.run_diagnosis import Diagnosis

MOST = 5


def baselines(d: Diagnosis) -> dict[str, list[str]]:
    """Names by either way, all rows included, at the calibration of the declared parameters."""
    problem = replace(d.problem, measured=np.isfinite(d.problem.readings))
    every = d.search.candidates.hypotheses
    others = [n for h in every for n in h.parameters]
    linear = linear_problem(problem, d.before.values, d.before.selected, others, None)
    return {"correlation": [_most_alike(linear, every).name], "stepwise": [h.name for h in _stepwise(linear, every)]}


def _most_alike(linear: Linear, every: tuple[Hypothesis, ...]) -> Hypothesis:
    """The hypothesis whose columns, as they are, explain most of the residual."""

    def explained(h: Hypothesis) -> float:
        q, r = np.linalg.qr(linear.of(h.parameters))
        used = np.abs(np.diag(r)) > 1e-9 * np.abs(r).max()
        return float(((q[:, used].T @ linear.residual) ** 2).sum())

    return max(every, key=explained)


def _stepwise(linear: Linear, every: tuple[Hypothesis, ...]) -> list[Hypothesis]:
    """Forward selection while the Bayesian information criterion falls; the sigma that is stated; no refit."""
    chosen: list[Hypothesis] = []
    while len(chosen) < MOST:
        left = [h for h in every if h not in chosen]
        scores = [linear.score(linear.of(h.parameters)) for h in left]
        gains = [s.statistic - s.count * np.log(linear.used) if s.count else -np.inf for s in scores]
        best = int(np.argmax(gains))
        if gains[best] <= 0:
            break
        chosen.append(left[best])
        linear = linear.projecting((*linear.projected, *left[best].parameters))
    return chosen
