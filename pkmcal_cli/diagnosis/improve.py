"""The closed loop: fit, diagnose, add, fit again; accepted by points that neither fitted nor chose.

The table is cut into blocks. In each rotation one block only reports: the rest fits the parameters and chooses the
effects (by its own cross-validation); an effect changes the errors on a rotation's report rows only if that rotation's
other rows chose it. Over all rotations every row reports once. With a validation table there is one rotation, and
that table reports.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pkmcal_cli.base.plural import count
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identifiability import directions
from pkmcal_cli.calibration.identify import RowsFailed, identify
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import linearise
from pkmcal_cli.diagnosis.confirm import cells
from pkmcal_cli.diagnosis.diagnose import Diagnosis, diagnose
from pkmcal_cli.diagnosis.findings import Finding
from pkmcal_cli.diagnosis.hypotheses import RELEASE, Candidates, Hypothesis
from pkmcal_cli.diagnosis.report_rows import Errors, Interval, Rotation, errors_of, gain_of, rms_gain_of
from pkmcal_cli.diagnosis.rows import MOST
from pkmcal_cli.prediction import frozen

ROTATIONS = 5
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


@dataclass(frozen=True, kw_only=True)
class Improvement:
    """The loop's result; `gain`: of the mean square whitened, `rms_gain` (SI) of positions; `fit`: on all rows.

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
    fit: Fit
    problem: Problem
    alpha: float  # false-alarm rate of the diagnosis
    broken: Exception | None = None

    @property
    def confirmed(self) -> bool:
        """Whether the error on the report rows falls, by the lower end of the interval."""
        return bool(self.accepted) and self.gain.low > 0


def improve(
    found: Candidates, problem: Problem, selected: tuple[str, ...], validation: Problem | None, alpha: float, seed: int
) -> Improvement:
    """Run the loop; `problem` belongs to the candidates' model. Raises RowsFailed."""
    whole = diagnose(found, problem, selected, alpha, seed)
    clean = whole.problem  # without its bad rows
    model = frozen(clean.model, clean.rows)  # shapes are spread over the whole table, whatever part of it is fitted
    clean, found = replace(clean, model=model), replace(found, model=model)
    validation = None if validation is None else replace(validation, model=model)
    first = [_rotation(found, train, report, selected, alpha, seed) for train, report in _parts(clean, validation)]
    before = errors_of(first)
    now = _Progress(tuple(first), before, identify(clean, whole.search.declared))
    broken: Exception | None = None
    try:
        for hypothesis in _majority(whole, first):
            now = _tried(now, hypothesis, clean, whole, seed)
    except Exception as error:  # what was done before it stands, and is told first
        broken = error
    return Improvement(
        whole=whole,
        rotations=len(first),
        steps=now.steps,
        accepted=now.accepted,
        before=before,
        after=now.errors,
        gain=gain_of(first, now.turns, seed),
        rms_gain=rms_gain_of(first, now.turns, seed),
        fit=now.last,
        problem=clean,
        alpha=alpha,
        broken=broken,
    )


@dataclass(frozen=True)
class _Progress:
    """How far the loop has come: rotations with what was accepted, their errors, the fit on all rows; every step."""

    turns: tuple[Rotation, ...]
    errors: Errors
    last: Fit
    steps: tuple[Step, ...] = ()
    accepted: tuple[Hypothesis, ...] = ()


def _tried(now: _Progress, hypothesis: Hypothesis, clean: Problem, whole: Diagnosis, seed: int) -> _Progress:
    """The loop after one more effect; `clean`: all rows but the bad ones."""
    chosen = sum(t.chose(hypothesis) for t in now.turns)
    accepted = (*now.accepted, hypothesis)
    try:
        trial = tuple(_with(t, hypothesis, whole) if t.chose(hypothesis) else t for t in now.turns)
        gain, errors = gain_of(now.turns, trial, seed), errors_of(trial)
        refused = _refused(now, trial, chosen, gain, errors)
        last = now.last if refused else _determined(clean, accepted, whole)
    except (RowsFailed, np.linalg.LinAlgError):
        step = Step(hypothesis, now.errors, Interval(0.0, -np.inf, np.inf), chosen, _FAILS)
        return replace(now, steps=(*now.steps, step))
    steps = (*now.steps, Step(hypothesis, errors, gain, chosen, refused))
    return replace(now, steps=steps) if refused else _Progress(trial, errors, last, steps, accepted)


def _refused(now: _Progress, trial: Sequence[Rotation], chosen: int, gain: Interval, errors: Errors) -> str:
    """Why an effect is not accepted, "" where it is."""
    if 2 * chosen <= len(trial):
        return f"chosen in {chosen} of {count(len(trial), 'rotation')} only"
    if errors.failed - now.errors.failed > max(int(MOST * sum(len(t.report) for t in trial)), 1):
        return f"with it {count(errors.failed - now.errors.failed, 'more row')} cannot be predicted"
    if not gain.low > 0:
        return "the error on the report rows does not fall for sure"
    return "" if all(t.fit.settled for t in trial) else _FAILS


def _majority(whole: Diagnosis, turns: Sequence[Rotation]) -> list[Hypothesis]:
    """Effects to try: those that all rows name, and those that most rotations name though all rows do not.

    Parameters of the machine file first: what they explain needs no effect.
    """
    named = list(whole.search.accepted)
    for hypothesis in (f.hypothesis for t in turns for f in t.found.findings):
        if hypothesis not in named and 2 * sum(t.chose(hypothesis) for t in turns) > len(turns):
            named += [hypothesis] if not any(_alike(hypothesis, f) for f in whole.findings) else []
    return sorted(named, key=lambda h: h.effect != RELEASE)


def _alike(hypothesis: Hypothesis, finding: Finding) -> bool:
    """Whether an effect is in the set of one that is named already."""
    return hypothesis in [r.hypothesis for r in finding.rivals]


def _parts(problem: Problem, validation: Problem | None) -> list[tuple[Problem, Problem]]:
    """Rows that fit and choose, and rows that report, by rotation."""
    if validation is not None:
        return [(problem, validation)]
    labels = cells(problem, ROTATIONS)
    pairs = [(np.nonzero(labels != k)[0], np.nonzero(labels == k)[0]) for k in range(ROTATIONS)]
    return [(problem.take(train), problem.take(report)) for train, report in pairs if len(report)]


def _rotation(
    found: Candidates, train: Problem, report: Problem, selected: tuple[str, ...], alpha: float, seed: int
) -> Rotation:
    diagnosis = diagnose(found, train, selected, alpha, seed)
    return Rotation(train, report, diagnosis, identify(train, selected))


def _with(turn: Rotation, hypothesis: Hypothesis, whole: Diagnosis) -> Rotation:
    accepted = (*turn.accepted, hypothesis)
    return replace(turn, fit=_fit_with(turn.train, accepted, whole), accepted=accepted)


def _fit_with(problem: Problem, accepted: Sequence[Hypothesis], whole: Diagnosis) -> Fit:
    """A calibration with effects, from nominal values. Raises RowsFailed."""
    chosen = set(whole.search.declared) | {n for h in accepted for n in h.parameters}
    return identify(problem, tuple(n for n in problem.model.names if n in chosen))


def _determined(problem: Problem, accepted: Sequence[Hypothesis], whole: Diagnosis) -> Fit:
    """The same, but that numbers of effects which the data do not tell from other parameters stay at null.

    The shift of a measuring frame beside that of the base would leave both open.
    """
    fit = _fit_with(problem, accepted, whole)
    effects = {n for h in accepted if h.effect != RELEASE for n in h.parameters}
    near = linearise(problem.without(fit.failed), fit.last)
    kept = list(fit.selected)
    while True:
        index = [fit.selected.index(n) for n in kept]
        null = directions(near.jacobian[:, index], tuple(kept), fit.found.ranges[index]).null_vectors()
        share = dict(zip(kept, np.abs(null).max(axis=0, initial=0.0), strict=True))
        loose = [n for n in kept if n in effects and share[n] > 0]
        if not loose:
            return fit if len(kept) == len(fit.selected) else identify(problem, tuple(kept))
        kept.remove(max(loose, key=lambda n: share[n]))
