"""All coordinates of the tool point as channels, whatever the machine's sensors read."""

from __future__ import annotations

import numpy as np

from pkmcal_cli.equilibrium.readings import ObservedQuantity
from pkmcal_cli.mechanism.topology import GROUND
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.parts import Channel
from pkmcal_cli.units.measurands import Measurand


def tcp_model(model: Model) -> Model:
    """The model with all coordinates of the tool point as channels, whatever its sensors read."""
    point, rotation = model.tool.point, model.tool.rotation
    axes = 2 if model.topology.planar else 3
    channels = [
        Channel(
            name=c, measurand=Measurand.POSITION, index=point, component=k, sigma=np.nan, unit="m", dimension="length"
        )
        for k, c in enumerate("xyz"[:axes])
    ]
    if rotation != GROUND:
        axes_of_rotation = [2] if model.topology.planar else [0, 1, 2]
        channels += [
            Channel(
                name=f"r{'xyz'[k]}",
                measurand=Measurand.ORIENTATION,
                index=rotation,
                component=k,
                sigma=np.nan,
                unit="rad",
                dimension="angle",
            )
            for k in axes_of_rotation
        ]
    observed = tuple(ObservedQuantity(c.measurand, c.index, c.component) for c in channels)
    return model.with_channels(tuple(channels), observed)
