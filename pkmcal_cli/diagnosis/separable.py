"""Which of several effects that explain the data alike further points can tell apart: `plan --aim separate:`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pkmcal_cli.diagnosis.experiment_design import Aim, arranged, covariance_of, smallest_information, whitened_blocks
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.linear import Linear
from pkmcal_cli.diagnosis.score import minimal_detectable
from pkmcal_cli.diagnosis.scoring import Search, linear_without

_MANY = 100.0  # times the rows that were measured: more than anybody measures to separate two effects
_PLAUSIBLE = 2.0  # standard deviations of a prior


@dataclass(frozen=True)
class Separable:
    """Names of an accepted effect and rivals that points tell from each other (none or two at least); of the others."""

    apart: tuple[str, ...] = ()
    alike: tuple[str, ...] = ()


def separable(search: Search, accepted: Hypothesis, others: Sequence[Hypothesis]) -> Separable:
    """What points tell an accepted effect from.

    Points are planned for effects at single places with all their numbers, so these are compared. Two of them that act
    alike in the measured region would still do so if it were measured a hundred times. What else there is, groups of
    places, is neither.
    """
    known = {h.name: h.whole for h in search.candidates.single}
    whole = list(dict.fromkeys(known[h.name] for h in (accepted, *others) if h.name in known))
    if accepted.name not in known or len(whole) < 2:
        return Separable()
    linear = linear_without(search, [accepted], tuple(whole))
    kept = [known[accepted.name]]
    for rival in (h for h in whole if h != kept[0]):
        if all(_apart(linear, one, rival) for one in kept):
            kept.append(rival)
    kept = kept if len(kept) > 1 else []
    return Separable(tuple(h.name for h in kept), tuple(h.name for h in whole if h not in kept))


def _apart(linear: Linear, one: Hypothesis, other: Hypothesis) -> bool:
    """Whether plausible sizes of two effects could be told apart by many rows like those that were measured."""
    aim = Aim("separate", (one.parameters, other.parameters))
    rows, prior, groups = arranged(linear, whitened_blocks(linear, len(linear.on)), aim)
    normal = _MANY * np.einsum("mca,mcb->ab", rows, rows) + np.diag(prior)
    inverse = covariance_of(normal)
    information = smallest_information([inverse[np.ix_(g, g)][None] for g in groups])
    return minimal_detectable(float(information[0])) < _PLAUSIBLE
