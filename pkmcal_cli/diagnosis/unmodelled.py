"""Whether effects were accepted only because the catalogue lacks what is there: unmodelled alternatives compete."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.diagnosis.alternatives import Alternative, Family, best_alternative, drift, families
from pkmcal_cli.diagnosis.groups import TIME
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.linear import Linear
from pkmcal_cli.diagnosis.model_discrepancy import discrepancy_columns
from pkmcal_cli.diagnosis.scale import Scale
from pkmcal_cli.diagnosis.scoring import Scored, Search, linear_without
from pkmcal_cli.diagnosis.unknown import Unknown

BETTER = 7.0  # log evidence by which a unmodelled alternative must be better


def removals(search: Search) -> list[tuple[Hypothesis, ...]]:
    """Accepted effects that something else may explain: all of them, and each."""
    if not search.near:
        return []
    return [search.near, *([(h,) for h in search.near] if len(search.near) > 1 else [])]


def unmodelled_alternatives(search: Search, last: Scored, in_time: Alternative | None = None) -> list[Unknown]:
    """What explains accepted effects better than these do: the best alternative to all of them, or to each.

    `last`: scored with all of them; `in_time`: what is known to be there besides.
    """
    if not search.near:
        return []
    kinds = families(search.problem, search.fit)
    kinds = kinds if in_time is None else [kind for kind in kinds if kind.depends_on != in_time.depends_on]
    for removed in removals(search):
        better = _better(search, removed, last, kinds, in_time)
        if better is not None:
            return [better]
    return []


def _better(
    search: Search,
    removed: Sequence[Hypothesis],
    last: Scored,
    kinds: Sequence[Family],
    in_time: Alternative | None,
) -> Unknown | None:
    """The best alternative to some accepted effects, if it has more evidence and explains more."""
    linear, scale = linear_without(search, removed, removed).prewhitened(last.linear.memory), last.scale
    linear = linear if in_time is None else linear.besides(in_time.columns)
    best = best_alternative(linear, scale, kinds)
    statistic, _ = _evidence(linear, scale, linear.of([n for h in removed for n in h.parameters]))
    accepted_evidence = evidence_of_effects(search, removed, linear, scale)
    if best is None or best.statistic < statistic or best.evidence <= accepted_evidence + BETTER:
        return None
    names = tuple(h.name for h in removed)
    if best.depends_on == TIME:  # a smooth drift is a step in part
        smooth = best_alternative(linear, scale, drift(search.problem))
        best = best if smooth is None or smooth.evidence < best.evidence else smooth
    words = f"{best.words}: a better explanation than {' and '.join(names)}"
    return Unknown(best.depends_on, float(np.exp(accepted_evidence - best.evidence)), best.rms, words, names)


def evidence_of_effects(search: Search, removed: Sequence[Hypothesis], linear: Linear, scale: Scale) -> float:
    """Log evidence of accepted effects, with a shape of their own if that has more; `linear`: without them."""
    if not removed:
        return 0.0
    columns = linear.of([n for h in removed for n in h.parameters])
    free = np.hstack([columns, linear.whitened(discrepancy_columns(search.problem, search.fit, removed, search.known))])
    best = max(_evidence(linear, scale, columns)[1], _evidence(linear, scale, free)[1])
    return best - len(removed) * float(np.log(len(search.candidates.hypotheses)))


def _evidence(linear: Linear, scale: Scale, columns: Array) -> tuple[float, float]:
    """Statistic of columns, and their log evidence (BIC)."""
    statistic, count = linear.explained(columns)
    return statistic, 0.5 * (statistic / scale.variance - count * float(np.log(linear.used)))
