"""printer.cfg of Klipper: `kinematics: delta` or `winch`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.correction.commanded_machine import CommandedMachine
from pkmcal_cli.correction.export_case import Draft, ExportCase, Format
from pkmcal_cli.correction.firmware import FEWEST_LINES, MOST_LINES, check_without_turns, other_machines
from pkmcal_cli.correction.line_drives import HOMED, LineMotors, line_constants, line_gains
from pkmcal_cli.correction.linear_delta import TOWERS, DeltaConstants, check_delta, fitted_delta
from pkmcal_cli.loading.load_machine import LoadedMachine

_DIGITS = 6  # of mm and deg, as Klipper saves them
_MM = 1e-3
_LEAST = 1e-6  # mm or deg: less is rounding
_KEYWORD = "klipper"


def _rounded(values: Array, unit: float = 1.0) -> Array:
    return np.asarray(np.round(np.asarray(values) / unit, _DIGITS) * unit)


def _mm(value: float) -> str:
    return f"{value / _MM:.{_DIGITS}f}"


def _sure(u: float, unit: str = "mm") -> str:
    """A remark on how sure a constant is."""
    return "" if np.isnan(u) else f"  # u {u if u > _LEAST else 0:.2g} {unit}"


def _delta(case: ExportCase) -> Draft:
    fit = fitted_delta(case, _KEYWORD, tilted=False)
    constants, u = fit.constants, fit.u
    made = DeltaConstants(
        radius=float(_rounded(np.array(constants.radius), _MM)), angles=_rounded(constants.angles % 360.0),
        rods=_rounded(constants.rods, _MM), stops=_rounded(constants.stops, _MM), tilt=constants.tilt,
    )  # fmt: skip

    def texts(remarks: Sequence[str]) -> Mapping[str, str]:
        lines = [*(f"# {line}" for line in remarks), "[printer]", "kinematics: delta"]
        lines += [f"delta_radius: {_mm(made.radius)}{_sure(u.radius / _MM)}"]
        for t in range(TOWERS):
            lines += ["", f"[stepper_{'abc'[t]}]", f"# drive {case.name(t)}"]
            lines.append(f"position_endstop: {_mm(made.stops[t])}{_sure(u.stops[t] / _MM)}")
            lines.append(f"arm_length: {_mm(made.rods[t])}{_sure(u.rods[t] / _MM)}")
            lines.append(f"angle: {made.angles[t]:.{_DIGITS}f}{_sure(u.angles[t], 'deg')}")
        return {"": "\n".join([*lines, ""])}

    return Draft(commands=fit.towers.readings(made, case.positions), values=case.values, texts=texts)


def _motors(case: ExportCase) -> LineMotors:
    """Steppers: of a spool the line per turn is a constant, of a line it is set already."""
    spools = np.array([a.dimension == "angle" for a in case.model.actuators])
    gains = line_gains(case, _KEYWORD)

    def per_reading(more: Array) -> Array:
        out = gains.copy()
        out[spools] = more
        return out

    return LineMotors(
        readings=lambda ways, more: ways / per_reading(more),
        start=lambda start: start[spools],
        steps=lambda more: np.abs(more) / case.model.length,
    )


def _winch(case: ExportCase) -> Draft:
    count = len(case.model.actuators)
    motors = _motors(case)
    constants = line_constants(case, _KEYWORD, motors)
    full_turn = 2.0 * np.pi
    more = _rounded(constants.more * full_turn, _MM) / full_turn
    made = replace(constants, anchors=_rounded(constants.anchors, _MM), more=more)
    spools = [a for a in range(count) if case.model.actuators[a].dimension == "angle"]
    u_gains = np.where(np.isfinite(made.u_anchors[spools, 0]), made.u_more, np.nan)
    per_turn = {a: (full_turn * abs(g), full_turn * u) for a, g, u in zip(spools, made.more, u_gains, strict=True)}

    def texts(remarks: Sequence[str]) -> Mapping[str, str]:
        lines = [*(f"# {line}" for line in remarks), "[printer]", "kinematics: winch"]
        for a in range(count):
            lines += ["", f"[stepper_{chr(ord('a') + a)}]", f"# drive {case.name(a)}"]
            if a in per_turn:
                value, u = per_turn[a]
                lines += [f"rotation_distance: {_mm(value)}{_sure(u / _MM)}", "# of the drive, without `gear_ratio`"]
            for k, c in enumerate("xyz"):
                lines.append(f"anchor_{c}: {_mm(made.anchors[a, k])}{_sure(made.u_anchors[a, k] / _MM)}")
        return {"": "\n".join([*lines, ""])}

    return Draft(commands=made.readings(motors, case.positions), values=case.values, texts=texts, notes=(HOMED,))


def _has_lines(loaded: LoadedMachine) -> bool:
    """Whether drives change lengths, as a winch does; else carriages move."""
    return any(a.winds is not None or a.drives is not None for a in loaded.machine.actuators.values())


def _check(machine: CommandedMachine) -> None:
    if not _has_lines(machine.loaded):
        check_delta(machine, _KEYWORD)
        return
    if not FEWEST_LINES <= machine.count <= MOST_LINES:
        steppers = f"{FEWEST_LINES} to {MOST_LINES} steppers"
        message = f"Klipper's winch has {steppers}, this machine {machine.count} drives"
        raise machine.refuse(_KEYWORD, message, other_machines(machine, _KEYWORD))
    check_without_turns(machine, _KEYWORD)


def _draft(case: ExportCase) -> Draft:
    return _winch(case) if _has_lines(case.loaded) else _delta(case)


KLIPPER = Format(
    keyword=_KEYWORD,
    title="constants of Klipper's printer.cfg",
    sources=(
        "https://www.klipper3d.org/Config_Reference.html",
        "https://github.com/Klipper3d/klipper/blob/master/klippy/kinematics/delta.py",
        "https://github.com/Klipper3d/klipper/blob/master/klippy/kinematics/winch.py",
    ),
    suffix=".cfg",
    draft=_draft,
    check=_check,
)
