"""Effects that are named, and tested alone: `--only`."""

from __future__ import annotations

from collections.abc import Collection

from pkmcal_cli.base.errors import UsageError, did_you_mean, edits, nearest
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.diagnosis.free_shapes import bare_shapes
from pkmcal_cli.diagnosis.hypotheses import Candidates
from pkmcal_cli.effects.unexplained import OVER_TIME, UNEXPLAINED

_LISTED = 8  # places in a hint


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
        raise UsageError(f"--only: this machine has no effect `{name}`", hint=like_effect(name, known))
    if not requested:
        raise UsageError("--only names no effect", hint="write e.g. `--only zero@all,scale@upper`")
    return candidates.limited_to(requested)


def like_effect(name: str, known: Collection[str], otherwise: str | None = None) -> str | None:
    """A hint for a name that is none of `known`: the one most like it; where several are, the places of its effect."""
    places = [each for each in known if each.partition("@")[0] == name.partition("@")[0]]
    best = nearest(name, known)
    if places and (best is None or sum(edits(name, p) <= edits(name, best) for p in places) > 1):
        return f"name one of {', '.join(places[:_LISTED])}" + (", ..." if len(places) > _LISTED else "")
    return did_you_mean(name, known, otherwise)


def _time_for(name: str, known: list[str]) -> str:
    """What a displacement over time lacks at a place that has one over the travel; "" for other names."""
    over_travel = name.removesuffix(OVER_TIME)
    lacks = name.startswith(UNEXPLAINED) and over_travel != name and over_travel in known
    return "column `time`" if lacks else ""
