"""A cause of plausible size where a calibration without it has run away: accepted by its own fit, from nominal values.

Linear tests there, where declared parameters are far off to take it up, rank it and its rivals by what is not linear.
With it parameters are back, and all later fits begin there; what it is not told from is judged there too.
"""

from __future__ import annotations

from dataclasses import replace

from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.refits import refit
from pkmcal_cli.diagnosis.scoring import Search, score_without

_WORSE = 1.1  # times the chi-square of the cause of any size: with more, its range does not hold it


def with_near_cause(search: Search, hypothesis: Hypothesis, fit: Fit) -> Search | None:
    """The search with a cause of plausible size accepted as by linear tests; None where its range does not hold it.

    fit: with the cause, of any size.
    """
    whole, names = hypothesis.whole, search.problem.model.names
    index, begin = [names.index(n) for n in whole.parameters], fit.values.copy()
    size = fit.values[index] - search.null[index]
    begin[index] = search.null[index]
    after = replace(search, candidates=replace(search.candidates, start=begin)).accepting([whole])
    again = refit(after, {whole: size}, fit.chi2)
    if again is None or again.chi2 > _WORSE * fit.chi2:
        return None
    after = replace(after, fit=again)
    near, name = score_without(after, [whole], [whole]), whole.name
    p_values = search.p_values | {name: float(near.p_values[0])}
    return replace(after, p_values=p_values, evidence=search.evidence | {name: float(near.log_bayes[0])})
