"""Where instruments stand that may stand anywhere: parameters whose ranges nobody stated."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.effects.instrument import FRAME
from pkmcal_cli.model.effect_sites import PlacedEffect
from pkmcal_cli.model.model import Model


def fitted_frames(model: Model) -> list[PlacedEffect]:
    """The frames of sensors with `frame: fitted`, one for each session that has its own."""
    return [e for e in model.effects if e.effect.keyword == FRAME.keyword and e.at in model.fitted_frames]


def frame_parameters(model: Model) -> frozenset[str]:
    """Names of their parameters."""
    return frozenset(n for e in fitted_frames(model) for n in e.parameters)


def of_unplaced(problem: Problem, values: Array) -> NDArray[np.bool_]:
    """Cells (N, C) of instruments that stand anywhere, in sessions of which nothing says where at values (P,), SI."""
    model, numbers = problem.model, problem.model.by_name(values)
    out = np.zeros(problem.readings.shape, dtype=bool)
    for effect in fitted_frames(model):
        if effect.session and not any(numbers[n] for n in effect.parameters):
            rows = problem.rows.columns[f"session.{effect.session}"] > 0
            for sensor in (s for s in model.sensors if s.name == effect.at):
                out[np.ix_(rows, np.asarray(sensor.channels))] = True
    return out


def stands_anywhere(problem: Problem) -> bool:
    """Whether no instrument that measured positions is aligned to the machine."""
    model, measured = problem.model, np.asarray(problem.measured.any(axis=0))  # (C,)
    reading = {s.name for s in model.sensors if any(measured[k] for k, _ in s.places)}
    return bool(reading) and reading <= model.fitted_frames
