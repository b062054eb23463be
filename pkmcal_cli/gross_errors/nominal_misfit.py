"""How far a table is from what the machine file says, before any fit, and which constant of one drive explains it.

What parameters can take up is no mistake of the table, but who has not set the zeros of his drives wants to know now.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.residual import evaluate
from pkmcal_cli.gross_errors.plausibility import GROSS, rms
from pkmcal_cli.gross_errors.sample import Sample
from pkmcal_cli.model.commanded import forced

_RIVAL = 4.0  # times the squares that the constant of the right drive leaves: what that of any other leaves
_STEPS = 4


@dataclass(frozen=True)
class NominalMisfit:
    """Measured less predicted of a sample of the table, turns by the shorter way, frames of unknown place fitted.

    residual (n, C): nan where nothing was measured or predicted; constant: a drive and how much more it reads than it
    should, m or rad, where that leaves no more than ranges and noise explain.
    """

    sample: Sample
    residual: Array
    constant: tuple[int, float] | None

    @property
    def rms(self) -> Array:
        """Of each channel (C,); infinite without a value."""
        return np.array([rms(r) for r in self.residual.T])

    @property
    def expected(self) -> Array:
        """Rms that ranges and noise explain (C,)."""
        return self.sample.prior_rms

    @property
    def far(self) -> Array:
        """Channels (C,) farther off than ranges and noise explain, however lucky."""
        return np.asarray(np.isfinite(self.rms) & (self.rms > GROSS * self.expected))

    @property
    def rows_off(self) -> list[int]:
        """Rows of the table that are by themselves farther off than that, the worst first."""
        each = np.nan_to_num(np.abs(self.residual) / self.expected).max(axis=1)
        worst = np.argsort(-each, kind="stable")
        return [int(self.sample.rows[k]) for k in worst if each[k] > GROSS]


def nominal_misfit(sample: Sample) -> NominalMisfit:
    """Compare a sample with its predictions."""
    residual = sample.compared(sample.readings, sample.predicted) - sample.predicted
    misfit = NominalMisfit(sample, residual, None)
    return replace(misfit, constant=_constant(misfit)) if misfit.far.any() else misfit


def _constant(misfit: NominalMisfit) -> tuple[int, float] | None:
    """The constant of one drive that leaves what ranges and noise explain; None where none does, or several do."""
    drives = np.nonzero(~forced(misfit.sample.part.model))[0].tolist()
    tried = [(drive, *_best_constant(misfit, drive)) for drive in drives]
    tried.sort(key=lambda constant: _cost(misfit.sample, constant[2]))
    if not tried or replace(misfit, residual=tried[0][2]).far.any():
        return None
    least, *others = (_cost(misfit.sample, residual) for *_, residual in tried)
    return None if others and others[0] < _RIVAL * least else tried[0][:2]


def _best_constant(misfit: NominalMisfit, drive: int) -> tuple[float, Array]:
    """How much more a drive reads than it should, m or rad, by Gauss-Newton steps, and what residual (n, C) is left."""
    sample, residual, shift = misfit.sample, misfit.residual, 0.0
    part, evaluation, best = sample.part, sample.evaluation, (0.0, residual)
    for _ in range(_STEPS):
        by_drive = evaluation.prediction.by_drive
        assert by_drive is not None
        slope = np.nan_to_num(np.where(np.isfinite(residual), by_drive[:, :, drive], 0.0) / part.sigma)
        square = float((slope**2).sum())
        if square == 0:
            break
        shift += float((slope * np.nan_to_num(residual / part.sigma)).sum()) / square
        every = np.zeros((len(part), len(part.model.actuators)))
        every[:, drive] = shift
        evaluation = evaluate(part, evaluation.values, (), evaluation.start, every, compare=False)
        residual = sample.compared(sample.readings, evaluation.prediction.values) - evaluation.prediction.values
        if not evaluation.prediction.solved.all() or _cost(sample, residual) >= _cost(sample, best[1]):
            break
        best = (-shift, residual)
    return best


def _cost(sample: Sample, residual: Array) -> float:
    """Sum of squares of a residual (n, C), in sigma."""
    return float((np.nan_to_num(residual / sample.part.sigma) ** 2).sum())
