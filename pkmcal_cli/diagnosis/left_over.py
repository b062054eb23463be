"""What a search leaves at its end: all hypotheses scored there, what is unknown, and noise that grows."""

from __future__ import annotations

from pkmcal_cli.diagnosis.all_in_time import as_unknown, beside, in_time
from pkmcal_cli.diagnosis.alpha import Alpha
from pkmcal_cli.diagnosis.bad_rows import with_rows
from pkmcal_cli.diagnosis.local import local_effects
from pkmcal_cli.diagnosis.model_discrepancy import discrepancy_columns
from pkmcal_cli.diagnosis.noise_growth import NoiseGrowth, noise_growth, weighted
from pkmcal_cli.diagnosis.refuted import refuted_causes
from pkmcal_cli.diagnosis.scoring import Scored, Search, score_all
from pkmcal_cli.diagnosis.unknown import TESTS, Unknown, unknown_effects
from pkmcal_cli.diagnosis.unmodelled import unmodelled_alternatives

Left = tuple[Scored, tuple[Unknown, ...], tuple[NoiseGrowth, ...]]


def left_over(search: Search, parts: Alpha) -> Left:
    """All hypotheses scored at the end of a search, what is unknown then, and noise that grows."""
    of = (search.candidates, search.problem, search.fit, search.accepted, search.shapes, search.vetoed)
    return search.known.once(of, ("left", parts), lambda: _unexplained_rest(search, parts))


def _unexplained_rest(search: Search, parts: Alpha) -> Left:
    last, least = score_all(search, search.open), parts.groups / TESTS
    unknown = _unknown(search, last, parts)
    alone = in_time(search, last, unknown)
    if alone is not None:
        unknown = [as_unknown(alone), *_unknown(search, beside(last, search.problem, alone), parts)]
    growth = noise_growth(last.linear, search.problem, last.scale, least)
    every = weighted(with_rows(search.problem, list(search.bad_rows)), growth)  # else its far end is a local effect
    unknown += local_effects(every, search.fit.values, least, search.fit.after.start)
    return last, tuple(unknown + unmodelled_alternatives(search, last, alone) + refuted_causes(search, last)), growth


def _unknown(search: Search, last: Scored, parts: Alpha) -> list[Unknown]:
    """What is unknown, unless a richer shape of what was found explains it; `last`: scored at the end of the search."""
    unknown = unknown_effects(last.linear, search.problem, last.scale, parts.groups, search.bad_rows)
    if not unknown or not search.accepted:
        return unknown
    extra = discrepancy_columns(search.problem, search.fit, search.accepted, search.known)
    shaped = last.linear.besides(last.linear.whitened(extra))
    return unknown_effects(shaped, search.problem, last.scale, parts.groups, search.bad_rows)
