"""Whether effects were accepted only because the catalogue lacks what is there: nameless alternatives compete."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.diagnosis.generic import Family, best_generic, families
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.linear import Linear, Scale
from pkmcal_cli.diagnosis.residue import residue_columns
from pkmcal_cli.diagnosis.search import Scored, Search, linear_without
from pkmcal_cli.diagnosis.unknown import Unknown

_BETTER = 7.0  # log evidence by which a nameless alternative must be better


def stand_ins(now: Search, last: Scored) -> list[Unknown]:
    """What explains accepted effects better than these do: the best alternative to all of them, or to each.

    `last`: scored with all of them.
    """
    if not now.accepted:
        return []
    kinds = families(now.problem, now.fit)
    every = [tuple(now.accepted), *([(h,) for h in now.accepted] if len(now.accepted) > 1 else [])]
    for removed in every:
        found = _better(now, removed, last, kinds)
        if found is not None:
            return [found]
    return []


def _better(now: Search, removed: Sequence[Hypothesis], last: Scored, kinds: Sequence[Family]) -> Unknown | None:
    """The best alternative to some accepted effects, if it has more evidence and explains more."""
    linear, scale = linear_without(now, removed, removed).prewhitened(last.linear.memory), last.scale
    best = best_generic(linear, scale, kinds)
    columns = linear.of([n for h in removed for n in h.parameters])
    free = np.hstack([columns, linear.whitened(residue_columns(now.problem, now.fit, removed))])
    statistic, plain = _evidence(linear, scale, columns)
    mine = max(plain, _evidence(linear, scale, free)[1]) - len(removed) * float(np.log(len(now.candidates.hypotheses)))
    if best is None or best.statistic < statistic or best.evidence <= mine + _BETTER:
        return None
    names = tuple(h.name for h in removed)
    words = f"{best.words}: explains better what {' and '.join(names)} would"
    return Unknown(best.depends_on, float(np.exp(mine - best.evidence)), best.rms, words, names)


def _evidence(linear: Linear, scale: Scale, columns: Array) -> tuple[float, float]:
    """Statistic of columns, and their log evidence (BIC)."""
    statistic, count = linear.explained(columns)
    return statistic, 0.5 * (statistic / scale.variance - count * float(np.log(linear.used)))
