"""Corrected set points as a program: go there, from the side that counts, wait, go on.

RS274/NGC: lengths in mm (G21), absolute (G90), G1 at a feed per minute (G94), G4 P waits in seconds. Firmware of
printers counts the P of G4 in milliseconds. Points of the tool are those which the control, with the kinematics of the
nominal machine, turns into the corrected set values; words of drives are for controls with identity kinematics.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.correction.commanded_machine import CommandedMachine, axis_letters, too_many_axes
from pkmcal_cli.correction.export_case import Draft, ExportCase, Format
from pkmcal_cli.correction.program_path import program_path
from pkmcal_cli.correction.remark_lines import remark_lines
from pkmcal_cli.correction.waypoints import Stations
from pkmcal_cli.model.tool_motion import DIRECTIONS
from pkmcal_cli.prediction.inverse_kinematics import drive_positions
from pkmcal_cli.units.unit_text import Unit, parse_unit

_NGC = (
    "https://www.nist.gov/publications/nist-rs274ngc-interpreter-version-3",
    "https://linuxcnc.org/docs/stable/html/gcode/g-code.html",
)
_PRINTERS = (
    "https://www.klipper3d.org/G-Codes.html",
    "https://docs.duet3d.com/User_manual/Reference/Gcodes",
)
_STEPS = 20
_THERE = 1e-12  # of the machine's size: set values of a point are those that are wanted
_DIGITS = {"length": 5, "angle": 6}  # decimals of mm and deg
DRIVES_KEYWORD = "gcode-drives"


@dataclass(frozen=True)
class _Words:
    """Letters of columns, whether they are lengths, and numbers (n, c), SI, as they are written."""

    letters: tuple[str, ...]
    lengths: tuple[bool, ...]
    numbers: Array

    @classmethod
    def rounded(cls, letters: Sequence[str], lengths: Sequence[bool], numbers: Array) -> _Words:
        """As the program writes them."""
        out = np.array(numbers, dtype=float)
        for k, length in enumerate(lengths):
            unit, digits = _unit(length)
            out[:, k] = [unit.to_si(round(unit.from_si(float(v)), digits)) for v in out[:, k]]
        return cls(tuple(letters), tuple(lengths), out)

    def lines(self) -> list[str]:
        """The words of every row."""
        out = []
        for row in self.numbers:
            words = []
            for letter, length, value in zip(self.letters, self.lengths, row, strict=True):
                unit, digits = _unit(length)
                words.append(f"{letter}{unit.from_si(float(value)):.{digits}f}")
            out.append(" ".join(words))
        return out


def _unit(length: bool) -> tuple[Unit, int]:
    kind = "length" if length else "angle"
    return parse_unit("mm" if length else "deg"), _DIGITS[kind]


def _check_points(machine: CommandedMachine, keyword: str) -> None:
    """Raises BadInput where set points of the tool do not say where the drives are."""
    held, drives, hint = machine.held, len(machine.drives), f"use {machine.other_forms}"
    if machine.turned and machine.loaded.machine.space == "spatial":
        message = f"words for orientations ({', '.join(machine.turned)}) differ between controls"
        raise machine.refuse(keyword, message, hint)
    if len(held) != drives:
        message = f"no tool point corresponds to set values of {drives} drives ({len(held)} coordinates)"
        raise machine.refuse(keyword, message, hint)


def _check_axes(machine: CommandedMachine, keyword: str) -> None:
    """Raises BadInput where there are more drives than words."""
    if message := too_many_axes(machine.lengths):
        raise machine.refuse(keyword, message, f"use {machine.other_forms}")


def _points(case: ExportCase, keyword: str, path: Stations) -> tuple[_Words, Array]:
    """Points of the tool, and set values (m, A) that the control makes of them."""
    held = case.made.aim.held
    poses = _moved_points(case, keyword, path)
    columns = [DIRECTIONS.index(c) for c in held]
    letters = ["C" if c == "rz" else c.upper() for c in held]
    words = _Words.rounded(letters, [c in "xyz" for c in held], poses[:, columns])
    poses[:, columns] = words.numbers
    return words, drive_positions(case.model, poses, None, held).readings


def _moved_points(case: ExportCase, keyword: str, path: Stations) -> Array:
    """Poses (m, 6) at which the nominal machine has the set values of a path: Newton's method."""
    held, drives = case.made.aim.held, case.drives
    columns = [DIRECTIONS.index(c) for c in held]
    size = np.where([c in "xyz" for c in held], case.model.length, 1.0)
    poses = path.poses.copy()
    for _ in range(_STEPS):
        inverse = drive_positions(case.model, poses, None, held, derivatives=True)
        assert inverse.by_pose is not None
        if not inverse.reached.all():
            break
        off = (path.set_values - inverse.readings)[:, drives, None]
        step = np.linalg.solve(inverse.by_pose[:, drives], off)[..., 0]
        poses[:, columns] += step
        if (np.abs(step) < _THERE * size).all():
            return poses
    raise case.refuse(keyword, "the nominal machine cannot reach the corrected set values", "correct fewer targets")


def _drive_words(case: ExportCase, _: str, path: Stations) -> tuple[_Words, Array]:
    """Words of drives in the order of the machine file."""
    lengths = case.machine.lengths
    words = _Words.rounded(axis_letters(lengths), lengths, path.set_values[:, case.drives])
    commands = path.set_values.copy()
    commands[:, case.drives] = words.numbers
    return words, commands


def _program(
    keyword: str, words: Callable[[ExportCase, str, Stations], tuple[_Words, Array]], comment: str, seconds: bool
) -> Callable[[ExportCase], Draft]:
    """A draft of one dialect; comment: how remarks begin."""

    def draft(case: ExportCase) -> Draft:
        path = program_path(case, straight_tool=keyword != DRIVES_KEYWORD)
        rows, commands = words(case, keyword, path.stations)
        wait = f"G4 P{case.dwell:g}" if seconds else f"G4 P{1e3 * case.dwell:.0f}"
        waits = [wait] if seconds else ["M400", wait]  # printers: after all motion has ended

        def texts(remarks: Sequence[str]) -> Mapping[str, str]:
            lines = remark_lines(comment, (*_header(case, keyword, rows), *remarks))
            lines += ["G21", "G90", *(["G94"] if seconds else [])]
            moves = [f"G1 {row} F{case.feed:g}" for row in rows.lines()]
            for name, first, last in zip(case.names, (0, *(path.targets + 1)), path.targets, strict=False):
                lines += [*remark_lines(comment, [f"target {name}"]), *moves[first : last + 1], *waits]
            return {"": "\n".join([*lines, *(["M2"] if seconds else []), ""])}

        return Draft(commands=commands[path.targets], values=case.values, texts=texts, notes=path.notes)

    return draft


def _header(case: ExportCase, keyword: str, rows: _Words) -> list[str]:
    if keyword != DRIVES_KEYWORD:
        return ["points of the tool; the control has the kinematics of the nominal machine"]
    words = (f"{letter} = {case.name(a)}" for letter, a in zip(rows.letters, case.drives, strict=True))
    return [f"set values of drives, identity kinematics: {', '.join(words)}; mm, deg"]


GCODE = Format(
    keyword="gcode", title="corrected set points of the tool, RS274/NGC", sources=_NGC, suffix=".ngc",
    draft=_program("gcode", _points, ";", seconds=True), check=partial(_check_points, keyword="gcode"),
)  # fmt: skip
DRIVES = Format(
    keyword=DRIVES_KEYWORD, title="corrected set values of the drives, RS274/NGC", sources=_NGC, suffix=".ngc",
    draft=_program(DRIVES_KEYWORD, _drive_words, ";", seconds=True),
    check=partial(_check_axes, keyword=DRIVES_KEYWORD),
)  # fmt: skip
PRINTER = Format(
    keyword="gcode-printer", title="corrected set points of the tool, firmware of printers", sources=_PRINTERS,
    suffix=".gcode", draft=_program("gcode-printer", _points, ";", seconds=False),
    check=partial(_check_points, keyword="gcode-printer"),
)  # fmt: skip
