"""What data can be asked for, for all that fit: the datum is held, and data that determine too little are refused."""

from __future__ import annotations

from pkmcal_cli.base.errors import BadInput, Fault, Location
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.determinacy import Determinacy, determinacy
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.prediction import WarmStart


def determined(
    machine: str, problem: Problem, values: Array, selected: tuple[str, ...], states: WarmStart | None = None
) -> Determinacy:
    """What of `selected` is identified at parameter values (P,), SI; `states`: of the rows there.

    Raises BadInput for data that determine too little of the machine, a file.
    """
    asked = determinacy(problem, values, selected, states)
    if asked.refusal:
        raise BadInput([Fault("under-determined", asked.refusal, Location(machine), asked.remedy)])
    return asked
