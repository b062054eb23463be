"""Effects that are named, and tested alone: `--only`."""

from __future__ import annotations

from pkmcal_cli.base.errors import UsageError, did_you_mean
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.diagnosis.free_shapes import bare_shapes
from pkmcal_cli.diagnosis.hypotheses import Candidates
from pkmcal_cli.effects.unexplained import OVER_TIME, UNEXPLAINED


def named_only(candidates: Candidates, problem: Problem, text: str) -> Candidates:
    """The candidates that are named, separated by commas, and no others; displacements without a name too.

    Raises UsageError for names of no effect, and of effects that the table cannot show.
    """
    known = [*(h.name for h in candidates.hypotheses), *(shape.name for shape in bare_shapes(problem))]
    requested = tuple(dict.fromkeys(part.strip() for part in text.split(",") if part.strip()))
    lacking = dict(candidates.not_testable)
    for name in (name for name in requested if name not in known):
        if why := lacking.get(name.partition("@")[0]) or _time_for(name, known):
            raise UsageError(f"--only: this table cannot show `{name}`", hint=f"add what it needs: {why}")
        raise UsageError(f"--only: this machine has no effect `{name}`", hint=did_you_mean(name, known))
    if not requested:
        raise UsageError("--only names no effect", hint="write e.g. `--only zero@all,scale@upper`")
    return candidates.limited_to(requested)


def _time_for(name: str, known: list[str]) -> str:
    """What a displacement over time lacks at a place that has one over the travel; "" for other names."""
    over_travel = name.removesuffix(OVER_TIME)
    lacks = name.startswith(UNEXPLAINED) and over_travel != name and over_travel in known
    return "column `time`" if lacks else ""
