"""Noise of each channel by the spread of repeated poses, against the sigma that is stated.

What is predicted to differ within a group of repetitions is taken out, so the drives need not read quite the same.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtr, chdtrc

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import evaluate
from pkmcal_cli.calibration.same_poses import loads_of, poses_alike
from pkmcal_cli.model.parts import Channel
from pkmcal_cli.units.measurands import Measurand
from pkmcal_cli.units.unit_text import parse_unit

DOUBT = 0.01  # probability below which the stated sigma is not believed
_SAME = 1e-4  # share of a drive's spread that readings of one pose may differ by
_BASE = 30  # of digits that tell sessions apart


@dataclass(frozen=True, kw_only=True)
class ReplicateNoise:
    """Noise of a channel: standard deviation `std` within `n_groups` repeated poses, and the stated `sigma`, SI.

    p_value: probability of so large a departure from what is stated, two-sided. Errors of the drives may or may not
    repeat with the pose, so neither kind of spread is a departure.
    """

    channel: str
    n_groups: int
    degrees_of_freedom: int
    std: float
    sigma: float
    unit: str
    p_value: float

    @property
    def doubtful(self) -> bool:
        """Whether the stated sigma does not fit."""
        return self.p_value < DOUBT

    def json(self) -> dict[str, Any]:
        """For the JSON result, in the channel's unit."""
        scale = parse_unit(self.unit).scale
        return {
            "channel": self.channel,
            "n_groups": self.n_groups,
            "degrees_of_freedom": self.degrees_of_freedom,
            "std": self.std / scale,
            "sigma": self.sigma / scale,
            "unit": parse_unit(self.unit).text,
            "p_value": self.p_value,
        }


def replicate_noise(problem: Problem, fit: Fit) -> tuple[ReplicateNoise, ...]:
    """Of the channels that were measured at repeated poses; none without these. Copies of rows do not count."""
    groups = repeated_poses(problem)
    if groups.max(initial=-1) < 0:
        return ()
    residual, from_drives = _residual(problem, fit)
    joins = {int(k) for s in problem.model.sensors if s.kind.joins for k in s.channels}
    scatter = []
    for k, channel in enumerate(problem.model.channels):
        if k not in joins and np.isnan(channel.once):
            rows = np.nonzero(problem.measured[:, k] & np.isfinite(residual[:, k]) & (groups >= 0))[0]
            sigma = problem.sigma[rows, k]
            spread = np.sqrt(sigma**2 + from_drives[rows, k])
            scatter.append(_noise(channel, groups[rows], residual[rows, k], sigma, spread))
    return tuple(noise for noise in scatter if noise is not None)


def _noise(
    channel: Channel, groups: NDArray[np.intp], residual: Array, sigma: Array, spread: Array
) -> ReplicateNoise | None:
    """Of a channel's residuals (n,) in groups (n,); None without two of one group.

    sigma, spread (n,): stated, without and with errors of the drives.
    """
    numbers, group_of, size = np.unique(groups, return_inverse=True, return_counts=True)
    many = size[group_of] > 1
    freedom = int(many.sum()) - int((size > 1).sum())
    if not freedom:
        return None
    mean = np.bincount(group_of, residual) / size
    deviation = (residual - mean[group_of])[many]
    low, high = (_weighed(group_of[many], residual[many], s[many], len(numbers)) for s in (sigma, spread))
    p = 2 * min(float(chdtr(freedom, low)), float(chdtrc(freedom, high)))
    std = float(np.sqrt((deviation**2).sum() / freedom))
    return ReplicateNoise(
        channel=channel.name,
        n_groups=int((size > 1).sum()),
        degrees_of_freedom=freedom,
        std=std,
        sigma=float(np.sqrt(np.mean(sigma[many] ** 2))),
        unit=channel.unit,
        p_value=min(1.0, p),
    )


def _weighed(group_of: NDArray[np.intp], residual: Array, sigma: Array, count: int) -> float:
    """Sum of squares about the weighted means of the groups, in standard uncertainties."""
    weight = 1 / sigma**2
    total = np.bincount(group_of, weight, count)
    mean = np.bincount(group_of, weight * residual, count) / np.where(total > 0, total, 1.0)
    return float((weight * (residual - mean[group_of]) ** 2).sum())


def _residual(problem: Problem, fit: Fit) -> tuple[Array, Array]:
    """Measured less predicted (N, C) at the fitted values and the drives' own readings; variance by their errors."""
    if not problem.reading_sigma.any():
        return fit.after.residual, np.zeros(problem.readings.shape)
    evaluation = evaluate(problem, fit.values, (), fit.after.start)
    slopes = evaluation.prediction.by_drive
    assert slopes is not None
    error = np.nan_to_num(slopes) * problem.reading_sigma[:, None, :]
    return evaluation.residual, np.asarray((error**2).sum(axis=2))


def repeated_poses(problem: Problem) -> NDArray[np.intp]:
    """Number (N,) of the repeated pose of each row within its session; -1 for poses that stand alone, and for copies.

    The same drive readings under another load are another pose.

    Stricter than the groups that hold-outs keep together: neighbours on a fine grid are other poses.
    """
    sessions = _digits(problem.rows.session)
    read = {c.index for c in problem.model.channels if c.measurand is Measurand.DRIVE}
    drives = problem.rows.readings[:, [a for a in range(len(problem.model.actuators)) if a not in read]]
    columns = [*sessions, *drives[:, ~np.isnan(drives).any(axis=0)].T, *loads_of(problem.rows)]
    out = poses_alike(np.column_stack(columns), _SAME)
    for group in problem.copies:
        out[list(group[1:])] = -1
    alone = np.bincount(out[out >= 0], minlength=out.max(initial=0) + 1) < 2
    return np.where((out >= 0) & ~alone[out], out, -1)


def _digits(numbers: NDArray[np.intp]) -> list[NDArray[np.intp]]:
    """Columns (N,) that are alike only where the numbers are the same: digits are far apart beside their spread."""
    out = [numbers % _BASE]
    while (numbers := numbers // _BASE).any():
        out.append(numbers % _BASE)
    return out
