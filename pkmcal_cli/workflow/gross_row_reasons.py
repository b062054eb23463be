"""What is beyond all noise, found before a table is fitted: rows, and readings of the bench. Some are reasons not to
believe a fit by least squares."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.listener import Listener
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.bench_readings import BenchReading, bench_readings
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identify import RowsFailed, identify
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import evaluate, whitened_residual
from pkmcal_cli.diagnosis.gross_rows import Rows, gross_rows
from pkmcal_cli.gross_errors.far_rows import far_off_text
from pkmcal_cli.loading.load_machine import LoadedMachine
from pkmcal_cli.loading.poses import RowOrigin
from pkmcal_cli.prediction import WarmStart
from pkmcal_cli.report.bench_text import BenchText
from pkmcal_cli.report.odd_readings import OddReadings

_CHANCE, _ODD = 3e-3, 6.0  # chance for the whole table, and standard deviations, from which on a row is no noise
_GROSS = 18.0  # standard deviations from which on it spoils a fit by least squares


@dataclass(frozen=True, kw_only=True)
class BeyondNoise:
    """Rows that the others contradict, in ascending order, and those `far` off; readings of the bench of that kind."""

    rows: Rows = ()
    far: Rows = ()
    readings: tuple[BenchReading, ...] = ()

    @property
    def spoiling(self) -> tuple[BenchReading, ...]:
        """Readings of the bench that are so far off that they spoil a fit by least squares."""
        return tuple(r for r in self.readings if abs(r.deviation) >= _GROSS)


def beyond_noise(problem: Problem, selected: tuple[str, ...], start: Array, states: WarmStart) -> BeyondNoise:
    """What a fit of the other rows from values (P,) contradicts; `states` of the rows there.

    Found first: a fit that they spoil takes long, and its failure does not show them.
    """
    rows, others = gross_rows(problem, selected, _CHANCE, 0, _ODD, start=start, states=states)
    far = () if others is None else _far(problem, rows, others)
    if not problem.once:
        return BeyondNoise(rows=tuple(sorted(rows)), far=far)
    if others is None:
        try:
            others = identify(problem.leaving_out(problem.once), selected, start, states=states)
        except RowsFailed:
            return BeyondNoise()
    readings = bench_readings(problem, others)
    odd = tuple(r for r in readings if r.contradicts(len(readings)))
    return BeyondNoise(rows=tuple(sorted(rows)), far=far, readings=odd)


def _far(problem: Problem, rows: Rows, others: Fit) -> Rows:
    """Of some rows those that are off by far, in ascending order: from a fit of the others, as these scatter."""
    table = problem.leaving_out(problem.once)
    white = whitened_residual(table, evaluate(table, others.values, (), others.after.start))
    off = np.sqrt((np.where(table.measured, white, 0.0) ** 2).sum(axis=1) / others.excess)
    return tuple(sorted(row for row in rows if not off[row] < _GROSS))


def spoilt(
    odd: OddReadings, beyond: BeyondNoise, row_origin: Callable[[int], RowOrigin], to: Listener
) -> tuple[str, ...]:
    """Warn of what is beyond noise; those texts of it for which a fit by least squares is not to be believed."""
    hints = []
    if beyond.rows:
        text = far_off_text(beyond.rows, row_origin)
        to.warn(f"warning: {text}")
        hints += [text] if beyond.far else []
    for words in odd.bench:
        to.warn(f"warning: {words.text} (`--loss tukey` leaves it out)", words.location)
        hints += [words.text] if words.reading in beyond.spoiling else []
    return tuple(hints)


def without_readings(problem: Problem, odd: OddReadings, to: Listener) -> Problem:
    """The problem of a robust loss, which does without such readings: it would follow a single one too far."""
    for words in odd.bench:
        to.warn(f"warning: {words.text}: not used", words.location)
    return problem.leaving_out([words.reading.channel for words in odd.bench])


def odd_readings(
    loaded: LoadedMachine, problem: Problem, beyond: BeyondNoise, row_origin: Callable[[int], RowOrigin]
) -> OddReadings:
    """What is beyond noise, for a report."""
    bench = tuple(BenchText(loaded.machine, problem.model, reading) for reading in beyond.readings)
    return OddReadings(tuple(row_origin(row) for row in beyond.rows), bench)
