"""Whether parameters are as far off nominal as their ranges say, in what the data determine."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import null_space
from scipy.special import chdtr, chdtrc

from pkmcal_cli.calibration.condensed import condensed
from pkmcal_cli.calibration.error_budget import ErrorBudget
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.fitted_frames import frame_parameters
from pkmcal_cli.calibration.identifiability import Directions, directions
from pkmcal_cli.calibration.problem import Problem

_DOUBT = 0.01
_FAR = 3.0  # prior standard deviations, half ranges, from which on a value is worth a word


@dataclass(frozen=True)
class RangeCheck:
    """Probability, two-sided, of offsets so large or so small if ranges are right; factor of the ranges by kind.

    offsets, kinds: of the identified parameters, in half ranges; declared: directions with the ranges of the file.
    """

    p_value: float
    factors: Mapping[str, float]
    offsets: Mapping[str, float]
    kinds: frozenset[str]
    declared: Directions
    widths: Mapping[str, float] = field(default_factory=dict)  # of offsets relative to a datum, in half ranges; else 1

    @property
    def doubtful(self) -> bool:
        """Whether the ranges do not fit."""
        return self.p_value < _DOUBT

    @property
    def far(self) -> dict[str, float]:
        """Offsets that nobody would expect, largest first."""
        by_size = sorted(self.offsets.items(), key=lambda item: -abs(item[1]))
        return {name: offset for name, offset in by_size if abs(offset) > _FAR * self.width(name)}

    def width(self, name: str) -> float:
        """Standard deviation of the offset of a parameter, in half ranges: with that of the datum it is relative to."""
        return self.widths.get(name, 1.0)


def range_check(problem: Problem, fit: Fit, budget: ErrorBudget) -> RangeCheck:
    """Of a fit; `problem` has the ranges of the machine file."""
    model = problem.model
    index = [model.names.index(n) for n in fit.selected]
    ranges = model.ranges[index]
    offsets = 2.0 * (fit.values - problem.nominal_at(fit.values))[index] / ranges
    rows = condensed(problem, fit.last).values[1]
    spectrum = directions(rows, fit.selected, ranges, beside=problem.beside(fit.selected))
    moved = fit.directions.vectors[~fit.directions.held] * fit.directions.ranges / ranges  # what is held tells nothing
    known = np.linalg.qr(moved.T)[0].T if moved.size else moved  # (k, p)
    unranged = np.isin(fit.selected, list(frame_parameters(model)))
    known = null_space(known[:, unranged].T).T @ known if unranged.any() and known.size else known
    half, p = ranges / 2.0, len(ranges)
    beside = problem.beside(fit.selected) if budget.datum else None
    offset = np.eye(p) if beside is None else np.hstack([np.eye(p), beside])  # by what it is off
    transfer = offset + budget.by_own / half[:, None]  # what of an offset the estimate has
    expected = transfer @ transfer.T + budget.noise_covariance / np.outer(half, half)
    by_held = budget.by_held / half[:, None]
    along, count = known @ offsets, len(known)
    spread = known @ (expected + by_held @ by_held.T) @ known.T
    statistic = max(float(along @ np.linalg.pinv(spread, hermitian=True) @ along), 0.0) if count else 0.0
    declared = problem.prior is None or not problem.prior.stated  # else the errors are not those of ranges
    count = count if declared else 0
    chance = 2.0 * min(float(chdtr(count, statistic)), float(chdtrc(count, statistic))) if count else 1.0
    chance = chance if declared else float("nan")
    factors = {kind: float(np.median(drawn)) for kind, drawn in budget.scales.factors.items()}
    named = dict(zip(fit.selected, offsets.tolist(), strict=True))
    lost = fit.directions.undetermined()
    seen = {n: z for (n, z), gone in zip(named.items(), lost, strict=True) if not gone}
    judged = (model.parameters[k] for k, skipped in zip(index, unranged, strict=True) if not skipped)
    kinds = frozenset(p.kind or p.dimension for p in judged)
    widths = dict(zip(fit.selected, np.sqrt((offset**2).sum(axis=1)).tolist(), strict=True))
    return RangeCheck(chance if np.isnan(chance) else min(chance, 1.0), factors, seen, kinds, spectrum, widths)
