"""A table put right: columns exchanged, turned in sign or in a wrong unit, readings in wrong rows or from elsewhere."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pkmcal_cli.gross_errors.plausibility import Hint, MovedReadings, Right
from pkmcal_cli.gross_errors.row_shift import apply_shifts
from pkmcal_cli.tables.measurement_set import Measurements

_ARRAYS = (("actuators", "actuator_sigma", "actuator_names"), ("readings", "sigma", "channels"), ("forces", "", ""))
"""Arrays whose columns are drives, channels or forces, their standard uncertainties, and the names of the columns."""


def put_right(measured: Measurements, hints: Sequence[Hint]) -> Measurements | None:
    """The table as hints say that it should be; None where none says so."""
    if not any(hint.mends for hint in hints):
        return None
    measured = _columns_right(measured, [change for hint in hints for change in hint.columns])
    measured = _rows_right(measured, [moved for hint in hints for moved in hint.moved])
    for place in (place for hint in hints for place in hint.places):
        measured = replace(measured, readings=place.put_back(measured.readings, measured.channels))
    return measured


def _columns_right(measured: Measurements, columns: Sequence[Right]) -> Measurements:
    """With each column as it is right."""
    changed: dict[str, Any] = {}
    forces = tuple(f"{name}.force" for name in measured.actuator_names)
    for values, sigmas, named in _ARRAYS:
        names = getattr(measured, named) if named else forces
        here = [c for c in columns if c.name in names and c.source in names]
        if not here:
            continue
        to, source = ([names.index(n) for n in each] for each in zip(*((c.name, c.source) for c in here), strict=True))
        factor, shift = np.array([c.factor for c in here]), np.array([c.shift for c in here])
        for name, scale, more in ((values, factor, shift), *([(sigmas, np.abs(factor), 0.0)] if sigmas else [])):
            array = getattr(measured, name)
            changed[name] = np.array(array)
            changed[name][:, to] = array[:, source] * scale + more
    return replace(measured, **changed)


def _rows_right(measured: Measurements, moved: Sequence[MovedReadings]) -> Measurements:
    """With readings, and what rows state of their uncertainty, in the rows where they belong."""
    for each in moved:
        changed: dict[str, Any] = {}
        for values, sigmas, named in _ARRAYS[:2]:
            columns = [k for k, name in enumerate(getattr(measured, named)) if name in each.names]
            for name in (values, sigmas) if columns else ():
                array = changed[name] = getattr(measured, name).copy()
                shift = each.shift, each.first, each.unsure
                array[:, columns] = apply_shifts(array[:, columns], measured.session, [shift])
        measured = replace(measured, **changed)
    return measured
