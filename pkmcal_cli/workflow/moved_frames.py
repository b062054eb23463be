"""Instruments that were moved since a parameter file was written, whose frames a fit is to hold as they were."""

from __future__ import annotations

from collections.abc import Collection

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.frame_start import moved_instruments
from pkmcal_cli.model.model import Model


def moved_warnings(
    values: Array, declared: Model, placed: Model, selected: Collection[str], file: str | None
) -> tuple[str, ...]:
    """A warning for each frame that is held, at values (P,), far from where the readings put the instrument.

    `declared`: the model of the machine file; `placed`: with the poses that readings suggest; file: of the values.
    """
    return tuple(
        f"warning: {frame} is held at the values of {file}, but the readings place the instrument elsewhere: "
        f"if it was moved, identify its frame too (`--select ...,{frame}.*`)"
        for frame in moved_instruments(values, declared, placed, selected)
    )
