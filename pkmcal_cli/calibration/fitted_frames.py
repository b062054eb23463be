"""Where instruments stand that may stand anywhere: parameters whose ranges nobody stated."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array, exp, log
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


def placed_anywhere(model: Model) -> frozenset[str]:
    """These, and parameters that place only what instruments look at: of a ball that may stand anywhere. Their ranges
    say nothing of those of rods and rails, which are lengths too."""
    targets = model.base.targets(model.topology.coefficients)
    return frame_parameters(model) | {p.name for p in model.parameters if p.shared_name in targets}


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
    """Whether no instrument that measured positions is aligned to the machine; without positions, orientations."""
    model, measured = problem.model, np.asarray(problem.measured.any(axis=0))  # (C,)
    placed = {s.name for s in model.sensors if any(measured[k] for k, _ in s.places)}
    turned = {s.name for s in model.sensors if any(measured[k] for k, _ in s.rotates)}
    reading = placed or turned
    return bool(reading) and reading <= model.fitted_frames


def frame_motion(effect: PlacedEffect, values: Array) -> tuple[Array, Array]:
    """Rotation vector and shift (3,) of a frame, from the values of its parameters."""
    vectors = {"r": np.zeros(3), "t": np.zeros(3)}
    for kind, axis, value in zip(*_components(effect), values, strict=True):
        vectors[kind][axis] = value
    return vectors["r"], vectors["t"]


def parameter_errors(model: Model, values: Array, true: Array) -> Array:
    """Errors (P,) of parameter values (P,); of rotations of fitted frames, the rotation that is left.

    Rotation vectors that differ much may be the same rotation, or nearly.
    """
    errors: Array = values - true
    for effect in fitted_frames(model):
        at = [model.names.index(n) for n in effect.parameters]
        (there, _), (here, _) = (frame_motion(effect, v[at]) for v in (values, true))
        left = log(exp(there) @ exp(here).T)
        for place, kind, axis in zip(at, *_components(effect), strict=True):
            if kind == "r":
                errors[place] = left[axis]
    return errors


def _components(effect: PlacedEffect) -> tuple[list[str], list[int]]:
    """Of its parameters: `r` for rotations, `t` for shifts; the numbers of their axes."""
    short = [name.partition("[")[0].rpartition(".")[2] for name in effect.parameters]
    return [s[0] for s in short], ["xyz".index(s[1]) for s in short]
