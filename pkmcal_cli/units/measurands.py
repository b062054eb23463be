"""What readings measure: the one table of measurands (VIM 2.3), and what follows for a reading of each."""

from __future__ import annotations

from enum import Enum

from pkmcal_cli.units.dimensions import ANGLE, FORCE, LENGTH, NUMBER, Dimension


class Measurand(Enum):
    """Kind of quantity that a channel measures.

    `dimension`: of what is measured, None where the machine file says it. `of_pose`: coordinates of a point or of a
    body, several of which make up one error. `of_drive`: whether a drive has it. `once`: it is measured on the bench,
    not in every row. `periodic`: full turns cannot be told apart.
    """

    POSITION = ("position", LENGTH, {"of_pose"})
    ORIENTATION = ("orientation", ANGLE, {"of_pose"})
    DISTANCE = ("distance", LENGTH, set[str]())
    ANGLE = ("angle", ANGLE, {"periodic"})
    DRIVE = ("drive", None, {"of_drive"})  # reading of a drive that does not hold its position
    FORCE = ("force", FORCE, {"of_drive"})
    TENSION = ("tension", FORCE, set[str]())  # of a rope; no sensor reads it
    ENERGY = ("energy", NUMBER, set[str]())  # of all strained members; no sensor reads it
    BENCH = ("bench", None, {"once"})

    def __init__(self, label: str, dimension: Dimension | None, traits: set[str]) -> None:
        self.label = label
        self.dimension = dimension
        self.of_pose = "of_pose" in traits
        self.of_drive = "of_drive" in traits
        self.once = "once" in traits
        self.periodic = "periodic" in traits
