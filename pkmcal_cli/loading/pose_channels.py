"""Which channels are read at poses: those of a table, and those of probes that touch there."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.errors import UsageError
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.model.model import Model
from pkmcal_cli.tables.measurement_set import Measurements
from pkmcal_cli.tables.touches import implied_touches, unclear_touches

Channels = NDArray[np.bool_]
"""Of rows and channels of the model (N, C)."""


def table_channels(model: Model, block: Measurements) -> tuple[Channels | None, Channels]:
    """What a table of drive readings has readings of, None where it has none; where probes of known reading touch."""
    read = np.zeros((len(block), len(model.channels)), dtype=bool)
    for k, channel in enumerate(model.channels):
        if channel.name in block.channels:
            read[:, k] = block.measured[:, block.channels.index(channel.name)]
    known = known_channels(model)
    measured = bool(read[:, ~known].any()) and block.has_actuators
    return read if measured else None, read & known


def known_channels(model: Model) -> Channels:
    """Channels (C,) whose reading is known wherever they touch."""
    return np.array([not math.isnan(c.known) for c in model.channels], dtype=bool)


def together(parts: Sequence[NDArray[Any] | None]) -> NDArray[Any] | None:
    """Parts (n, ...) as one; None where one is missing."""
    known = [part for part in parts if part is not None]
    return np.concatenate(known) if len(known) == len(parts) else None


def touched_channels(model: Model, machine: Machine, rows: int, stated: Channels | None) -> Channels:
    """Where probes of known reading touch (N, C): as a table states it, else at every pose of a grid.

    At those of a grid only if no other instrument of the machine sees the tool. Raises UsageError where it is open
    which of several probes touches.
    """
    known = known_channels(model)
    if stated is not None or not known.any():
        return np.zeros((rows, len(known)), dtype=bool) if stated is None else stated
    touches = implied_touches(machine, (), measured=False)
    if touches.unclear:
        message, hint = unclear_touches(touches.unclear)
        raise UsageError(f"--grid: {message}", hint=f"give a table of poses; {hint}")
    return np.tile(known & bool(touches.readings), (rows, 1))


def planned_channels(model: Model, measured: Channels | None, touched: Channels | None) -> Channels | None:
    """Which channels (N, C) will be measured: those of a table, of probes where they touch; None for all."""
    known = known_channels(model)
    if touched is None or not known.any():
        return measured
    return np.where(known, touched, True if measured is None else measured)
