"""Which frames a fit eliminates: those of instruments that every session sets up anew, where they are many."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from pkmcal_cli.calibration.error_budget import ErrorBudget
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.fitted_frames import fitted_frames
from pkmcal_cli.calibration.instruments import instrument_of
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import evaluate, linearise
from pkmcal_cli.calibration.session_frames import SessionFrames

MANY = 60  # numbers of frames from which on they are eliminated: fewer are parameters as others are


def without_frames(problem: Problem, selected: tuple[str, ...], plain: bool) -> tuple[Problem, tuple[str, ...]]:
    """The problem that eliminates frames of its sessions, and those selected parameters that are left to identify.

    As they are where frames are few, where something is known of them besides, where measurements join rows, and where
    not all is `plain`: a robust loss, the bootstrap and profiles look at each parameter, and at what rows say of it.
    """
    model, chosen = problem.model, frozenset(selected)
    frames = [e for e in fitted_frames(model) if e.session]
    held = {e.at for e in frames if not chosen.issuperset(e.parameters)}
    effects = [e for e in frames if e.at not in held]
    of = {model.shared[name][0]: e.at for e in effects for name in e.parameters}
    eliminated = SessionFrames(tuple(of), tuple(of.values()), model.sessions)
    names = frozenset(eliminated.names)
    left = tuple(n for n in selected if n not in names)
    known = problem.prior is not None and not names.isdisjoint(problem.prior.names)
    joined = problem.rows.partner is not None and len(problem.joining) > 0
    if not plain or len(names) < MANY or not left or known or joined or problem.method != "exact":
        return problem, selected
    return replace(problem, frames=eliminated), left


@dataclass(frozen=True)
class FrameUncertainty:
    """Standard uncertainty of a number of a frame, SI, nan where its session does not determine it.

    by_held: the part by parameters that are not identified; felt: whether its session's readings depend on it.
    """

    std: float
    by_held: float
    felt: bool


def frame_uncertainties(problem: Problem, fit: Fit, budget: ErrorBudget) -> Mapping[str, FrameUncertainty]:
    """Of the frames that a fit has eliminated, by name of the parameter: by noise, and by what others are off."""
    if problem.frames is None or fit.abandoned:
        return {}
    names = (*budget.names, *budget.held)
    steps = linearise(problem, evaluate(problem, fit.values, names, fit.last.start, fit.shift)).frames
    assert steps is not None
    variance = dict(zip(budget.instruments, budget.noise_variances.tolist(), strict=True))
    of = instrument_of(problem.model)
    noise = np.array([variance.get(of[sensor], 1.0) for sensor in problem.frames.sensors])
    std, by_data = (steps.std(each.joint_covariance, noise) for each in (budget, budget.without_held))
    by_held = np.sqrt(np.maximum(std**2 - by_data**2, 0.0))
    felt = (np.einsum("sll->sl", steps.noise) > 0.0) | steps.seen
    columns = (std.ravel().tolist(), by_held.ravel().tolist(), felt.ravel().tolist())
    return {n: FrameUncertainty(*numbers) for n, *numbers in zip(problem.frames.names, *columns, strict=True)}
