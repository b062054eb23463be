"""A machine that a control is to move, before anything is corrected: what its file and the coordinates say of forms."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pkmcal_cli.base.errors import BadInput, Location
from pkmcal_cli.correction.strained_pose import held_drives
from pkmcal_cli.loading.load_machine import LoadedMachine
from pkmcal_cli.mechanism.topology import Index
from pkmcal_cli.model.tool_motion import DIRECTIONS

LINEAR, ROTARY = "XYZUVW", "ABC"
"""Words of axes in RS274/NGC."""
_TABLES = "tables of single drives (`--as linuxcnc`, `beckhoff` or `csv`), or corrected set values, without `--as`"


@dataclass(frozen=True)
class CommandedMachine:
    """The machine and the coordinates that targets hold."""

    loaded: LoadedMachine
    held: tuple[str, ...]

    @property
    def drives(self) -> Index:
        """Drives that a control commands."""
        return held_drives(self.loaded.model)

    @property
    def count(self) -> int:
        """All drives, those that hold no position included."""
        return len(self.loaded.model.actuators)

    @property
    def lengths(self) -> tuple[bool, ...]:
        """Whether the drives that a control commands are counted in lengths, else in angles."""
        return tuple(self.loaded.model.actuators[a].dimension != "angle" for a in self.drives)

    @property
    def turned(self) -> tuple[str, ...]:
        """Coordinates held that are angles."""
        return tuple(c for c in self.held if c in DIRECTIONS[3:])

    @property
    def other_forms(self) -> str:
        """Forms that hold any such machine, as a hint tells them."""
        return _TABLES if too_many_axes(self.lengths) else f"`--as gcode-drives`, {_TABLES}"

    def refuse(self, keyword: str, message: str, hint: str) -> BadInput:
        """The error of a form that cannot hold this machine."""
        return BadInput.single(f"--as {keyword}: {message}", Location(self.loaded.model.name), hint, "format")


def axis_letters(lengths: Sequence[bool]) -> tuple[str, ...]:
    """Words of drives in their order, "" where there are too many; lengths: whether each is linear."""
    free = {True: iter(LINEAR), False: iter(ROTARY)}
    return tuple(next(free[length], "") for length in lengths)


def too_many_axes(lengths: Sequence[bool]) -> str:
    """Which drives have no words, "" where all have."""
    for length, kind, letters in ((True, "linear", LINEAR), (False, "rotary", ROTARY)):
        drives = sum(each == length for each in lengths)
        if drives > len(letters):
            return f"{drives} {kind} drives, but G-code has {len(letters)} words for {kind} axes ({' '.join(letters)})"
    return ""
