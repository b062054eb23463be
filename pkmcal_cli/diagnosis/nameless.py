"""Where the catalogue ends: a displacement without a name, where it explains the table and no set of effects does.

It competes with what was accepted by evidence, all together and each alone, and with a smooth field over the pose,
steps and oscillations in time. At the site of a named effect that explains nearly as much, and has nearly the evidence
if it may deviate a little from its formula, it is this effect; where one that may have any curve explains most of it,
it is in the fit as the effect's own shape, and has its name.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from pkmcal_cli.calibration.identify import RowsFailed
from pkmcal_cli.compiler.placed_effects import weights_of
from pkmcal_cli.diagnosis.alternatives import best_alternative, fields, in_time
from pkmcal_cli.diagnosis.best_fit import best_fit
from pkmcal_cli.diagnosis.confirm import held_out_gain
from pkmcal_cli.diagnosis.free_shapes import FittedShape, fitted_shapes, places
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.linear import Linear
from pkmcal_cli.diagnosis.model_discrepancy import discrepancy_columns
from pkmcal_cli.diagnosis.noise_tests import chance_of_noise
from pkmcal_cli.diagnosis.refits import recalibrated
from pkmcal_cli.diagnosis.scale import Scale
from pkmcal_cli.diagnosis.scoring import (
    NamelessShape,
    Scored,
    Search,
    linear_without,
    nulled,
    score_all,
    score_without,
    scored_by,
    shape_gains,
)
from pkmcal_cli.diagnosis.unmodelled import evidence_of_effects
from pkmcal_cli.effects import catalogue
from pkmcal_cli.effects.unexplained import place_and_axis
from pkmcal_cli.model.effect_sites import PlacedEffect

_BETTER = 7.0  # log evidence by which a shape must be better than what it replaces
_SURE, _LEFT = 1e-2, 1e-3  # chance of the residual, of noise alone, before and after a shape that explains the table
_LEFT_SHARE = 0.09  # share of what named effects explain that they may leave: shapes deviate by up to 30 %
_OWN_SHARE = 0.82  # share of what a shape explains that a named effect at its site does, to be what it shows
_MOST_SHARE = 0.7  # the same, of an effect whose own shape it is
_CREDIBLE = 0.95


_Way = tuple[float, tuple[Hypothesis, ...], list[FittedShape]]  # gain, what is given up, shapes, best first


def with_shape(search: Search, last: Scored) -> Search | None:
    """The search with one displacement without a name, and without effects that it explains; None where none is needed.

    `last`: scored at the end of the search.
    """
    ways: list[_Way] = []
    for removed in _removals(search):
        linear, scale = linear_without(search, removed, removed).prewhitened(last.linear.memory), last.scale
        shapes = _fitted_shapes(search, removed, linear, scale)
        if shapes and _stands_out(search, shapes[0], linear, scale):
            gain = shapes[0].evidence - evidence_of_effects(search, removed, linear, scale)
            ways.append((gain, removed, shapes))
    gain, removed, shapes = max(ways, key=lambda way: way[0], default=(0.0, (), []))
    if gain <= _BETTER or _is_left_by_named(search, removed, shapes[0], last):
        return None
    shown, named = _at_its_site(search, removed, shapes[0], last)
    if shown:
        return None
    after = _accepted(search, gain, removed, shapes, named)
    alone = next((way for way in ways if after is not None and _leaves_needless(after, search, way, shapes[0])), None)
    return after if alone is None else _accepted(search, *alone, named) or after


def _leaves_needless(after: Search, before: Search, way: _Way, shape: FittedShape) -> bool:
    """Whether a way has the same place, and gives up just what a shape that was accepted has made needless."""
    _, removed, shapes = way
    needless = [h for h in after.near if not _is_needed(after, h)]
    gone = {h for h in before.near if h not in after.near or h in needless}
    return bool(needless) and set(removed) == gone and shapes[0].placed.at == shape.placed.at


def _is_needed(search: Search, hypothesis: Hypothesis) -> bool:
    """Whether an accepted effect has the log evidence that it costs."""
    kept = [h for h in search.accepted if h != hypothesis]
    without = score_without(search, [hypothesis], [hypothesis])
    return float(without.log_bayes[0]) > search.price(search.accepted) - search.price(kept)


def with_all_in_one(search: Search, first: Scored) -> Search:
    """The search with one displacement without a name that explains the whole table by itself, if one does.

    That is before effects are looked for: many together would imitate it. `first`: scored with nothing accepted.
    """
    linear, scale = first.linear, first.scale
    if search.accepted or chance_of_noise(linear) > _SURE:
        return search
    shapes = _fitted_shapes(search, (), linear, scale)
    best = float(first.log_bayes.max(initial=0.0))
    if not shapes or shapes[0].evidence < best + _BETTER or not _stands_out(search, shapes[0], linear, scale):
        return search
    shown, named = _at_its_site(search, (), shapes[0], first)
    if shown:
        return search
    after = _accepted(search, shapes[0].evidence, (), shapes, named)
    return search if after is None or chance_of_noise(score_all(after, ()).linear) < _LEFT else after


def _fitted_shapes(search: Search, removed: Sequence[Hypothesis], linear: Linear, scale: Scale) -> list[FittedShape]:
    """Shapes at places that are tested and have none, where no accepted effect is but removed ones; best first."""
    values, _ = nulled(search, removed)
    kinds = places(search.problem, values, search.fit.after.start)
    taken = {shape.placed.at for shape in search.shapes}
    accepted = [h for h in search.accepted if h not in removed]
    tested = [p for p in kinds if p.bare.at not in taken and search.candidates.tests(p.bare.name)]
    free = [p for p in tested if not any(_of_site(p.bare, h) for h in accepted)]
    return fitted_shapes(linear, scale, free)


def _of_site(shape: PlacedEffect, hypothesis: Hypothesis) -> bool:
    """Whether an effect is at the site of a shape, and depends on what it depends on alone."""
    effect, (at, axis) = catalogue().get(hypothesis.effect), place_and_axis(shape.at)
    if effect is None or effect.enters != shape.effect.enters or at not in {p.at for p in hypothesis.placed}:
        return False
    return "time" in effect.needs if axis == "time" else not effect.needs


def _alike(search: Search, shape: FittedShape) -> list[Hypothesis]:
    """Effects at its site alone."""
    return [h for h in search.candidates.hypotheses if not h.members and _of_site(shape.placed, h)]


def _removals(search: Search) -> Iterator[tuple[Hypothesis, ...]]:
    """What a shape may replace: nothing, all accepted effects, each."""
    yield ()
    if search.near:
        yield search.near
    if len(search.near) > 1:
        yield from ((h,) for h in search.near)


def _at_its_site(
    search: Search, removed: Sequence[Hypothesis], shape: FittedShape, last: Scored
) -> tuple[bool, Hypothesis | None]:
    """Whether a named effect at the site of a shape is what it shows; the effect whose own shape it is.

    Effects may deviate from their formulas: such a one has nearly the evidence of the shape, and by its formula alone
    explains most of it. Of those that may have any curve the shape itself is what deviates.
    """
    site = _alike(search, shape)
    if not site:
        return False, None
    linear = linear_without(search, removed, site).prewhitened(last.linear.memory)
    scores = scored_by(last.scale, linear, site)
    any_curve = np.array([catalogue()[h.effect].any_curve for h in site])
    evidence = scores.log_bayes + np.where(any_curve, 0.0, shape_gains(search, scores))
    share = np.array([score.statistic for score in scores.scores]) / shape.statistic
    shown = (share > _OWN_SHARE) & (evidence + _BETTER > shape.evidence)
    best = int(np.argmax(share))
    return bool(shown.any()), site[best] if share[best] >= _MOST_SHARE and any_curve[best] else None


def _is_left_by_named(search: Search, removed: Sequence[Hypothesis], shape: FittedShape, last: Scored) -> bool:
    """Whether a shape is what the effects that stay leave of themselves: small beside them, and nothing where they have
    free shapes, each at its own site.
    """
    stay = [h for h in search.near if h not in removed]
    extra = discrepancy_columns(search.problem, search.fit, stay, search.known)
    if not extra.shape[1]:
        return False
    linear = linear_without(search, stay, stay).prewhitened(last.linear.memory)
    named, _ = linear.explained(linear.of([n for h in stay for n in h.parameters]))
    if shape.statistic > _LEFT_SHARE * named:
        return False
    linear = linear_without(search, removed, removed)
    free = linear.projecting(linear.projected, extra=linear.whitened(extra)).prewhitened(last.linear.memory)
    shapes = _fitted_shapes(search, removed, free, last.scale)
    return not shapes or shapes[0].evidence <= _BETTER


def _stands_out(search: Search, shape: FittedShape, linear: Linear, scale: Scale) -> bool:
    """Whether nothing that acts on all readings explains more: a field over the pose, a step or oscillation in time."""
    kinds = [f for f in (*fields(search.problem), *in_time(search.problem)) if f is not None]
    best = best_alternative(linear, scale, kinds) if kinds else None
    return best is None or shape.evidence > best.evidence


def _accepted(
    search: Search,
    gain: float,
    removed: Sequence[Hypothesis],
    shapes: list[FittedShape],
    named: Hypothesis | None,
) -> Search | None:
    """The search fitted with the best of some shapes, which a named effect may have; None where no fit has it."""
    shape = shapes[0].placed
    parameters = weights_of(shape)
    model = search.problem.model.with_effects((shape,), parameters)
    candidates = search.candidates
    start = None if candidates.start is None else np.append(candidates.start, np.zeros(len(parameters)))
    kept = tuple(h for h in search.accepted if h not in removed)
    values = np.append(search.fit.values, np.zeros(len(parameters)))
    problem = replace(search.accepting((), removed).problem, model=model)
    fitted = replace(search, accepted=kept, shapes=()).selected
    refit = best_fit(problem, values, fitted, shape.parameters)
    others = tuple(h for h in candidates.hypotheses if not any(_of_site(shape, p) for p in h.placed))
    weight = np.exp(np.array([f.evidence - shapes[0].evidence for f in shapes]))
    last = int(np.searchsorted(np.cumsum(weight / weight.sum()), _CREDIBLE)) + 1
    rivals = tuple((f.placed.at, float(w)) for f, w in zip(shapes[:last], weight / weight.sum(), strict=False))
    new = NamelessShape(placed=shape, evidence=gain, places=rivals, best_fit=refit, named=named)
    after = replace(
        search,
        candidates=replace(candidates, model=model, start=start, hypotheses=others),
        problem=new.beside(problem),
        accepted=kept,
        refused=frozenset(),
        shapes=(*search.shapes, new),
    )
    try:
        after = recalibrated(after)
    except (RowsFailed, np.linalg.LinAlgError):
        return None
    return after if after.fit.usable and not held_out_gain(after, new.hypothesis).contradicts else None
