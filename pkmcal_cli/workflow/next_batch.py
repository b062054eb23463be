"""How many points `plan --next` proposes at a time, and whether a cause is to be looked for before."""

from __future__ import annotations

import math
from typing import Literal

from scipy.special import chdtrc

from pkmcal_cli.diagnosis.rotations import FEWEST_TO_SPLIT

_STATED = 1.1  # times the stated noise: nobody states it better
_CHANCE = 0.05  # of as large residuals where noise is as stated
_ALL_AT_ONCE = 4  # points: of more that are needed, half are measured before the rest is planned
_PART = 4  # where a cause may show: a quarter of what was measured

Advice = Literal["", "diagnose", "improve"]
IN_WORDS: dict[Advice, str] = {
    "diagnose": "`pkmcal diagnose` looks for a cause",
    "improve": "`pkmcal improve` looks for a cause; with the machine that it writes fewer rows may do",
}


def advice(noise: float, dof: int, rows: int) -> Advice:
    """The command that looks for a cause where there is more than noise: of few rows none can be added.

    noise: rms of residuals with so many degrees of freedom, times the stated one. Looking costs a command, and a false
    alarm ends there, so 5 % of chance are enough.
    """
    if noise <= _STATED or chdtrc(dof, dof * noise**2) > _CHANCE:
        return ""
    return "improve" if rows >= FEWEST_TO_SPLIT else "diagnose"


def batch(needed: int, rows: int, advised: Advice) -> int:
    """How many of the points that are needed to measure before the rest is planned: never more than were, as a cause
    may show on the way.

    Where one shows, as many as it takes to look for it, then a quarter of what was: with it fewer do.
    """
    lacking = min(rows, FEWEST_TO_SPLIT - rows)
    most = {"": rows, "diagnose": lacking, "improve": max(rows // _PART, _ALL_AT_ONCE)}[advised]
    return needed if needed <= min(_ALL_AT_ONCE, most) else min(math.ceil(needed / 2), most)
