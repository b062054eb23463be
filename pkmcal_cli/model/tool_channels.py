"""All coordinates of the tool point as channels, whatever the machine's sensors read, and loads beside them."""

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


def ropes_of(model: Model) -> tuple[tuple[int, int, str], ...]:
    """Group, element and name of every rope."""
    groups = enumerate(model.topology.groups)
    return tuple((g, e, name) for g, group in groups for e, name in enumerate(group.names) if group.rope[e])


def with_loads(model: Model, taut: bool = False) -> Model:
    """The same channels, then the force of every drive, the tension of every rope, and the strain energy.

    `taut`: ropes push too.
    """
    tool, ropes = tcp_model(model.with_taut_ropes() if taut else model), ropes_of(model)
    observed = [ObservedQuantity(Measurand.FORCE, a) for a in range(len(model.actuators))]
    observed += [ObservedQuantity(Measurand.TENSION, g, e) for g, e, _ in ropes]
    observed += [ObservedQuantity(Measurand.ENERGY, 0)]
    names = [*model.drive_names, *(name for *_, name in ropes), "energy"]
    channels = [
        Channel(
            name=f"{q.measurand.label}.{name}", measurand=q.measurand, index=q.index, component=q.component,
            sigma=np.nan, unit="1", dimension="none",
        )
        for name, q in zip(names, observed, strict=True)
    ]  # fmt: skip
    every = (*tool.channels, *channels)
    return tool.with_channels(every, (*tool.observed, *observed))
