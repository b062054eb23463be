"""The whole diagnosis: what is left in the residual, traced to named effects, with what could not have been seen."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

from pkmcal_cli.base.stages import Observer, Stage, unobserved
from pkmcal_cli.calibration.bench_readings import BenchReading
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import reasons
from pkmcal_cli.calibration.robust import Loss, RobustFit, normal_figures
from pkmcal_cli.diagnosis.all_in_time import without_imitations
from pkmcal_cli.diagnosis.bad_rows import (
    cleared,
    left_out_readings,
    restored,
    suspected_rows,
    without_gross_rows,
)
from pkmcal_cli.diagnosis.exchanges import swapped
from pkmcal_cli.diagnosis.far_causes import far_beyond, with_far_causes
from pkmcal_cli.diagnosis.findings import Finding, findings_of, sizes_seen
from pkmcal_cli.diagnosis.first_fit import calibrated, calibrated_from_nominal, calibrated_from_starts
from pkmcal_cli.diagnosis.hypotheses import Candidates, Hypothesis
from pkmcal_cli.diagnosis.known_results import KnownResults
from pkmcal_cli.diagnosis.left_over import left_over
from pkmcal_cli.diagnosis.nameless import with_all_in_one, with_shape
from pkmcal_cli.diagnosis.noise_growth import NoiseGrowth, weighted
from pkmcal_cli.diagnosis.noise_tests import chance_of_noise
from pkmcal_cli.diagnosis.refine import confirmed_only, rivals_of
from pkmcal_cli.diagnosis.robust_weights import ROUNDS, weighed
from pkmcal_cli.diagnosis.same_as import same_as_parameters
from pkmcal_cli.diagnosis.scale import Scale
from pkmcal_cli.diagnosis.scoring import Scored, Search, score_all
from pkmcal_cli.diagnosis.search import run_search
from pkmcal_cli.diagnosis.search_options import SearchOptions
from pkmcal_cli.diagnosis.shape_findings import ShapeFinding, nameless_at, shape_findings
from pkmcal_cli.diagnosis.shown_kind import ShownKind, shown_kind
from pkmcal_cli.diagnosis.unknown import Unknown
from pkmcal_cli.diagnosis.verdict import Verdict, verdict_of
from pkmcal_cli.diagnosis.visible_sizes import VisibleSizes
from pkmcal_cli.diagnosis.wrong_numbers import WrongNumber, wrong_numbers
from pkmcal_cli.prediction import WarmStart, fixed_smoothing

_SHAPES = 2  # displacements without a name, at most


@dataclass(frozen=True, kw_only=True)
class Diagnosis:
    """All that `diagnose` reports."""

    verdict: Verdict
    problem: Problem  # with the bad rows taken out
    before: Fit  # of all rows, bad ones too
    cleared: Fit  # the same without bad rows; still without effects
    bad_readings: tuple[BenchReading, ...]  # of the bench, not used, against the fit with what was found
    search: Search
    findings: tuple[Finding, ...]
    shapes: tuple[ShapeFinding, ...]  # displacements with free shapes; those without a name are the first unknown
    unknown: tuple[Unknown, ...]
    noise: tuple[NoiseGrowth, ...]  # by which rows were counted
    first: Scored  # all hypotheses, with nothing accepted
    not_testable: tuple[tuple[str, str], ...]
    scale: Scale
    correlation: float  # of successive rows' noise; 0 where they are independent
    same: dict[str, str]  # names of effects and of parameters that are held, and the other name that stands for each
    suspected: dict[int, float]  # rows that are used but may be wrong, and the chance that any good one is as far off
    p_global: float  # of the residuals of `cleared`
    seed: int
    weighed: RobustFit | None = None  # by which values were weighed
    mistakes: tuple[str, ...] = ()  # of the table, which was put right before
    implausible: tuple[str, ...] = ()  # why the calibration is not to be believed although no cause was found

    @property
    def shown(self) -> ShownKind:
        """Of which readings errors are told as one figure."""
        return self.search.shown or shown_kind(self.search.problem, self.search.fit)

    @property
    def named_shapes(self) -> tuple[ShapeFinding, ...]:
        """Displacements that are named effects with shapes of their own."""
        return tuple(s for s in self.shapes if s.named is not None)

    @property
    def unmodelled(self) -> tuple[Unknown, ...]:
        """What is unknown, but for displacements without a name, which are in the fit."""
        return self.unknown[len(self.shapes) - len(self.named_shapes) :]

    @cached_property
    def detectable(self) -> tuple[VisibleSizes, ...]:
        """How large every hypothesis that is not accepted would have to be."""
        return sizes_seen(self.first, self.search, self.seed)

    @property
    def invisible(self) -> tuple[VisibleSizes, ...]:
        """Hypotheses that these data cannot show."""
        return tuple(d for d in self.detectable if not d.tested)

    @cached_property
    def wrong_numbers(self) -> tuple[WrongNumber, ...]:
        """Numbers that the machine file states, and that explain the table as well by themselves."""
        return wrong_numbers(self.search, self.problem, self.cleared)

    @property
    def failed(self) -> dict[int, str]:
        """Why rows have no prediction, or have one only with errors of the drives; no test has seen them."""
        search = self.search
        return {**search.failed, **reasons(search.problem, search.fit.after)}

    def indistinguishable_from(self, hypothesis: Hypothesis) -> tuple[Hypothesis, ...]:
        """An accepted effect, first, and those that explain all rows as well."""
        if shape := next((s for s in self.shapes if s.hypothesis == hypothesis), None):
            return tuple(nameless_at(at) for at, _ in shape.places)
        rivals = [r.hypothesis for f in self.findings if f.hypothesis == hypothesis for r in f.rivals]
        return (hypothesis, *(r for r in rivals if r != hypothesis))

    @property
    def bad_rows(self) -> tuple[int, ...]:
        """Rows that are wrong on their own."""
        return tuple(sorted(self.search.bad_rows))


def diagnose(
    candidates: Candidates,
    problem: Problem,
    selected: tuple[str, ...],
    alpha: float,
    seed: int,
    *,
    loss: Loss = "squares",
    observe: Observer = unobserved,
) -> Diagnosis:
    """Diagnose a table; `problem` belongs to the candidates' model. Raises RowsFailed.

    Where noise grows over the workspace, once more with rows that count by it.
    """
    options = SearchOptions(alpha=alpha, seed=seed, loss=loss, observe=observe)
    first = _weighed(candidates, problem, selected, options)
    if not first.noise:
        return first
    again = _weighed(candidates, weighted(problem, first.noise), selected, options)
    return replace(again, noise=first.noise)


def _weighed(candidates: Candidates, problem: Problem, selected: tuple[str, ...], options: SearchOptions) -> Diagnosis:
    """The diagnosis with sigma as it is, and values weighed by what is left once the found effects are in the fit."""
    if options.loss == "squares":
        return _diagnosis(candidates, problem, selected, options)
    (_, fit), model = calibrated(candidates, problem, selected, options), problem.model
    named: frozenset[str] = frozenset()
    for _ in range(ROUNDS):
        seen, robust = weighed(replace(problem, model=model), fit, options.loss)
        diagnosis = _diagnosis(candidates, replace(seen, model=problem.model), selected, options)
        diagnosis = replace(diagnosis, weighed=robust)
        if diagnosis.search.state[0] == named:
            break
        named, fit, model = diagnosis.search.state[0], diagnosis.search.fit, diagnosis.search.problem.model
    return diagnosis


def _diagnosis(
    candidates: Candidates, problem: Problem, selected: tuple[str, ...], options: SearchOptions
) -> Diagnosis:
    """The diagnosis with sigma and weights as they are."""
    begun = _begun(candidates, problem, selected, options)
    parts, first, search = options.parts, begun.first, _ended(begun, options)
    candidates = search.candidates
    options.observe(Stage("remaining residuals"))
    last, unknown, growth = left_over(search, parts)
    shapes = shape_findings(search, last)
    unknown = (*(s.unknown for s in shapes if s.named is None), *unknown)
    findings = findings_of(search, last, bool(unknown), options)
    good = cleared(begun.every, begun.start, search)
    whole = first.linear if good is begun.start else score_all(good, ()).linear
    return Diagnosis(
        verdict=verdict_of(findings, shapes, unknown, bool(search.bad_rows or search.problem.left_out), last.linear),
        problem=replace(search.problem, model=begun.start.problem.model, prior=begun.start.problem.prior),
        before=begun.every.fit,
        cleared=good.fit,
        bad_readings=left_out_readings(search),
        search=search,
        findings=findings,
        shapes=shapes,
        unknown=unknown,
        noise=() if unknown else growth,
        first=first,
        not_testable=candidates.not_testable,
        scale=last.scale,
        correlation=0.0 if last.linear.memory is None else last.linear.memory.correlation,
        same=begun.same,
        suspected=suspected_rows(last),
        p_global=chance_of_noise(whole),
        seed=options.seed,
    )


def named(
    candidates: Candidates, problem: Problem, selected: tuple[str, ...], options: SearchOptions
) -> tuple[tuple[tuple[Hypothesis, ...], ...], WarmStart]:
    """What a diagnosis of a table names, each effect with those that explain the table as well; nothing else of it.

    And states of the rows where its calibration began. Raises RowsFailed.
    """
    begun = _begun(candidates, problem, selected, options)
    search = _ended(begun, options)
    rivals = {h: [r.hypothesis for r in rivals_of(search, h)] for h in search.accepted}
    sets = tuple((h, *(r for r in others if r != h)) for h, others in rivals.items())
    shapes = (tuple(nameless_at(at) for at, _ in shape.places) for shape in search.shapes)
    return (*sets, *shapes), begun.every.fit.before.start


@dataclass(frozen=True, kw_only=True)
class _Begun:
    """A search before anything is accepted: `every` row, `start` without gross ones; all hypotheses scored there.

    far: with far-off causes.
    """

    every: Search
    start: Search
    far: Search
    first: Scored
    same: dict[str, str]


def _begun(candidates: Candidates, problem: Problem, selected: tuple[str, ...], options: SearchOptions) -> _Begun:
    """Far-off causes before further starts, which are dear: without such a cause no fit converges."""
    options.observe(Stage("calibration"))
    known = KnownResults()
    candidates, fit = calibrated_from_nominal(candidates, problem, selected, options, known)
    begun = _begun_with(candidates, problem, selected, fit, options, known=known)
    if fit.status != "not_converged" or far_beyond(begun.start, begun.far):
        return begun
    candidates, again = calibrated_from_starts(candidates, problem, fit, options, known)
    return begun if again is fit else _begun_with(candidates, problem, selected, again, options, known=known)


def _begun_with(
    candidates: Candidates,
    problem: Problem,
    selected: tuple[str, ...],
    before: Fit,
    options: SearchOptions,
    *,
    known: KnownResults,
) -> _Begun:
    """A search that begins with a fit."""
    bare = problem.without(before.failed)
    model = fixed_smoothing(bare.model, before.values, bare.rows, before.after.start)
    problem, candidates = replace(bare, model=model), replace(candidates, model=model)
    every = Search(
        candidates=candidates,
        problem=problem,
        declared=selected,
        fit=before,
        failed=before.failed,
        known=known,
        inflation=1.0 if options.loss == "squares" else normal_figures(options.loss)[1],
    )
    options.observe(Stage("gross rows"))
    start = without_gross_rows(every, bare, options.parts, options.seed)
    first = score_all(start, [h.whole for h in candidates.hypotheses])
    same = same_as_parameters(first)
    candidates = replace(candidates, hypotheses=tuple(h for h in candidates.hypotheses if h.name not in same))
    start = replace(start, candidates=candidates, shown=shown_kind(start.problem, start.fit))
    far = with_far_causes(start, options.observe)
    return _Begun(every=every, start=start, far=far, first=first, same=same)


def _ended(begun: _Begun, options: SearchOptions) -> Search:
    search = _searched(begun, options)
    options.observe(Stage("exchanges"))
    search = restored(swapped(search))
    options.observe(Stage("held-out rows"))
    return without_imitations(_with_shapes(confirmed_only(search), options))


def _searched(begun: _Begun, options: SearchOptions) -> Search:
    """The search with far-off causes, or with a shape that explains all by itself, or else with effects."""
    alone = with_all_in_one(begun.far, begun.first)  # a cause may be a straight line of any size, which a shape has too
    search = run_search(alone, options)
    return run_search(begun.far, options) if alone.shapes and search.accepted else search


def _with_shapes(search: Search, options: SearchOptions) -> Search:
    """The search with displacements without a name, and effects that are found beside them."""
    while len(search.shapes) < _SHAPES:
        options.observe(Stage("what has no name"))
        last, unknown, _ = left_over(search, options.parts)
        after = with_shape(search, last) if unknown or search.near else None
        if after is None:
            return search
        search = confirmed_only(restored(swapped(run_search(after, options))))
    return search
