"""Instruments that measured: which equations of a fit are of each, and what its stated noise is worth."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.session_frames import FrameSteps
from pkmcal_cli.model.model import Model

WORTH = {"stated": 10.0, "exact": np.inf, "unknown": 1.0}
"""Degrees of freedom that a stated variance is worth."""


@dataclass(frozen=True)
class Instruments:
    """G instruments; whose each whitened residual (n,) is, -1 for what is no reading; how many are of each (G,).

    freedom (G,): what the stated variance of each is worth; once (G,): whether on the bench.
    """

    names: tuple[str, ...]
    group_of: NDArray[np.intp]
    counts: Array
    freedom: Array
    once: NDArray[np.bool_]

    @classmethod
    def of(cls, problem: Problem, channel: NDArray[np.intp]) -> Instruments:
        """Instruments with readings; channel (n,): of each equation, -1 for what is no reading.

        The noise of drives is in the readings of all, and worth as little as either.
        """
        channels = problem.model.channels
        drives = [d for a, d in enumerate(problem.model.actuators) if problem.drive_sigma[:, a].any()]
        common = min((WORTH[d.sigma_is] for d in drives), default=np.inf)
        used = [k for k in range(len(channels)) if problem.measured[:, k].any()]
        names = tuple(dict.fromkeys(channels[k].instrument for k in used))
        of_channel = [names.index(channels[k].instrument) if k in used else -1 for k in range(len(channels))]
        counts = [sum(int(problem.measured[:, k].sum()) for k in used if of_channel[k] == g) for g in range(len(names))]
        worth = {channels[k].instrument: WORTH[channels[k].sigma_is] for k in used}
        group_of = np.array([*of_channel, -1], dtype=np.intp)[channel]
        on_bench = {channels[k].instrument for k in problem.once}
        once = np.array([n in on_bench for n in names], dtype=bool)
        return cls(names, group_of, np.array(counts), np.array([min(worth[n], common) for n in names]), once)

    def without(self, frames: FrameSteps | None, problem: Problem) -> Instruments:
        """The same less the equations that say where instruments stood: frames that are eliminated."""
        if frames is None or problem.frames is None:
            return self
        instrument, taken = instrument_of(problem.model), np.zeros(len(self.names))
        for sensor, count in zip(problem.frames.sensors, frames.seen.sum(axis=0), strict=True):
            if instrument[sensor] in self.names:
                taken[self.names.index(instrument[sensor])] += count
        return replace(self, counts=self.counts - taken)


def instrument_of(model: Model) -> dict[str, str]:
    """The instrument that each sensor is, or belongs to."""
    return {s.name: model.channels[k].instrument for s in model.sensors for k in s.channels}
