"""Sizes of constants and scales of drives by what the drives should read where the tool was measured.

That tells them at any size if all else is about nominal. From predictions it is not seen: drives that disagree strain
the structure, and rows are soon where no step leads on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.measured_pose import measured_poses
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.prediction import Rows
from pkmcal_cli.prediction.displacements import displacements
from pkmcal_cli.prediction.stages import BaseCoefficients, commanded_coefficients

_ODD = 6.0  # times the median, at which a row is left out
_FEWEST = 4  # rows


@dataclass(frozen=True)
class PosedSize:
    """Numbers (k,), SI, of a hypothesis, and the share that they leave of the squares by which drives are off."""

    numbers: Array
    left: float


def posed_sizes(problem: Problem, values: Array, hypotheses: Sequence[Hypothesis]) -> dict[Hypothesis, PosedSize]:
    """What measured poses tell of those hypotheses that displace drives; all else is at values (P,).

    Empty where the poses of fewer than four rows are known.
    """
    posed = measured_poses(problem, values)
    if len(posed.rows) < _FEWEST:
        return {}
    expected = posed.drive_readings(values)  # (n, A)
    known = np.isfinite(expected).all(axis=1)
    if known.sum() < _FEWEST:
        return {}
    rows = problem.rows.take(posed.rows[known])
    base = BaseCoefficients.of(problem.model, values, rows)
    should = commanded_coefficients(problem.model, base, rows.moved(expected[known] - rows.readings))
    stands = commanded_coefficients(problem.model, base, rows)
    displacements(problem.model, values, rows, (), None).apply(stands)  # by what was found before
    off = (should - stands)[:, _places(problem)]  # (n, A)
    out = {}
    for hypothesis in hypotheses:
        columns = _columns(problem, values, rows, hypothesis.parameters)
        if columns.any():
            out[hypothesis] = _size(columns, off)
    return out


def _places(problem: Problem) -> list[int]:
    """Coefficients of the positions of drives."""
    return [drive.coefficient for drive in problem.model.topology.drives]


def _columns(problem: Problem, values: Array, rows: Rows, parameters: Sequence[str]) -> Array:
    """What parameters (k,) do to the positions of drives, by rows (n, A, k)."""
    out = np.zeros((len(rows), len(problem.model.topology.coefficients.constants), len(parameters)))
    for each in displacements(problem.model, values, rows, parameters, None).parts:
        if not each.site.scales:
            moved = np.einsum("sw,nwk->nsk", each.site.matrix, each.by_parameter)
            out[:, each.site.coefficients[:, None], each.columns] += moved
    return out[:, _places(problem)]


def _size(columns: Array, off: Array) -> PosedSize:
    """By columns (n, A, k) of what is off (n, A); rows that are odd do not count."""
    on = np.ones(len(off), dtype=bool)
    for _ in range(2):
        size = np.linalg.lstsq(columns[on].reshape(-1, columns.shape[2]), off[on].ravel(), rcond=1e-9)[0]
        left = np.square(off - columns @ size).sum(axis=1)  # (n,)
        on = left <= _ODD**2 * np.median(left)
    return PosedSize(size, float(left[on].sum() / max(np.square(off[on]).sum(), np.finfo(float).tiny)))
