"""Sides from which the drives of a machine can reach a pose.

Where more drives hold their position than the mechanism has freedoms, the drives move together: their sides are those
of a motion of the TCP, not any combination.
"""

from __future__ import annotations

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.loading.load_machine import LoadedMachine
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.tool_motion import DIRECTIONS
from pkmcal_cli.prediction.inverse_kinematics import drive_positions

_SHARE = 1e-3  # of the machine's size, or rad: how far away a motion towards the pose begins


def moves_together(loaded: LoadedMachine) -> bool:
    """Whether more drives hold their position than the mechanism has freedoms."""
    held = sum(not d.force_controlled for d in loaded.model.topology.drives)
    return held > loaded.compiled.mobility.degrees_of_freedom


def sides(loaded: LoadedMachine, poses: Array, rng: np.random.Generator) -> Array:
    """Random sides of approach (N, A), -1 or 1, of every drive at TCP poses (N, 6); 0 where a drive stands still.

    Where the drives move together, those that a straight motion of the TCP in a random direction asks for.
    """
    drives = len(loaded.model.topology.drives)
    if not moves_together(loaded):
        return rng.choice([-1.0, 1.0], (len(poses), drives))
    before = poses - _SHARE * _random_directions(loaded.model, len(poses), rng)
    moved = drive_positions(loaded.model, poses).readings - drive_positions(loaded.model, before).readings
    return np.asarray(np.sign(np.nan_to_num(moved)))


def _random_directions(model: Model, count: int, rng: np.random.Generator) -> Array:
    """Directions (N, 6) of motions of the TCP in the coordinates that it moves independently, m and rad."""
    free = [DIRECTIONS.index(c) for c in model.independent_coordinates]
    drawn = rng.normal(size=(count, len(free)))
    size = np.where(np.array(free) < 3, model.length, 1.0)
    out = np.zeros((count, 6))
    out[:, free] = drawn / np.sqrt((drawn**2).sum(axis=1, keepdims=True)) * size
    return out
