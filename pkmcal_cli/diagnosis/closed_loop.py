"""The closed loop: fit, diagnose, add, fit again; reported by points that neither fitted nor chose.

What is tried is what the diagnosis of all rows names. The table is cut into blocks. In each rotation one block only
reports: the rest fits and chooses; an effect changes the errors on a rotation's report rows only if its other rows
chose it, or one of its set. So every row reports once. A validation table reports in one rotation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pkmcal_cli.base.plural import count
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.base.stages import Observer, Stage, unobserved, within
from pkmcal_cli.base.workers import ALONE, Workers
from pkmcal_cli.calibration.error_budget import ErrorBudget, error_budget, held_parameters
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identifiability import directions
from pkmcal_cli.calibration.identify import RowsFailed, identify
from pkmcal_cli.calibration.patience import COMPARED, EXACT, Patience
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import linearise
from pkmcal_cli.calibration.robust import Loss, identify_robustly
from pkmcal_cli.diagnosis.beyond_range import unheld
from pkmcal_cli.diagnosis.far_causes import of_any_size
from pkmcal_cli.diagnosis.hypotheses import RELEASE, Candidates, Hypothesis, beside_unknown_sides
from pkmcal_cli.diagnosis.outlying_rows import MOST
from pkmcal_cli.diagnosis.report_rows import Errors, Interval, OuterFold, errors_of, gain_of, rms_gain_of
from pkmcal_cli.diagnosis.rotations import begun_with, parts_of, rotations
from pkmcal_cli.diagnosis.run_diagnosis import Diagnosis, diagnose
from pkmcal_cli.diagnosis.search_options import SearchOptions
from pkmcal_cli.diagnosis.shown_kind import ShownKind, reported_kind
from pkmcal_cli.diagnosis.unknown import Unknown
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import frozen

FAILURES = "missing", "not_confirmed", "sigma_too_small"
_FAILS = "its calibration did not converge"


@dataclass(frozen=True)
class Step:
    """One effect that was tried: errors with it, gain on the report rows (mean square, whitened), how often chosen.

    `refused`: why it was not accepted; "" if it was. `errors` and `gain` are those before where no fit has it.
    """

    hypothesis: Hypothesis
    errors: Errors
    gain: Interval
    chosen: int
    refused: str

    @property
    def accepted(self) -> bool:
        """Whether it belongs to the improved machine."""
        return not self.refused

    @property
    def confirmed(self) -> bool:
        """Whether the error on the report rows falls by it; they do not decide whether it is accepted."""
        return self.gain.low > 0


@dataclass(frozen=True, kw_only=True)
class Improvement:
    """The loop's result; `gain`: of the mean square whitened, `rms_gain` (SI) of one kind; `fit`: on all rows.

    `broken`: what ended the loop early, if nobody had foreseen it; what was done before stands.
    """

    whole: Diagnosis
    rotations: int
    steps: tuple[Step, ...]
    accepted: tuple[Hypothesis, ...]
    before: Errors
    after: Errors
    gain: Interval
    rms_gain: Interval
    shown: ShownKind  # of which that is: on rows that report, another than of the diagnosis where they lack its kind
    fit: Fit
    budget: ErrorBudget  # of this fit
    problem: Problem
    alpha: float  # false-alarm rate of the diagnosis
    broken: Exception | None = None

    @property
    def confirmed(self) -> bool:
        """Whether the error on the report rows falls, by the lower end of the interval."""
        return bool(self.accepted) and self.gain.low > 0

    @property
    def left(self) -> tuple[Unknown, ...]:
        """What is unknown, but for displacements without a name that are in the fit."""
        shapes = self.whole.shapes
        modelled = [s.unknown for s in shapes if s.hypothesis in self.accepted]
        return tuple(u for u in self.whole.unknown if u not in modelled)

    @property
    def failures(self) -> tuple[str, ...]:
        """Why the loop is not at its end: something significant is missing still, or report rows do not confirm."""
        holds = {
            "missing": bool(self.whole.unknown) or any(not s.accepted for s in self.steps),
            "not_confirmed": any(s.accepted and not s.confirmed for s in self.steps) or not self._falls,
            "sigma_too_small": self.whole.verdict == "sigma_too_small",
        }
        return tuple(name for name in FAILURES if holds[name])

    @property
    def _falls(self) -> bool:
        return not self.accepted or self.confirmed


def improve(
    candidates: Candidates,
    problem: Problem,
    selected: tuple[str, ...],
    validation: Problem | None,
    alpha: float,
    seed: int,
    *,
    loss: Loss = "squares",
    observe: Observer = unobserved,
    workers: Workers = ALONE,
) -> Improvement:
    """Run the loop; `problem` belongs to the candidates' model. Raises RowsFailed."""
    whole = diagnose(candidates, problem, selected, alpha, seed, loss=loss, observe=within(observe, Stage("all rows")))
    clean = whole.problem  # without its bad rows, with its weights
    model = frozen(clean.model, clean.rows)  # shapes are spread over the whole table, whatever part of it is fitted
    candidates = _as_calibrated(replace(candidates, model=model, start=begun_at(whole, len(model.names))), whole)
    clean = replace(clean, model=with_shapes_of(model, whole))
    validation = None if validation is None else replace(validation, model=clean.model)
    options = SearchOptions(alpha=alpha, seed=seed, observe=observe, workers=workers)
    first = rotations(candidates, parts_of(clean, validation), selected, options)
    begun = _Progress(first, errors_of(first), identify(clean, whole.search.declared, begun_with(candidates, clean)))
    shown = reported_kind(whole.shown, [fold.report for fold in first])
    progress, broken = _all_tried(begun, clean, whole, options)
    fit, clean, budget = _at_last(_beside(clean, progress.accepted, whole), progress.last, loss)
    return Improvement(
        whole=whole,
        rotations=len(first),
        steps=progress.steps,
        accepted=progress.accepted,
        before=begun.errors,
        after=progress.errors,
        gain=gain_of(first, progress.folds, seed),
        rms_gain=rms_gain_of(first, progress.folds, shown.channels, seed),
        shown=shown, fit=fit, budget=budget, problem=clean, alpha=alpha, broken=broken,
    )  # fmt: skip


def _as_calibrated(candidates: Candidates, whole: Diagnosis) -> Candidates:
    """The candidates with fits that begin where a calibration without effects ends, whose parameters absorb some."""
    if all(far_off.absorbed is None for far_off in whole.search.far_off.values()):
        return candidates
    return replace(candidates, start=whole.before.values[: len(candidates.model.names)])


def _at_last(problem: Problem, fit: Fit, loss: Loss) -> tuple[Fit, Problem, ErrorBudget]:
    """The last fit, with weights by what it leaves where the loss is robust; its problem and what its errors are."""
    noise = None
    if loss != "squares" and fit.status == "converged":
        robust = identify_robustly(replace(problem, weight=None), fit, loss)
        problem, fit, noise = robust.problem, robust.fit, robust.fit.directions.spread
    return fit, problem, error_budget(problem, fit, held_parameters(problem, fit.selected, ()), noise=noise)


@dataclass(frozen=True)
class _Progress:
    """How far the loop has come: rotations with what was accepted, their errors, the fit on all rows; every step."""

    folds: tuple[OuterFold, ...]
    errors: Errors
    last: Fit
    steps: tuple[Step, ...] = ()
    accepted: tuple[Hypothesis, ...] = ()


def _all_tried(
    progress: _Progress, clean: Problem, whole: Diagnosis, options: SearchOptions
) -> tuple[_Progress, Exception | None]:
    """The loop after all effects that all rows name, and what ended it early."""
    order = sorted(whole.search.accepted, key=lambda h: h.effect != RELEASE)  # these need no effect
    order += [shape.hypothesis for shape in whole.search.shapes]
    try:
        for k, hypothesis in enumerate(order):
            options.observe(Stage("effect", k, len(order)))
            progress = _tried(progress, hypothesis, clean, whole, options.seed)
    except Exception as error:  # what was done before it stands, and is told first
        return progress, error
    return progress, None


def _tried(progress: _Progress, hypothesis: Hypothesis, clean: Problem, whole: Diagnosis, seed: int) -> _Progress:
    """The loop after one more effect; `clean`: all rows but the bad ones."""
    distinguishable = whole.indistinguishable_from(hypothesis)
    chosen = [t.chose(distinguishable) for t in progress.folds]
    accepted = (*progress.accepted, hypothesis)
    try:
        trial = tuple(_with(t, hypothesis, whole) if c else t for t, c in zip(progress.folds, chosen, strict=True))
        gain, errors = gain_of(progress.folds, trial, seed), errors_of(trial)
        refused = _refused(progress, trial, sum(chosen), errors)
        last = progress.last if refused else _determined(clean, accepted, whole, progress.last)
    except (RowsFailed, np.linalg.LinAlgError):
        step = Step(hypothesis, progress.errors, Interval(0.0, -np.inf, np.inf), sum(chosen), _FAILS)
        return replace(progress, steps=(*progress.steps, step))
    steps = (*progress.steps, Step(hypothesis, errors, gain, sum(chosen), refused))
    return replace(progress, steps=steps) if refused else _Progress(trial, errors, last, steps, accepted)


def _refused(progress: _Progress, trial: Sequence[OuterFold], chosen: int, errors: Errors) -> str:
    """Why an effect is not accepted, "" where it is.

    Errors on the report rows are no reason: they would no longer be errors on rows that did not choose.
    """
    if 2 * chosen <= len(trial):
        return f"selected in only {chosen} of {count(len(trial), 'rotation')}"
    if errors.failed - progress.errors.failed > max(int(MOST * sum(len(t.report) for t in trial)), 1):
        return f"with it {count(errors.failed - progress.errors.failed, 'more row')} cannot be predicted"
    return "" if all(t.fit.usable for t in trial) else _FAILS


def _with(fold: OuterFold, hypothesis: Hypothesis, whole: Diagnosis) -> OuterFold:
    accepted = (*fold.accepted, hypothesis)
    start = _start(fold.train, accepted, whole)
    train = _beside(fold.train, accepted, whole)
    fit = _fit_with(train, accepted, whole, fold.fit, COMPARED)
    return replace(fold, train=train, fit=fit, accepted=accepted, start=start)


def _start(problem: Problem, accepted: Sequence[Hypothesis], whole: Diagnosis) -> Array:
    """Values (P,), SI, that a calibration with effects begins with."""
    return replace(whole.search.candidates, model=problem.model).begin(accepted)


def _beside(problem: Problem, accepted: Sequence[Hypothesis], whole: Diagnosis) -> Problem:
    """The problem with the priors of displacements without a name, and effects beyond their ranges not held by them."""
    for hypothesis in (h for h in accepted if h.name in whole.search.far_off):
        problem = of_any_size(problem, hypothesis)
    problem = beside_unknown_sides(unheld(problem, accepted), whole.search.declared, accepted)
    for shape in (s for s in whole.search.shapes if s.hypothesis in accepted):
        problem = shape.beside(problem)
    return problem


def begun_at(whole: Diagnosis, count: int) -> Array | None:
    """Where fits begin (P,), of the parameters before those of displacements without a name."""
    start = whole.search.candidates.start
    return None if start is None else start[:count]


def with_shapes_of(model: Model, whole: Diagnosis) -> Model:
    """A model with the displacements without a name that a diagnosis found; at 0."""
    names = {n for s in whole.search.shapes for n in s.placed.parameters}
    parameters = tuple(p for p in whole.search.problem.model.parameters if p.name in names)
    return model.with_effects(tuple(s.placed for s in whole.search.shapes), parameters)


def _fit_with(
    problem: Problem, accepted: Sequence[Hypothesis], whole: Diagnosis, earlier: Fit, patience: Patience = EXACT
) -> Fit:
    """A calibration with effects; states begin where those of an earlier fit did. Raises RowsFailed."""
    problem = _beside(problem, accepted, whole)
    chosen = set(whole.search.declared) | {n for h in accepted for n in h.unknown}
    names = tuple(n for n in problem.model.names if n in chosen)
    start, states = _start(problem, accepted, whole), earlier.before.start
    return identify(problem, names, start, states=states, patience=patience)


def _determined(problem: Problem, accepted: Sequence[Hypothesis], whole: Diagnosis, earlier: Fit) -> Fit:
    """The same, but that numbers of effects which the data do not tell from other parameters stay at null.

    The shift of a measuring frame beside that of the base would leave both open.
    """
    fit = _fit_with(problem, accepted, whole, earlier)
    effects = {n for h in accepted if h.effect != RELEASE for n in h.parameters}
    near = linearise(_beside(problem, accepted, whole).without(fit.failed), fit.last)
    kept = list(fit.selected)
    while True:
        index = [fit.selected.index(n) for n in kept]
        null = directions(near.jacobian[:, index], tuple(kept), fit.directions.ranges[index]).null_vectors()
        share = dict(zip(kept, np.abs(null).max(axis=0, initial=0.0), strict=True))
        removable = [n for n in kept if n in effects and share[n] > 0]
        if not removable:
            start = _start(problem, accepted, whole)
            problem = _beside(problem, accepted, whole)
            same = len(kept) == len(fit.selected)
            return fit if same else identify(problem, tuple(kept), start, states=fit.before.start)
        kept.remove(max(removable, key=lambda n: share[n]))
