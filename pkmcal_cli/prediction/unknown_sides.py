"""Rows of which nobody knows from which side a drive came: there its reversal error is an uncertainty of its position.

Such is the first row of a session. Either side is as likely, so a reversal of +-b/2 is a standard uncertainty of b/2 of
the drive's travel in that row, and of no other; friction of +-f one of f of the force of a force-controlled drive.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.model.commanded import forced
from pkmcal_cli.model.effect_sites import PlacedEffect
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction.inputs import Reactions, SiteInputs
from pkmcal_cli.prediction.pipeline import predict
from pkmcal_cli.prediction.rows import Request, Rows


def sided_drives(model: Model) -> tuple[int, ...]:
    """Drives at which an effect depends on the side from which they are approached."""
    sided = (e for e in model.effects if "direction" in e.effect.needs)
    return tuple(sorted({s.actuator for e in sided for s in e.sites if s.actuator >= 0}))


def side_sigma(model: Model, rows: Rows, sizes: Mapping[str, float]) -> Array | None:
    """Standard uncertainty of the drives' travel, or commanded forces, (N, A) by sides that nobody knows; None for 0.

    sizes: of reversal errors by parameter, SI.
    """
    placed = [e for e in model.effects if "direction" in e.effect.needs and any(sizes[p] for p in e.parameters)]
    sides = np.ones(rows.readings.shape)
    for a in sided_drives(model) if placed else ():
        sides[:, a] = rows.columns.get(f"dir.{model.actuators[a].name}", sides[:, a])
    if not (sides == 0).any():
        return None
    unknown = np.nonzero((sides == 0).any(axis=1))[0]
    forward = {f"dir.{a.name}": np.ones(len(rows)) for a in model.actuators}
    ahead, forces = replace(rows, columns={**rows.columns, **forward}), np.zeros(sides.shape)
    if any(e.effect.reactive for e in placed):
        forces[unknown] = predict(model, model.nominal, ahead.take(unknown), Request(forces=True)).forces
    out = np.zeros(sides.shape)
    for e in placed:
        out += np.abs(_moved(e, model, ahead, np.nan_to_num(forces), sizes))
    return np.where(sides == 0, out, 0.0)


def _moved(placed: PlacedEffect, model: Model, ahead: Rows, forces: Array, sizes: Mapping[str, float]) -> Array:
    """By how much an effect moves what drives that come from below are commanded (N, A): their travel, or force."""
    out, by_force = np.zeros(ahead.readings.shape), forced(model)
    numbers = {n: sizes[p] for n, p in zip(placed.numbers, placed.parameters, strict=True)}
    session = ahead.columns.get(f"session.{placed.acts_in}", np.zeros(len(ahead))) if placed.acts_in else 1.0
    for site in (s for s in placed.sites if by_force[s.actuator] == (placed.effect.enters == "drive_force")):
        reactions = Reactions((site.place,), forces[:, [site.actuator]], {}, None, None)
        moved = placed.effect.displacement(SiteInputs(site, model, ahead, placed, reactions), numbers)
        out[:, site.actuator] += moved[:, 0] * session
    return out
