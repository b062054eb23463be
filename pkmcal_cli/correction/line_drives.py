"""Machines of lines as the firmware of printers computes them: a line from an anchor to the tool for each motor.

The way of a line from where the machine was homed, with the tool at x = y = z = 0 (Klipper, `kin_winch.c`;
RepRapFirmware, `HangprinterKinematics.cpp`, without compensation of flex), is |p - A| - |A|. Klipper's motor turns by
it over `rotation_distance`. On a spool of RepRapFirmware (radius R at the origin, U strands, O lines on the spool, gear
H : L, build-up Q) the motor turns by

    (U H / L) (2 / k) (sqrt(R^2 + k (|p - A| - |A|)) - R),  k = -U O Q.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.correction.commands import corrected
from pkmcal_cli.correction.export_case import ExportCase
from pkmcal_cli.correction.firmware import AimedReadings, Formula, Nominal, fitted, nominal_machine, recognised
from pkmcal_cli.correction.set_values import Aim
from pkmcal_cli.prediction.inverse_kinematics import drive_positions

HOMED = "holds for a machine that is homed with its tool at x = y = z = 0"


@dataclass(frozen=True, kw_only=True)
class LineMotors:
    """How the motors of a firmware turn lines into readings.

    readings: (n, A), SI, counted from home, of ways (n, A) and further constants (e,); start: these constants of
    gains (A,); steps (e,): their sizes.
    """

    readings: Callable[[Array, Array], Array]
    start: Callable[[Array], Array]
    steps: Callable[[Array], Array]


@dataclass(frozen=True, kw_only=True)
class LineConstants:
    """Anchors (A, 3), m, further constants (e,), readings at home (A,); u: standard uncertainties of both, or nan."""

    anchors: Array
    more: Array
    home: Array
    u_anchors: Array
    u_more: Array

    def readings(self, motors: LineMotors, positions: Array) -> Array:
        """Readings (n, A) that the firmware commands."""
        return np.asarray(self.home + motors.readings(ways(self.anchors, positions), self.more))


def ways(anchors: Array, positions: Array) -> Array:
    """Ways (n, A) of lines to anchors (A, 3), from the origin to positions (n, 3)."""
    lengths = np.linalg.norm(positions[:, None] - anchors, axis=2)
    return np.asarray(lengths - np.linalg.norm(anchors, axis=1))


def line_constants(case: ExportCase, keyword: str, motors: LineMotors) -> LineConstants:
    """The best constants. Raises BadInput where the machine does not hang on a line from every motor."""
    count = len(case.model.actuators)
    nominal, at_origin = nominal_machine(case, keyword), _at_origin(case, keyword, None)
    anchors, gains = _start(nominal, at_origin)

    def formula_from(home: Array) -> Formula:
        def formula(numbers: Array, positions: Array) -> Array:
            places = numbers[: 3 * count].reshape(count, 3)
            return np.asarray(home + motors.readings(ways(places, positions), numbers[3 * count :]))

        return formula

    start = np.concatenate([anchors.ravel(), motors.start(gains)])
    constants = recognised(case, keyword, "machine of lines from anchors", formula_from(at_origin), start, nominal)
    home, home_slopes = _home(case, keyword)
    slopes = case.own_slopes
    if slopes is not None:
        slopes = slopes - (0.0 if home_slopes is None else home_slopes)
    aim = AimedReadings(_all_corrected(case), slopes)
    steps = np.concatenate([np.ones(3 * count), motors.steps(constants[3 * count :])])
    best, u = fitted(case, formula_from(home), constants, steps, aim)
    (anchors, more), (u_anchors, u_more) = ((c[: 3 * count].reshape(count, 3), c[3 * count :]) for c in (best, u))
    u_anchors[np.setdiff1d(np.arange(count), case.drives)] = np.nan  # of a drive without set values nobody knows
    return LineConstants(anchors=anchors, more=more, home=home, u_anchors=u_anchors, u_more=u_more)


def line_gains(case: ExportCase, keyword: str) -> Array:
    """Ways of the lines per reading (A,) of the nominal machine, with sign."""
    return _start(nominal_machine(case, keyword), _at_origin(case, keyword, None))[1]


def _at_origin(case: ExportCase, keyword: str, values: Array | None) -> Array:
    """Readings (A,) of the unstrained machine with its tool at x = y = z = 0. Raises BadInput out of reach."""
    inverse = drive_positions(case.model, _origin(case), values, case.made.aim.held)
    if not inverse.reached.all():
        message = "the tool cannot reach x = y = z = 0, where the firmware is homed"
        raise case.refuse(keyword, message, "shift the coordinates of the machine file")
    return np.asarray(inverse.readings[0])


def _origin(case: ExportCase) -> Array:
    pose = case.model.tool.reference.copy()[None]
    pose[0, :3] = 0.0
    return np.asarray(pose)


def _home(case: ExportCase, keyword: str) -> tuple[Array, Array | None]:
    """Readings (A,) of the machine homed there, those that bring the tool there, if any do; their slopes (1, D, p)."""
    out = _at_origin(case, keyword, case.values).copy()
    rows = replace(case.rows.take(np.zeros(1, dtype=np.intp)), readings=np.full((1, len(out)), np.nan))
    aim = Aim(poses=_origin(case), held=case.made.aim.held, rows=rows)
    there = corrected(case.model, case.values, aim, case.choice)
    if there is None or not len(there.good):
        return out, None
    out[case.drives] = there.rows.readings[0, case.drives]
    return out, case.slopes(there.rows, aim.targets)


def _all_corrected(case: ExportCase) -> Array:
    """Corrected set values (n, A); of drives that hold no position, the readings of the unstrained machine."""
    out = case.corrected.copy()
    uncorrected = drive_positions(case.model, case.poses, case.values, case.made.aim.held)
    others = np.setdiff1d(np.arange(out.shape[1]), case.drives)
    out[:, others] = uncorrected.readings[:, others]
    return out


def _start(nominal: Nominal, home: Array) -> tuple[Array, Array]:
    """Anchors (A, 3) and gains (A,) of the nominal machine, each line by linear least squares.

    (g q + d)^2 = |p - A|^2 with the reading q from home and d = |A| is linear in g^2, g d, A and a constant.
    """
    p, anchors, gains = nominal.positions, [], []
    for reading, at_home in zip(nominal.readings.T, home, strict=True):
        q = reading - at_home
        size = max(float(np.abs(q).max()), 1e-12)
        design = np.column_stack([2.0 * p, -((q / size) ** 2), -q / size, np.ones_like(q)])
        solution = np.linalg.lstsq(design, (p**2).sum(axis=1), rcond=None)[0]
        anchors.append(solution[:3])
        gains.append(-np.sign(solution[4]) * np.sqrt(max(-solution[3], 0.0)) / size)
    return np.array(anchors), np.array(gains)
