"""Whether targets look as if they were written in another unit than their header says."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pkmcal_cli.base.plural import count
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.correction.commands import corrected
from pkmcal_cli.correction.redundancy import Choice
from pkmcal_cli.correction.set_values import Aim
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.loading.targets import Targets
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.tool_motion import DIRECTIONS
from pkmcal_cli.units.unit_text import parse_unit

_LENGTHS, _TRIED = ("m", "mm", "um", "in"), 50  # units that are mixed up; targets that are tried in them
_CROWDED = 0.01  # sizes of the machine: targets that lie no wider apart
_ABOUT = 0.1  # of the machine's size: a target that lies about the reference configuration
_NEARER = 0.3  # of their distance from the reference configuration, at which they would lie in another unit


def in_another_unit(
    machine: Machine, model: Model, values: Array, targets: Targets, lost: Choice | None
) -> Iterator[str]:
    """What is told of units; values (P,); lost: how redundant drives are set, where no target is within reach."""
    if lost is not None:
        return _within_reach(machine, model, values, targets, lost)
    return _crowded(machine, model, targets)


def _within_reach(machine: Machine, model: Model, values: Array, targets: Targets, choice: Choice) -> Iterator[str]:
    """Where no target is within reach: by which factor between units the first of them would be.

    Not nearer to the reference configuration than a target that lies about it: that one fails by something else.
    """
    scaled = _scaled(targets)
    few = np.arange(min(len(targets), _TRIED))
    where = np.nonzero(np.array(scaled))[0]
    away = np.abs(targets.poses[:, where] - model.tool.reference[where]).max(axis=1, initial=0.0)
    about = bool((away < _ABOUT * model.length).any())
    for factor in (f for f in _factors(machine) if f > 1.0 or not about):
        poses = targets.poses * np.where(scaled, factor, 1.0)
        made = corrected(model, values, Aim(poses=poses, held=targets.held, rows=targets.rows).take(few), choice)
        if made is not None and len(made.good):
            reached = f"{len(made.good)} of {count(len(few), 'target')} would be within reach"
            yield f"warning: {factor:.6g} times as large, {reached}: check the units of lengths in the header"


def _crowded(machine: Machine, model: Model, targets: Targets) -> Iterator[str]:
    """Where all targets crowd far from the reference configuration: by which factor they would lie about it."""
    where = np.nonzero(np.array(_scaled(targets)))[0]
    places, home = targets.poses[:, where], model.tool.reference[where]
    away = float(np.abs(places - home).max(initial=0.0))
    if not len(where) or np.ptp(places, axis=0).max(initial=0.0) > _CROWDED * model.length:
        return
    for factor in _factors(machine):
        if np.abs(factor * places - home).max() < _NEARER * away:
            near = "the targets would lie about the reference configuration"
            yield f"warning: {factor:.6g} times as large, {near}: check the units of lengths in the header"


def _scaled(targets: Targets) -> list[bool]:
    """Coordinates (6,) that were given as lengths; others stand at the reference."""
    return [c in targets.coordinates and c in DIRECTIONS[:3] for c in DIRECTIONS]


def _factors(machine: Machine) -> list[float]:
    """Between units that are mixed up and that of the file."""
    assumed = machine.file_units.length
    return [parse_unit(text).scale / assumed.scale for text in _LENGTHS if text != assumed.text]
