"""Repeated calibrations of simulated machines: what is left of their errors, by the number of measured points.

A repetition draws parameters about nominal by half their ranges, identified or not, points of a region and noise;
machines that are compared have the same errors in parameters of the same name, and are measured at the same points with
the same noise.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import isfinite
from typing import Any

import numpy as np
from scipy.special import chdtrc

from pkmcal_cli.base.errors import BadInput
from pkmcal_cli.base.rotation import Array, best_motion, best_rotation, exp, log
from pkmcal_cli.base.stages import Observer, unobserved
from pkmcal_cli.calibration.complete_fit import FitOptions, calibrated
from pkmcal_cli.calibration.condensed import condensed, evaluate_condensed
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.fitted_frames import frame_parameters, parameter_errors, stands_anywhere
from pkmcal_cli.calibration.frame_start import with_frames
from pkmcal_cli.calibration.identify import RowsFailed, identify
from pkmcal_cli.calibration.problem import Problem, design_problem, usable
from pkmcal_cli.loading.covariates import at_rest
from pkmcal_cli.loading.nearby_poses import rows_before
from pkmcal_cli.model.limits import drive_limits
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.tool_channels import tcp_model
from pkmcal_cli.model.tool_motion import DIRECTIONS
from pkmcal_cli.model.workspace import Workspace
from pkmcal_cli.prediction import Rows, predict
from pkmcal_cli.prediction.inverse_kinematics import drive_positions

_ROUNDS = 40  # of points that are drawn; a region of which a machine reaches a tenth takes some ten

_NEVER = 1e-9  # chance of residuals that no noise leaves

Outcome = list[float] | None
"""Of one machine: errors of its parameters (p,), SI, and mean error of the tool point at other points, m, or where it
only turns, rad; None where the calibration has failed, or leaves more than noise."""


@dataclass(frozen=True, kw_only=True)
class StudiedMachine:
    """A machine, its name, the parameters that are drawn and identified, coordinates that a pose holds.

    unidentified: further parameters that are drawn, of which a calibration knows nothing but nominal values;
    sigma (C,): standard uncertainties of channels, nan where the machine's own hold.
    """

    name: str
    model: Model
    selected: tuple[str, ...]
    held: tuple[str, ...]
    sigma: Array
    unidentified: tuple[str, ...] = ()

    @property
    def index(self) -> list[int]:
        """Places of the selected parameters among all."""
        return [self.model.names.index(n) for n in self.selected]

    def problem(self, readings: Array) -> Problem:
        """What will be measured at drive readings (N, A)."""
        rows = at_rest(self.model, replace(Rows.at(readings), partner=rows_before(self.model, len(readings))))
        stated = design_problem(self.model, rows)
        sigma = np.where(np.isnan(self.sigma), stated.sigma, self.sigma)
        return usable(replace(stated, sigma=sigma, measured=~np.isnan(sigma)))

    def true_values(self, drawn: dict[str, float]) -> Array:
        """Parameter values (P,) from normal numbers by name: about nominal, standard deviation range / 2, in bounds."""
        names = (*self.selected, *self.unidentified)
        values, index = self.model.nominal, [self.model.names.index(n) for n in names]
        low, high = np.array([self.model.parameters[k].bounds for k in index]).reshape(-1, 2).T
        moved = np.array([drawn[n] for n in names]) * self.model.ranges[index] / 2
        values[index] = np.clip(values[index] + moved, low, high)
        return values


@dataclass(frozen=True, kw_only=True)
class Region:
    """A box of coordinates of the tool point (names and limits, SI), within the workspaces of the machines."""

    names: tuple[str, ...]
    low: Array
    high: Array

    def drawn(self, machines: tuple[StudiedMachine, ...], count: int, rng: np.random.Generator) -> list[Array]:
        """Drive readings (count, A) of each machine at the same random poses. Raises BadInput where few are reached."""
        readings_of: list[list[Array]] = [[] for _ in machines]
        for _ in range(_ROUNDS):
            poses = np.full((2 * count, len(DIRECTIONS)), np.nan)
            shares = rng.uniform(size=(2 * count, len(self.names)))
            poses[:, [DIRECTIONS.index(n) for n in self.names]] = self.low + shares * (self.high - self.low)
            made = [drive_positions(m.model, poses, held=m.held) for m in machines]
            inside = np.ones(len(poses), dtype=bool)
            for machine, inverse in zip(machines, made, strict=True):
                space = machine.model.workspace or Workspace.of_drives(drive_limits(machine.model.actuators))
                inside &= space.holds(inverse.poses, inverse.readings)
            for parts, inverse in zip(readings_of, made, strict=True):
                parts.append(inverse.readings[inside])
            if sum(map(len, readings_of[0])) >= count:
                return [np.concatenate(parts)[:count] for parts in readings_of]
        message = f"too few points that {' and '.join(m.name for m in machines)} reach: less than one of {2 * _ROUNDS}"
        raise BadInput.single(message, None, "make the region smaller: `--within`, or `workspace` in the machine file")


@dataclass(frozen=True, kw_only=True)
class Study:
    """Repetitions by number: each with the next one of the numbers of points, from the first on again and again.

    validation: number of other points at which the tool point is compared.
    """

    machines: tuple[StudiedMachine, ...]
    region: Region
    counts: tuple[int, ...]
    validation: int
    seed: int

    @property
    def turns(self) -> bool:
        """Whether the error of the tool point is an angle: that of machines whose tool point only turns."""
        return all(m.model.tool_motion.only_turns for m in self.machines)

    def __call__(self, number: int, observe: Observer = unobserved) -> list[Outcome]:
        """Of every machine."""
        count = self.counts[number % len(self.counts)]
        seeds = np.random.SeedSequence(self.seed, spawn_key=(number,)).spawn(3)
        places, errors, noise = (np.random.default_rng(s) for s in seeds)
        readings = self.region.drawn(self.machines, count + self.validation, places)
        names = dict.fromkeys(n for m in self.machines for n in m.selected)
        names |= dict.fromkeys(n for m in self.machines for n in m.unidentified)
        drawn = dict(zip(names, errors.normal(size=len(names)), strict=True))
        most = max(len(m.model.channels) + len(m.model.actuators) for m in self.machines)
        normal = noise.normal(size=(count, 2 * most))
        return [_once(m, q, drawn, normal, self.turns) for m, q in zip(self.machines, readings, strict=True)]

    def fits(self, result: Any) -> bool:
        """Whether this could be what a repetition returns."""
        sizes = [len(m.selected) + 1 for m in self.machines]
        return (
            isinstance(result, list)
            and len(result) == len(sizes)
            and all(each is None or _are_errors(each, size) for each, size in zip(result, sizes, strict=True))
        )


def _are_errors(errors: Any, size: int) -> bool:
    """Whether these are so many finite numbers."""
    return isinstance(errors, list) and len(errors) == size and all(type(e) is float and isfinite(e) for e in errors)


def _once(
    machine: StudiedMachine, readings: Array, drawn: dict[str, float], normal: Array, turns: bool
) -> Outcome:
    """One calibration by the first points, as many as there is noise for, judged at the others."""
    true, count = machine.true_values(drawn), len(normal)
    problem = _placed(_measured(machine.problem(readings[:count]), true, normal), machine.selected)
    try:
        more = _more_than_noise(machine, problem, true)
        fit = _fitted(problem, machine.selected, more)
    except (RowsFailed, np.linalg.LinAlgError):
        return None
    tool = _tool_turn if turns else _tool_distance
    off = tool(machine.model, (true, fit.values), readings, count, stands_anywhere(problem))
    errors = [*(float(v) for v in parameter_errors(machine.model, fit.values, true)[machine.index]), off]
    return errors if fit.usable and _explains(fit, more) and all(map(isfinite, errors)) else None


def _fitted(problem: Problem, selected: tuple[str, ...], more: float) -> Fit:
    """The fit from nominal values; what that leaves beyond all noise, `calibrate` tries to explain otherwise."""
    fit = identify(problem, selected)
    if not fit.usable or _explains(fit, more):
        return fit
    session = np.zeros(len(problem), dtype=int)
    return calibrated(problem, selected, problem.model.nominal, FitOptions(), session).robust.fit


def _more_than_noise(machine: StudiedMachine, problem: Problem, true: Array) -> float:
    """Chi-square per value, at least 1, where all is right but what is not identified: no minimum leaves more."""
    if not machine.unidentified:
        return 1.0
    values = problem.model.nominal
    values[machine.index] = true[machine.index]
    there = evaluate_condensed(problem, values, machine.selected)
    return max(1.0, condensed(problem, there).chi2 / problem.count) if there.solved else 1.0


def _explains(fit: Fit, more: float) -> bool:
    """Whether noise, which is as it is stated here, or `more` of it, may leave so much: else it is a false minimum."""
    return fit.dof <= 0 or float(chdtrc(fit.dof, fit.chi2 / more)) > _NEVER


def _measured(problem: Problem, true: Array, normal: Array) -> Problem:
    """The problem with readings at true parameters (P,), and noise from standard normal numbers (N, at least C + A)."""
    channels, drives = problem.sigma.shape[1], problem.drive_sigma.shape[1]
    moved = np.nan_to_num(problem.reading_sigma) * normal[:, channels : channels + drives]
    prediction = predict(problem.model, true, problem.moved(moved))
    noise = (np.linalg.cholesky(problem.noise) @ normal[:, :channels, None])[..., 0]
    readings = prediction.values + np.where(problem.measured, noise, 0.0)
    return usable(replace(problem, readings=readings, measured=problem.measured & np.isfinite(readings)))


def _placed(problem: Problem, selected: tuple[str, ...]) -> Problem:
    """The problem with instruments whose frames are identified roughly where the readings put them, as `calibrate`."""
    if frame_parameters(problem.model).isdisjoint(selected):
        return problem  # what is held is as it is drawn: nominal
    readings = np.where(problem.measured, problem.readings, np.nan)
    return replace(problem, model=with_frames(problem.model, problem.rows, readings))


def _tool_distance(model: Model, values: tuple[Array, Array], readings: Array, count: int, anywhere: bool) -> float:
    """Mean distance of the tool point as it is and as it was found to be, m; nan where a row has no prediction.

    values (P,): true and identified. At drive readings (N, A) but the first `count`, at which it was measured. By
    `anywhere` these show how an instrument saw the machine that may stand anywhere: the distance is that in its axes,
    as nobody knows where the base lies.
    """
    there, here = _tool_coordinates(model, values, DIRECTIONS[:3], readings)
    if anywhere and np.isfinite(here + there).all():
        rotation, shift = best_motion(here[:count], there[:count])
        here = here @ rotation.T + shift
    return float(np.sqrt(((here - there)[count:] ** 2).sum(axis=1)).mean())


def _tool_turn(model: Model, values: tuple[Array, Array], readings: Array, count: int, anywhere: bool) -> float:
    """The same of its orientation: mean angle between what it is and what it was found to be, rad."""
    vectors = _tool_coordinates(model, values, DIRECTIONS[3:], readings)
    there, here = (exp(np.pad(v, ((0, 0), (3 - v.shape[1], 0)))) for v in vectors)
    if anywhere and np.isfinite(here + there).all():
        axes = (r[:count].transpose(0, 2, 1).reshape(-1, 3) for r in (here, there))
        here = best_rotation(*axes) @ here
    left = log(here[count:] @ there[count:].transpose(0, 2, 1))
    return float(np.sqrt((left**2).sum(axis=1)).mean())


def _tool_coordinates(
    model: Model, values: tuple[Array, Array], names: tuple[str, ...], readings: Array
) -> tuple[Array, Array]:
    """Coordinates (N, c) of the tool point at either of two parameter values (P,) and drive readings (N, A)."""
    bare = tcp_model(model).with_options(())
    along = [k for k, c in enumerate(bare.channels) if c.name in names]
    rows = at_rest(model, Rows.at(readings))
    first, second = (predict(bare, each, rows).values[:, along] for each in values)
    return first, second
