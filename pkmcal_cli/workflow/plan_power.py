"""Simulated campaigns of a plan: which effects, and whether so few rows can be diagnosed at all."""

from __future__ import annotations

from collections.abc import Sequence

from pkmcal_cli.base.plural import count
from pkmcal_cli.base.workers import Workers
from pkmcal_cli.diagnosis.power import Campaigns, PowerWork, Rates, chosen
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.workflow.search_case import FEWEST_ROWS
from pkmcal_cli.workflow.state import State, all_done


def power_of_plan(
    number: int, names: Sequence[str], campaigns: Campaigns, workers: Workers, state: State, to: Reporter
) -> tuple[Rates, ...]:
    """How often effects are found in so many campaigns of each, where that is asked for: of those that are wanted, else
    of every kind the hardest one."""
    problem = campaigns.plan.problem
    if len(problem) < FEWEST_ROWS or problem.count <= len(campaigns.selected):
        message = f"warning: `diagnose` takes {FEWEST_ROWS} rows or more, and more values than parameters"
        to.warn(f"{message}; this plan has fewer, so nothing of it will be detected")
        return ()
    if not number:
        return ()
    effects = chosen(campaigns.plan.visibilities, names)
    seen = [v for v in effects if v.detected < v.plausible]
    lost = [v.hypothesis.name for v in effects if v not in seen]
    to.notes([f"{name} is not detected within its plausible size, and not simulated" for name in lost])
    if held := campaigns.held:
        drawn = f"{count(len(held), 'parameter')} not identified, and drawn within their ranges too"
        to.notes([f"{drawn}: where `diagnose` finds one of them, that is `another name`"])
    work = PowerWork(campaigns, (None, *seen), number)
    return work.rates(all_done(work, len(work), "simulated campaign", workers, state, to))
