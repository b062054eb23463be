"""Linear deltas as the firmware of printers computes them: three vertical towers, a rod from each carriage to the tool.

Height of a carriage (Klipper, `delta.py`; RepRapFirmware, `LinearDeltaKinematics.cpp`):

    s = sqrt(L^2 - (x - X)^2 - (y - Y)^2) + z + a x + b y,  X = R cos(w), Y = R sin(w)

with the length L of the rod, the radius R and the angle w of the tower, and the bed's tilt a, b (RepRapFirmware only).
The switch at its top is at s = E + sqrt(L^2 - R^2): E is the height of the tool above the bed's centre there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.correction.commanded_machine import CommandedMachine
from pkmcal_cli.correction.export_case import ExportCase
from pkmcal_cli.correction.firmware import (
    AimedReadings,
    Nominal,
    check_without_turns,
    fitted,
    nominal_machine,
    other_machines,
    recognised,
)

TOWERS = 3


@dataclass(frozen=True, kw_only=True)
class DeltaConstants:
    """Constants, m and deg: radius; angles, rods and heights of switches by tower; tilt of the bed in x and y."""

    radius: float
    angles: Array
    rods: Array
    stops: Array
    tilt: Array

    @classmethod
    def of(cls, numbers: Array) -> DeltaConstants:
        """From one array: radius, angles, rods, stops, tilt (which may be missing)."""
        tilt = numbers[10:] if len(numbers) > 10 else np.zeros(2)
        return cls(radius=float(numbers[0]), angles=numbers[1:4], rods=numbers[4:7], stops=numbers[7:10], tilt=tilt)

    def heights(self, positions: Array) -> Array:
        """Heights (n, 3) of the carriages at positions (n, 3) of the tool; nan out of reach."""
        x, y, z = (positions[:, k, None] for k in range(3))
        azimuth = np.radians(self.angles)
        across = (x - self.radius * np.cos(azimuth)) ** 2 + (y - self.radius * np.sin(azimuth)) ** 2
        with np.errstate(invalid="ignore"):
            return np.asarray(np.sqrt(self.rods**2 - across) + z + x * self.tilt[0] + y * self.tilt[1])

    def switches(self) -> Array:
        """Heights (3,) of the carriages at their switches."""
        return np.asarray(self.stops + np.sqrt(self.rods**2 - self.radius**2))


@dataclass(frozen=True, kw_only=True)
class Towers:
    """Drives of the three towers: readings (3,) at their switches, signs (3,) of readings upward."""

    ends: Array
    signs: Array

    def readings(self, constants: DeltaConstants, positions: Array) -> Array:
        """Readings (n, 3): a carriage is counted from its switch."""
        return np.asarray(self.ends + self.signs * (constants.heights(positions) - constants.switches()))


@dataclass(frozen=True, kw_only=True)
class FittedDelta:
    """Drives, the best constants, and their standard uncertainties, nan where unknown."""

    towers: Towers
    constants: DeltaConstants
    u: DeltaConstants


def check_delta(machine: CommandedMachine, keyword: str) -> None:
    """Raises BadInput where the machine has other drives than a linear delta."""
    if machine.count != TOWERS or len(machine.drives) != TOWERS:
        message = f"this machine is no linear delta of {TOWERS} towers"
        raise machine.refuse(keyword, message, other_machines(machine, keyword))
    check_without_turns(machine, keyword)


def fitted_delta(case: ExportCase, keyword: str, tilted: bool) -> FittedDelta:
    """A delta for a firmware. Raises BadInput where the machine is no linear delta, or its switches are unknown."""
    nominal = nominal_machine(case, keyword)
    signs, start = _start(nominal, tilted)
    ends = _ends(case, signs)
    towers = Towers(ends=np.where(np.isfinite(ends), ends, 0.0), signs=signs)
    start[7:10] += signs * towers.ends - np.sqrt(np.maximum(start[4:7] ** 2 - start[0] ** 2, 0.0))

    def formula(numbers: Array, positions: Array) -> Array:
        return towers.readings(DeltaConstants.of(numbers), positions)

    constants = recognised(case, keyword, "linear delta", formula, start, nominal)
    _check_switches(case, keyword, ends)  # of a machine that is none, they would not help
    steps = np.array([1.0, *[np.degrees(1.0 / constants[0])] * 3, *[1.0] * 6, *[1.0] * (len(constants) - 10)])
    best, u = fitted(case, formula, constants, steps, AimedReadings(case.corrected, case.own_slopes))
    return FittedDelta(towers=towers, constants=DeltaConstants.of(best), u=DeltaConstants.of(u))


def _start(nominal: Nominal, tilted: bool) -> tuple[Array, Array]:
    """Signs, and constants with heights at reading 0 in place of the stops: each tower by linear least squares.

    With the height h = sign q + k of a carriage, (h - z)^2 + (x - X)^2 + (y - Y)^2 = L^2 is linear in k, X, Y and a
    constant.
    """
    x, y, z = nominal.positions.T
    towers = [_tower(x, y, z, nominal.readings[:, t]) for t in range(TOWERS)]
    signs = np.array([t[0] for t in towers])
    places = np.array([t[1] for t in towers])
    angles = np.degrees(np.arctan2(places[:, 1], places[:, 0])) % 360.0
    rods, zero = np.array([t[2] for t in towers]), np.array([t[3] for t in towers])
    radius = float(np.hypot(places[:, 0], places[:, 1]).mean())
    return signs, np.array([radius, *angles, *rods, *zero, *([0.0, 0.0] if tilted else [])])


def _tower(x: Array, y: Array, z: Array, reading: Array) -> tuple[float, Array, float, float]:
    """Sign, place (2,), length of the rod, height at reading 0 of one tower; the sign that fits better."""
    candidates = []
    for sign in (1.0, -1.0):
        v = sign * reading - z
        design = np.stack([-2.0 * v, 2.0 * x, 2.0 * y, np.ones_like(v)], axis=1)
        solution = np.linalg.lstsq(design, v**2 + x**2 + y**2, rcond=None)[0]
        missed = float(np.abs(design @ solution - v**2 - x**2 - y**2).max())
        k, *centre, constant = (float(s) for s in solution)
        square = constant + k**2 + centre[0] ** 2 + centre[1] ** 2
        candidates.append((missed, sign, np.array(centre), float(np.sqrt(square)) if square > 0 else np.nan, k))
    return min(candidates, key=lambda each: each[0])[1:]


def _ends(case: ExportCase, signs: Array) -> Array:
    """Readings of the drives at their switches, at the top: limits of travel; infinite where none is stated."""
    limits = [case.model.actuators[a].limits for a in case.drives]
    return np.array([high if sign > 0 else low for (low, high), sign in zip(limits, signs, strict=True)])


def _check_switches(case: ExportCase, keyword: str, ends: Array) -> None:
    unknown = [case.name(int(a)) for a, end in zip(case.drives, ends, strict=True) if not np.isfinite(end)]
    if unknown:
        hint = "add `limits: [low, high]` to the drive; its upper end is the reading at the switch"
        raise case.refuse(keyword, f"where the switch of `{unknown[0]}` is, the machine file does not say", hint)
