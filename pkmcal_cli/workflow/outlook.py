"""How well further rows will let a fit know a parameter: by their noise, by ranges, and beside what is held."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.diagnosis.linear import linear_problem


@dataclass(frozen=True)
class Outlook:
    """How what the rows of a design promise, at the stated noise, becomes what a fit of them knows.

    factor: of the noise that was seen; known: information, 1/SI^2, that ranges add; held: what parameters that are not
    identified add to the uncertainty, SI.
    """

    factor: float
    known: float = 0.0
    held: float = 0.0

    @classmethod
    def of(cls, noise: float, planned: float, std: float, limit: float, held: float) -> Outlook:
        """By what the measured rows promised and what their fit knows, `std`, which is wanted to `limit`, SI.

        What few rows leave to wide ranges, further ones do not; only where the design would do and the fit does not,
        the excess stays.
        """
        if not (math.isfinite(planned) and math.isfinite(std)):
            return cls(max(noise, 1.0))
        by_rows, rest = (math.sqrt(max(x**2 - held**2, 0.0)) for x in (std, limit))
        if noise * planned <= rest < by_rows:
            return cls(by_rows / planned, held=held)
        return cls(noise, max(1.0 / by_rows**2 - 1.0 / (noise * planned) ** 2, 0.0) if by_rows else 0.0, held)

    def promised(self, limit: float) -> float:
        """What a design must promise so that its fit knows the parameter to a limit, SI; 0 where none will do."""
        if limit <= self.held:
            return 0.0
        left = 1.0 / (limit**2 - self.held**2) - self.known
        return 1.0 / (self.factor * math.sqrt(left)) if left > 0 else math.inf

    def std(self, promised: float) -> float:
        """What a fit knows, SI."""
        every = self.known + (0.0 if math.isinf(promised) else 1.0 / (self.factor * promised) ** 2)
        return math.hypot(1.0 / math.sqrt(every), self.held) if every > 0 else math.inf


def held_std(problem: Problem, values: Array, selected: tuple[str, ...], held: tuple[str, ...], name: str) -> float:
    """What parameters that are held, off by half a range, add to the uncertainty of a selected one in a fit of these
    rows at values (P,), SI: consider covariance, as of `error_budget`."""
    linear = linear_problem(problem, values, selected, held, None)
    directions, prior = linear.fixed
    errors = np.linalg.solve(directions.T @ directions + prior, directions.T @ linear.of(held))
    k = selected.index(name)
    return float(np.linalg.norm(linear.spectrum.vectors[:, k] @ errors)) * 0.5 * float(linear.ranges[k])
