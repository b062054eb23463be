"""Effects that explain what was fitted but not what was not: no causes, but something depends on what they do."""

from __future__ import annotations

import numpy as np

from pkmcal_cli.diagnosis.groups import DIRECTION, LOAD, POSE, TEMPERATURE, TIME
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.model_discrepancy import discrepancy_columns
from pkmcal_cli.diagnosis.scoring import Scored, Search
from pkmcal_cli.diagnosis.unknown import Unknown
from pkmcal_cli.effects import Column, catalogue
from pkmcal_cli.model.effect_sites import ALL, place_and_session

_BY_COLUMN: dict[Column, str] = {
    "temperature": TEMPERATURE,
    "time": TIME,
    "direction": DIRECTION,
    "payload": LOAD,
    "spindle": "spindle",
    "session": "session",
    "force": LOAD,
}


def refuted_causes(search: Search, last: Scored) -> list[Unknown]:
    """Of effects that rows held out speak against, those that are still significant; `last`: scored at the end."""
    if not search.vetoed:
        return []
    extra = discrepancy_columns(search.problem, search.fit, search.accepted, search.known)
    shaped = last.linear.projecting(last.linear.projected, extra=last.linear.whitened(extra))  # also of free shapes
    return [
        Unknown(
            depends_on=dependence(h),
            p_value=float(last.p_values[k]),
            rms=float(np.sqrt(max(last.scores[k].statistic - last.scores[k].count, 0.0) / last.linear.used)),
            hint=f"{h.name} fits, but rows that were not fitted are predicted worse with it",
        )
        for k, h in enumerate(last.hypotheses)
        if h in search.vetoed and max(last.p_values[k], last.scale.p_of(shaped.score_of(h))) < search.critical
    ]


def dependence(hypothesis: Hypothesis) -> str:
    """What an effect depends on."""
    effect = catalogue().get(hypothesis.effect)
    place = place_and_session(hypothesis.at)[0]
    if effect is None:
        return POSE
    for need in effect.needs:
        return _BY_COLUMN[need]
    if hypothesis.session:
        return "session"
    return f"the reading of {place}" if effect.enters == "command" and place != ALL else POSE
