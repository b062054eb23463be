"""Rotations of the closed loop: rows that fit and choose, rows that only report, and what the former name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.base.stages import Observer, unobserved
from pkmcal_cli.base.workers import ALONE
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.patience import COMPARED
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.diagnosis.confirm import cells, single_poses
from pkmcal_cli.diagnosis.hypotheses import Candidates, Hypothesis
from pkmcal_cli.diagnosis.report_rows import OuterFold
from pkmcal_cli.diagnosis.run_diagnosis import named
from pkmcal_cli.diagnosis.search_options import SearchOptions

ROTATIONS = 5
FEWEST_TO_SPLIT = 20  # rows of which whole cells can be kept apart; of fewer, each pose in turn
Part = tuple[Problem, Problem, NDArray[np.intp]]


def parts_of(problem: Problem, validation: Problem | None) -> list[Part]:
    """Rows that fit and choose, and rows that report, by rotation, and which those are of their table."""
    if validation is not None:
        return [(problem, validation, np.arange(len(validation)))]
    labels = cells(problem, ROTATIONS) if len(problem) >= FEWEST_TO_SPLIT else single_poses(problem)
    pairs = [(np.nonzero(labels != k)[0], np.nonzero(labels == k)[0]) for k in np.unique(labels)]
    return [p for p in ((problem.take(a), problem.take(b), b) for a, b in pairs) if p[1].count]


def rotations(
    candidates: Candidates,
    parts: Sequence[Part],
    selected: tuple[str, ...],
    options: SearchOptions,
) -> tuple[OuterFold, ...]:
    """What each rotation names and fits. Raises RowsFailed."""
    trains = tuple(train for train, _, _ in parts)
    alone = replace(options, observe=unobserved, workers=ALONE)
    work = _Rotations(candidates, trains, selected, alone)
    sets_and_fits = options.workers.results(work, len(parts), "rotation", options.observe)
    return tuple(
        OuterFold(train=train, report=report, rows=rows, sets=sets, fit=fit, start=begun_with(candidates, train))
        for (train, report, rows), (sets, fit) in zip(parts, sets_and_fits, strict=True)
    )


def begun_with(candidates: Candidates, problem: Problem) -> Array:
    """Values (P,) that fits of rows begin with: as the candidates say, further effects of the problem's model null."""
    values = replace(candidates, model=problem.model, start=None).begin()
    values[: len(candidates.model.names)] = candidates.begin()
    return values


@dataclass(frozen=True)
class _Rotations:
    """What the rows that fit and choose name, and their fit, by the number of the rotation."""

    candidates: Candidates
    trains: tuple[Problem, ...]
    selected: tuple[str, ...]
    options: SearchOptions

    def __call__(self, number: int, observe: Observer = unobserved) -> tuple[tuple[tuple[Hypothesis, ...], ...], Fit]:
        train, options = self.trains[number], replace(self.options, observe=observe)
        sets, states = named(self.candidates, replace(train, model=self.candidates.model), self.selected, options)
        start = begun_with(self.candidates, train)
        return sets, identify(train, self.selected, start, states=states, patience=COMPARED)
