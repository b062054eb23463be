"""Firmware of printers: the kinematics that it computes, and the constants with which it comes nearest to set values.

The formula of a firmware is fitted, not read off the machine file: first to the inverse kinematics of the nominal
machine, which shows whether the machine is of that kind, and with which constants; then to the corrected set values, by
the error of the tool point. What the targets do not determine stays nominal.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from pkmcal_cli.base.even_points import even_points
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.correction.commanded_machine import CommandedMachine
from pkmcal_cli.correction.export_case import ExportCase
from pkmcal_cli.model.tool_motion import DIRECTIONS
from pkmcal_cli.prediction.inverse_kinematics import drive_positions

Formula = Callable[[Array, Array], Array]
"""Set values (n, A), SI, of constants (c,) at positions (n, 3) of the tool, m."""

_SPREAD, _LEAST = 200, 20  # positions at which the nominal machine is looked at, and how many it must reach
_WIDE = 0.1  # of the machine's size: how far around the targets
_OTHER = 1e-3  # of the machine's size: a formula that misses more is that of another machine
_PRIOR = 1e-4  # what a constant that is off by its step costs, in errors of one target, m per m


FEWEST_LINES, MOST_LINES = 3, 26
"""Steppers of Klipper's winch."""
_LINES = f"{FEWEST_LINES} to {MOST_LINES} lines"
_FITTING = {
    "klipper": f"Klipper has constants of linear deltas (`kinematics: delta`) and of tools on {_LINES} (`winch`)",
    "reprapfirmware": "RepRapFirmware has constants of linear deltas and of Hangprinters",
}


def other_machines(machine: CommandedMachine, keyword: str) -> str:
    """Which machines a firmware has constants of, and what this one uses."""
    return f"{_FITTING[keyword]}; for this machine use {machine.other_forms}"


def check_without_turns(machine: CommandedMachine, keyword: str) -> None:
    """Raises BadInput where the tool point does not move by x, y, z alone."""
    if machine.turned:
        message = f"the tool point turns ({', '.join(machine.turned)}), and the firmware has no orientations"
        raise machine.refuse(keyword, message, other_machines(machine, keyword))


@dataclass(frozen=True, kw_only=True)
class Nominal:
    """The nominal machine: positions (n, 3) of its tool and set values (n, A) there, strain-free."""

    positions: Array
    readings: Array


def nominal_machine(case: ExportCase, keyword: str) -> Nominal:
    """Positions around the targets. Raises BadInput where it reaches hardly any."""
    held = case.made.aim.held
    columns = [DIRECTIONS.index(c) for c in held]
    low, high = case.poses[:, columns].min(axis=0), case.poses[:, columns].max(axis=0)
    wide = np.maximum(0.5 * (high - low), _WIDE * case.model.length)
    poses = np.tile(case.poses[:1], (_SPREAD, 1))
    poses[:, columns] = 0.5 * (low + high) + wide * (2.0 * even_points(_SPREAD, len(columns)) - 1.0)
    inverse = drive_positions(case.model, poses, None, held)
    kept = np.nonzero(inverse.reached)[0]
    if len(kept) < _LEAST:
        message = "the nominal machine reaches hardly anything around the targets"
        raise case.refuse(keyword, message, "give targets within its workspace")
    return Nominal(positions=np.nan_to_num(poses[kept, :3]), readings=inverse.readings[kept])


def recognised(case: ExportCase, keyword: str, kind: str, formula: Formula, start: Array, nominal: Nominal) -> Array:
    """Constants (c,) of the nominal machine. Raises BadInput where the formula is that of another machine."""
    gains = case.model.gains

    def missed(constants: Array) -> Array:
        return np.asarray(((formula(constants, nominal.positions) - nominal.readings) * gains).ravel())

    hint = other_machines(case.machine, keyword)
    if not np.isfinite(start).all() or not np.isfinite(missed(start)).all():
        raise case.refuse(keyword, f"this machine is no {kind}", hint)
    optimum = least_squares(missed, start, x_scale="jac", xtol=1e-15, ftol=1e-15, gtol=1e-15)
    most = float(np.abs(missed(optimum.x)).max())
    if most > _OTHER * case.model.length:
        misfit = f"this machine is no {kind}: the formula misses its drives by up to {1e3 * most:.3g} mm"
        raise case.refuse(keyword, misfit, hint)
    return np.asarray(optimum.x)


@dataclass(frozen=True)
class AimedReadings:
    """Set values (n, A), and their derivatives (n, D, p) by parameters that are known by a covariance, or None."""

    readings: Array
    slopes: Array | None


def fitted(case: ExportCase, formula: Formula, nominal: Array, steps: Array, aim: AimedReadings) -> tuple[Array, Array]:
    """Constants (c,) with which the tool point is best at the targets, their standard uncertainties, nan if unknown.

    steps (c,): sizes of the constants, by which those that the targets do not determine are held at `nominal`.
    """
    aimed = aim.readings
    weights, drives = case.weights, case.drives
    others = np.setdiff1d(np.arange(aimed.shape[1]), drives)
    gains = case.model.gains

    def errors(scaled: Array) -> Array:
        off = formula(nominal + scaled * steps, case.positions) - aimed
        weighted = np.einsum("nrd,nd->nr", weights, off[:, drives])
        return np.concatenate([weighted.ravel(), (off * gains)[:, others].ravel(), _PRIOR * scaled])

    optimum = least_squares(errors, np.zeros(len(nominal)), x_scale="jac", xtol=1e-14, ftol=1e-14, gtol=1e-14)
    return np.asarray(nominal + optimum.x * steps), steps * _std(case, np.asarray(optimum.jac), aim.slopes)


def _std(case: ExportCase, jacobian: Array, slopes: Array | None) -> Array:
    """Standard uncertainties (c,) of a fit, in its own steps: what the parameters' covariance does to its aim."""
    if slopes is None or case.covariance is None:
        return np.full(jacobian.shape[1], np.nan)
    moved = np.einsum("nrd,ndp->nrp", case.weights, slopes).reshape(-1, slopes.shape[2])
    target = np.zeros((len(jacobian), slopes.shape[2]))
    target[: len(moved)] = moved
    by_parameter = np.linalg.lstsq(jacobian, target, rcond=None)[0]
    variances = np.einsum("cp,pq,cq->c", by_parameter, case.covariance[1], by_parameter)
    return np.asarray(np.sqrt(np.maximum(variances, 0.0)))
