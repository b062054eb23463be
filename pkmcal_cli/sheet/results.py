"""All that a sheet is made of."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from pkmcal_cli.calibration.point_errors import Judged, PointErrors, point_errors
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import evaluate
from pkmcal_cli.diagnosis.bad_rows import with_rows
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.loading.load_machine import LoadedMachine
from pkmcal_cli.report.calibration import CalibrationReport
from pkmcal_cli.report.diagnosis import DiagnosisReport
from pkmcal_cli.report.improvement import ImprovementReport
from pkmcal_cli.report.number_format import small_unit
from pkmcal_cli.report.verification import VerificationReport
from pkmcal_cli.tables.measurement_set import Measurements
from pkmcal_cli.units.measurands import Measurand
from pkmcal_cli.units.unit_text import UNITS, Unit


@dataclass(frozen=True, kw_only=True)
class Results:
    """A calibration, what the search for causes found (`not_searched`: why there was none), and a second table.

    tolerance: m and its unit; fit_words: options of the fit, as a command line has them; feed, m/s, of circles in the
    tables; head: provenance; notes: on files.
    """

    loaded: LoadedMachine
    measured: Measurements
    calibrated: CalibrationReport
    improved: ImprovementReport | None
    not_searched: str
    verified: VerificationReport | None
    tolerance: tuple[float, Unit] | None
    fit_words: tuple[str, ...]
    feed: float | None
    head: Mapping[str, Any]
    notes: tuple[str, ...] = ()
    simulated: tuple[str, ...] = ()  # of these, that a table was never measured

    @property
    def machine(self) -> Machine:
        """As its file says it."""
        return self.loaded.machine

    @property
    def diagnosis(self) -> DiagnosisReport | None:
        """What the search found."""
        return None if self.improved is None else self.improved.diagnosis

    @property
    def before(self) -> tuple[PointErrors, str]:
        """Position errors of the calibrated machine without what it lacks, and of which rows they are."""
        if self.improved is not None:
            points = self._whole_points(self.improved.improvement.before.points)
            return points, "rows used neither for fitting nor for selection"
        problem = self.calibrated.problem.without(self.calibrated.slipped)
        there = evaluate(problem, self.calibrated.fit.values, ())
        return point_errors(problem, there.residual, problem.measured), "the rows that were fitted"

    @cached_property
    def bad_rows(self) -> tuple[int, ...]:
        """Rows that the search for causes left out, or of which a robust loss left out values."""
        if self.improved is None or self.diagnosis is None:
            return ()
        left_out = np.nonzero((self.all_rows.measured & ~self.improved.improvement.problem.measured).any(axis=1))[0]
        return tuple(row for row in left_out.tolist() if row not in self.diagnosis.diagnosis.failed)

    @cached_property
    def not_judged(self) -> Mapping[int, float]:
        """Rows whose positions are not judged, and how far off they are with all that was found, m; nan: unknown."""
        problem = self.all_rows
        made = self.calibrated.fit if self.improved is None else self.improved.improvement.fit
        there = evaluate(problem, made.values, ())
        on = problem.measured & np.isfinite(there.residual)
        off = point_errors(problem, there.residual, on)
        sizes = dict(zip(off.rows.tolist(), off.errors.tolist(), strict=True))
        measured = problem.measured[:, problem.model.measuring(Measurand.POSITION)].any(axis=1)
        rows = set(np.nonzero(measured)[0].tolist()) - set(self.before[0].rows.tolist())
        return {row: sizes.get(row, float("nan")) for row in sorted(rows)}

    @cached_property
    def all_rows(self) -> Problem:
        """The last fit's problem with all that was measured, but for exact copies of rows."""
        problem = self.calibrated.problem if self.improved is None else self.improved.improvement.problem
        copied = {row for group in problem.copies for row in group[1:]}
        return with_rows(problem, [row for row in range(len(problem)) if row not in copied])

    def _whole_points(self, points: PointErrors) -> PointErrors:
        """Those of which no coordinate was left out: else a point that is far off would pass by the others."""
        return points.of(~np.isin(points.rows, self.bad_rows))

    @property
    def expected(self) -> PointErrors | None:
        """The same with the effects that the search added and the report rows confirm; None without any."""
        if self.improved is None or not self.improved.improvement.confirmed:
            return None
        return self._whole_points(self.improved.improvement.after.points)

    @property
    def judged(self) -> Judged | None:
        """By the tolerance: the second table where there is one, else the calibrated machine as it is."""
        if self.tolerance is None:
            return None
        if self.verified is not None:
            return self.verified.judged
        return Judged(self.before[0], self.tolerance[0])

    def row_origin(self, row: int) -> str:
        """A row of the table that is judged, in short."""
        if self.verified is not None:
            return os.path.basename(str(self.verified.row_origin(row)))
        return self.row_text(row)

    def row_text(self, row: int) -> str:
        """A row of the measurements, without the folder of its file."""
        return os.path.basename(self.measured.row_origin(row))

    @property
    def length_unit(self) -> Unit:
        """That of the tolerance, else of the largest error."""
        if self.tolerance is not None:
            return self.tolerance[1]
        points = self.before[0]
        large = points.worst is not None and points.errors[points.worst] >= 1e-3
        small = small_unit(self.machine.file_units.length)
        return UNITS["mm"] if large and small.text == "um" else small

    def length_text(self, value: float) -> str:
        """A length, m, in this unit."""
        return f"{self.length_unit.from_si(value):.3g} {self.length_unit.text}"

    def place_text(self, value: float) -> str:
        """A coordinate, m, in the file's unit of lengths."""
        unit = self.machine.file_units.length
        return f"{unit.from_si(value):.6g} {unit.text}"
