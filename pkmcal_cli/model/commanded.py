"""What drives are commanded: a position, by their reading, or a force."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.equilibrium.readings import ObservedQuantity
from pkmcal_cli.mechanism.topology import Index
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.parts import Channel
from pkmcal_cli.units.measurands import Measurand


def forced(model: Model) -> NDArray[np.bool_]:
    """Drives (A,) whose force is commanded."""
    return np.array([d.force_controlled for d in model.topology.drives], dtype=bool)


def drive_sigma(model: Model) -> Array:
    """Standard uncertainty of the travel that drives are commanded (A,), m or rad; 0 of force-controlled drives, whose
    readings are measured.
    """
    return np.where(forced(model), 0.0, np.nan_to_num([a.sigma for a in model.actuators]))


def per_command(model: Model) -> Array:
    """Travel per reading of each drive (A,), without sign; 1 of force-controlled drives: their force is commanded."""
    return np.where(forced(model), 1.0, model.gains)


def reading_drives(model: Model, drives: Index) -> Model:
    """The model without effects whose channels are readings of some drives."""
    seen = tuple(ObservedQuantity(Measurand.DRIVE, int(a)) for a in drives)
    channels = tuple(
        Channel(
            name=model.drive_names[a], measurand=Measurand.DRIVE, index=int(a), component=0, sigma=np.nan, unit="1",
            dimension="none",
        )
        for a in drives
    )  # fmt: skip
    return model.with_options(()).with_channels(channels, seen)
