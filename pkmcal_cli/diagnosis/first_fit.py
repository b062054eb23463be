"""The fit that is diagnosed, and where fits begin."""

from __future__ import annotations

from dataclasses import replace

from pkmcal_cli.calibration.estimated_ranges import centred
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.starts import best_of_starts
from pkmcal_cli.diagnosis.gross_rows import gross_rows
from pkmcal_cli.diagnosis.hypotheses import Candidates
from pkmcal_cli.diagnosis.search_options import SearchOptions

_SOON = 15  # steps in which fits converge, unless something is wrong


def calibrated(
    candidates: Candidates, problem: Problem, selected: tuple[str, ...], options: SearchOptions
) -> tuple[Candidates, Fit]:
    """The fit that is diagnosed, and where fits begin.

    That is as given, but at nominal values in directions that the data hardly see: the ranges hold them there. Where
    the fit does not soon converge, it is that of the other rows, if some are gross where it begins; where it does not
    at all, that from further starts.
    """
    start = replace(candidates, model=problem.model).begin()
    fit = identify(problem, selected, start, iterations=_SOON)
    if fit.status == "not_converged":
        states = fit.before.start
        _, others = gross_rows(problem, selected, options.parts.rows, options.seed, start=start, states=states)
        if others is not None and others.status == "converged":
            return candidates, others
        fit = identify(problem, selected, start, states=states)
    if fit.status == "not_converged":
        best, _ = best_of_starts(problem, selected, start, fit, 0, options.seed)
        return candidates, fit if best is None else best
    if candidates.start is None or not fit.directions.weak.any():
        return candidates, fit
    start = centred(problem, start, start, fit.directions)
    return replace(candidates, start=start), identify(problem, selected, start, states=fit.before.start)
