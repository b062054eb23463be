"""Where instruments stand that may stand anywhere: parameters whose ranges nobody stated."""

from __future__ import annotations

from pkmcal_cli.effects.instrument import FRAME
from pkmcal_cli.model.effect_sites import PlacedEffect
from pkmcal_cli.model.model import Model


def fitted_frames(model: Model) -> list[PlacedEffect]:
    """The frames of sensors with `frame: fitted`, one for each session that has its own."""
    return [e for e in model.effects if e.effect.keyword == FRAME.keyword and e.at in model.fitted_frames]


def frame_parameters(model: Model) -> frozenset[str]:
    """Names of their parameters."""
    return frozenset(n for e in fitted_frames(model) for n in e.parameters)
