"""Coordinates of the tool point that set values do not hold: how far the identified machine is off there, corrected.

The nominal machine at its own set values says where they should be.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.correction.commands import Correction
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.tool_channels import tcp_model
from pkmcal_cli.prediction import Request, predict

_NOTHING = 1e-9  # m, rad: what solving leaves


@dataclass(frozen=True)
class FreeCoordinate:
    """A coordinate: rms and largest size of its error over the targets, m or rad."""

    name: str
    rms: float
    largest: float


def free_coordinates(model: Model, values: Array, made: Correction) -> tuple[FreeCoordinate, ...]:
    """Those that are off, of targets that have set values and that the nominal machine reaches."""
    tool = tcp_model(model)
    free = [k for k, c in enumerate(tool.channels) if c.name not in made.aim.held]
    rows = made.good[np.isfinite(made.aim.rows.readings[made.good]).any(axis=1)]
    if not free or not len(rows):
        return ()
    should = predict(tool, model.nominal, made.aim.rows.take(rows), Request())
    becomes = predict(tool, values, made.rows.take(rows), Request(), made.after.prediction.start.take(rows))
    both = should.solved & becomes.solved
    off = (becomes.values - should.values)[both][:, free]
    turned = np.array([tool.channels[k].dimension == "angle" for k in free]) & (np.abs(off) > np.pi)
    off = np.where(turned, off - 2 * np.pi * np.sign(off), off)
    out = []
    for name, error in zip([tool.channels[k].name for k in free], np.abs(off).T, strict=True):
        if len(error) and error.max() > _NOTHING:
            out.append(FreeCoordinate(name, float(np.sqrt(np.mean(error**2))), float(error.max())))
    return tuple(out)
