"""A step, an oscillation or a drift in time of all readings: an instrument that moves, which many effects imitate.

Where it explains what effects were accepted for, these go; what is left is judged beside it, or a step would be told
once more as oscillations, correlated rows and whatever else is a part of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.diagnosis.alternatives import SMOOTH, Alternative, best_alternative, drift, families
from pkmcal_cli.diagnosis.groups import TIME, group_columns
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.noise_tests import noise_scale
from pkmcal_cli.diagnosis.refits import refit
from pkmcal_cli.diagnosis.scoring import Scored, Search, linear_without, score_all
from pkmcal_cli.diagnosis.unknown import Unknown
from pkmcal_cli.diagnosis.unmodelled import BETTER, evidence_of_effects, removals
from pkmcal_cli.diagnosis.warming import of_warming


def without_imitations(search: Search) -> Search:
    """The search without accepted effects of which nothing is left beside what all readings do in time."""
    last = score_all(search, search.open)
    for removed in removals(search):
        best = _in_time(search, removed, last)
        if best is None or not _is_imitation(search, removed, last, best):
            continue
        others = search.accepting((), removed)
        fit = refit(others, {})
        if fit is not None:
            return without_imitations(replace(others, fit=fit))
    return search


def beside(last: Scored, problem: Problem, alternative: Alternative) -> Scored:
    """What was scored, with something in time projected out, and the noise that is left then."""
    linear = last.linear.besides(alternative.columns)
    return replace(last, linear=linear, scale=noise_scale(linear, problem, group_columns(problem)))


def in_time(search: Search, last: Scored, unknown: Sequence[Unknown]) -> Alternative | None:
    """What all readings do in time, where something is unknown that depends on it; `last`: scored at the end."""
    return _in_time(search, (), last) if any(u.depends_on == TIME for u in unknown) else None


def as_unknown(alternative: Alternative) -> Unknown:
    """The same as something unknown."""
    p_value = float(np.exp(-alternative.evidence))
    return Unknown(TIME, p_value, alternative.rms, alternative.words, row=alternative.row)


def _in_time(search: Search, removed: Sequence[Hypothesis], last: Scored) -> Alternative | None:
    """A step, an oscillation or a smooth drift with enough evidence, and more than a bump or a field over the pose.

    A drift does not stand for effects that depend on time or temperature: it is what they do.
    """
    kinds = families(search.problem, search.fit)
    linear = linear_without(search, removed, removed).prewhitened(last.linear.memory)
    best = best_alternative(linear, last.scale, [*kinds, *drift(search.problem)])
    if best is None or best.depends_on != TIME:
        return None
    if best.words == SMOOTH and any(of_warming(p) for p in removed):
        return None
    return best if best.evidence > evidence_of_effects(search, removed, linear, last.scale) + BETTER else None


def _is_imitation(search: Search, removed: Sequence[Hypothesis], last: Scored, best: Alternative) -> bool:
    """Whether nothing speaks for accepted effects once something in time is there."""
    linear = linear_without(search, removed, removed).prewhitened(last.linear.memory).besides(best.columns)
    scale = noise_scale(linear, search.problem, group_columns(search.problem))
    return evidence_of_effects(search, removed, linear, scale) <= 0.0
