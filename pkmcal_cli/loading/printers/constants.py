"""Constants that a file of a firmware states, digit by digit, with their places."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from pkmcal_cli.base.errors import Fault, FaultList, Location

_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?")
_PLAIN = re.compile(r"-?(0|[1-9]\d*)(\.\d+)?")
_LARGEST = 1e6  # mm, deg or teeth: no printer has more


@dataclass(frozen=True)
class Line:
    """A line of a configuration, and where it stands: a file may include others."""

    file: str
    number: int
    text: str

    def at(self, column: int) -> Location:
        """A place in it, from 1."""
        return Location(self.file, self.number, column)


@dataclass(frozen=True)
class Stated:
    """A value as it is written, and where."""

    text: str
    where: Location

    @property
    def plain(self) -> str:
        """The same number as YAML writes it: the same digits wherever it can be."""
        return self.text if _PLAIN.fullmatch(self.text) else repr(float(self.text))

    @property
    def value(self) -> float:
        """The number."""
        return float(self.text)


@dataclass(frozen=True, kw_only=True)
class Printer:
    """What is known of a printer: kinematics, constants by name, sha256 by file, what is to be said."""

    kinematics: str
    constants: Mapping[str, Stated]
    firmware: str
    inputs: Mapping[str, str]
    notes: tuple[str, ...] = ()


@dataclass
class ConstantReader:
    """Takes constants out of what lines state; what is wrong is collected."""

    lines: Sequence[Line]
    faults: FaultList = field(default_factory=FaultList)

    def fault(self, message: str, where: Location, hint: str | None = None, code: str = "constant") -> None:
        """Add a fault at its place."""
        source = next((n.text for n in self.lines if (n.file, n.number) == (where.file, where.line)), None)
        self.faults.add(Fault(code, message, where, hint, source))

    def number(self, stated: Stated, name: str, positive: bool = False, whole: bool = False) -> bool:
        """Whether it is a number that can be meant; a fault if not."""
        if not _NUMBER.fullmatch(stated.text):
            hint = "only plain numbers can be read; write the value itself"
            self.fault(f"`{name}` is no number: `{stated.text}`", stated.where, hint)
            return False
        if abs(stated.value) > _LARGEST or (positive and stated.value <= 0):
            self.fault(f"`{name}` cannot be {stated.text}", stated.where, "give it in mm, degrees or teeth")
            return False
        if whole and stated.value != int(stated.value):
            self.fault(f"`{name}` is a whole number, not {stated.text}", stated.where)
            return False
        return True

    def rods_reach(self, rods: Mapping[str, Stated], radius: Stated) -> None:
        """Add a fault for rods that are shorter than the radius."""
        for name, rod in rods.items():
            if rod.value <= radius.value:
                message = f"`{name}` ({rod.text}) is not longer than the radius ({radius.text})"
                self.fault(message, rod.where, "the rods lean; check which is which")
