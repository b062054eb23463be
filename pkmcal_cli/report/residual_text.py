"""How large the residuals of a diagnosed table are after calibration, and what that says of the stated noise."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pkmcal_cli.base.plural import count
from pkmcal_cli.calibration.errors_before_after import error_figures
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.diagnosis.run_diagnosis import Diagnosis
from pkmcal_cli.report.number_format import readable
from pkmcal_cli.units.unit_text import Unit

_SMALLEST = 1e-12  # p value that is told as a number
_LARGER = 1.5  # times the stated noise: from which on residuals are called larger
_MANY, _TOO_SMALL = 20, 0.25  # degrees of freedom, and chi-square for each of them: less is no noise of this sigma


@dataclass(frozen=True)
class ResidualText:
    """The sentence; sigma: of what errors are told of, SI, in a unit."""

    diagnosis: Diagnosis
    sigma: float
    unit: Unit

    @property
    def text(self) -> str:
        """Of the rows that are used, all figures; then what the bad ones add."""
        both = self._rms(), self.sigma
        rms_text, sigma_text = (readable(x, self.unit, like=max(both)) for x in both)
        shown = self.diagnosis.shown
        of = "" if shown.alone else f" of {shown.name}"
        return (
            f"The residuals after calibration are {_times(self.diagnosis.cleared)}: {rms_text} rms{of} "
            f"(sigma {sigma_text}{self._doubt_of_sigma()}, {self._chance()}).{self._with_bad()}"
        )

    def _rms(self) -> float:
        """Root mean square error of the kind that is shown, SI."""
        problem, there = self.diagnosis.problem, self.diagnosis.cleared.after
        measured = problem.measured & np.isfinite(there.residual)
        figures = error_figures(replace(problem, measured=measured), there)
        return figures.get(self.diagnosis.shown.name, next(iter(figures.values()))).rms

    def _with_bad(self) -> str:
        """The same with what is not used."""
        rows, readings = len(self.diagnosis.bad_rows), len(self.diagnosis.bad_readings)
        bad = [count(rows, "bad row")] if rows else []
        bad += [count(readings, "bad reading")] if readings else []
        return f" With {' and '.join(bad)} they are {_times(self.diagnosis.before)}." if bad else ""

    def _chance(self) -> str:
        """The p value on which the verdict rests: of the sum of squares, or of an effect's shape where that is less.

        A small effect that many readings share changes their sum of squares by less than chance does.
        """
        chance, by = self.diagnosis.p_global, ""
        best = min(self.diagnosis.findings, key=lambda f: f.p_value, default=None)
        if best is not None and best.p_value < chance:
            chance, by = best.p_value, f" by the shape of {best.hypothesis.name}"
        return f"p {chance:.1g}{by}" if chance > _SMALLEST else "p < 1e-12"

    def _doubt_of_sigma(self) -> str:
        """What the residual says of the stated sigma, where they differ much."""
        diagnosis = self.diagnosis
        if diagnosis.scale.doubted:
            return f", noise estimated as {np.sqrt(diagnosis.scale.variance):.3g} times sigma"
        after = diagnosis.search.fit
        return ", which is too large" if after.dof >= _MANY and after.chi2_per_dof < _TOO_SMALL else ""


def _times(fit: Fit) -> str:
    """Size of what a fit leaves, in the stated noise."""
    ratio = float(np.sqrt(fit.chi2 / max(fit.dof, 1)))
    return f"{ratio:.3g} times {'larger than ' if ratio >= _LARGER else ''}the stated noise"
